//! The search in large games: descents by tables of one network's unknowns, and restarts that a model of Θ chooses.
//!
//! In a large game a descent takes as long as some hundred restarts in a small one, and there are as many restarts as
//! players, several times. So each start that changes the rows of one player or two is first followed in these rows
//! alone, the others fixed: a problem of few unknowns. From its end Newton's model at the best point foretells how far all
//! rows together would descend. The starts that it foretells below the best point are made, the most promising
//! [`RESTARTS`] of a round; [`Candidate::left_out`] counts those beyond.
//!
//! The restarts are those of small games (`moves`): a row reversed or left out, two players' rows exchanged with any
//! signs, i takes the row of j, which plays next to nothing, one gain reversed; pairs only of players whose rows have an
//! entry in common, since others see nothing of each other in X.
//!
//! Up to [`DOUBLED_UP_TO`] unknowns descents in doubled gains, which need eight times as many operations, are made, too,
//! and descents from the canonical start without one row.

use super::candidate::{Candidate, Start, TIE};
use super::stages::Search;
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::zeros;
use crate::simd::{Width, norm, widened};
use crate::synthesis::newton::{
    Backend, Layout, Limits, Objective, Owner, Reached, Tasks, Variable, Workspace, factorise, forward, minimise,
    packed,
};
use crate::synthesis::theta::{Problem, Scratch, Tabled, TabledCertificate, TabledParts};

/// Restarts of all rows made in one round.
pub(super) const RESTARTS: usize = 24;
/// Unknowns up to which descents in doubled gains are made.
pub(super) const DOUBLED_UP_TO: usize = 128;
/// How much more than foretold a restart may descend.
const TRUST: f64 = 4.0;
/// How much more than each unknown alone all may be foretold to gain.
const ALONE: f64 = 10.0;
/// What is left of a row that is left out, and of a gain that matters in its row.
const LEFT: f64 = 0.1;
const GAIN: f64 = 0.2;
/// Distance from the best point, relative to it, at which rows alone are back.
const BACK: f64 = 1e-3;
/// How far up rows alone may begin, relative to the best point.
const HIGHEST: f64 = 10.0;
/// Steps of rows alone, and the relative gradient at which they have arrived.
const ROW_STEPS: usize = 30;
const ROW_TOLERANCE: f64 = 1e-7;
/// How far below zero rounding may push the certificate's form, and what a certified minimum may leave to be gained.
const CERTIFICATE_ROUNDING: f64 = 1e-12;
const CERTIFICATE_LEAVES: (f64, f64) = (1e-10, 1e-15);
/// What asks for memory here.
const WHAT: &str = "the restarts in a large game";

widened! {
    /// Makes the listed descents of one network.
    #[inline(never)]
    pub(super) fn descend_tabled<V>(
        tabled: &mut Tabled,
        tasks: &mut Tasks,
        owner: Owner<'_>,
        limits: Limits,
        backend: Backend<'_>,
        workspace: &mut Workspace<f64>,
    ) -> Result<(), Stopped> {
        minimise(tabled, tasks, &[owner], limits, backend, workspace)
    }
}

widened! {
    /// Whether the certificate proves a point of a network to be a global minimiser.
    #[inline(never)]
    pub(super) fn certify_tabled<V>(
        tabled: &mut Tabled,
        g: &[f64],
        layout: &Layout<f64>,
        backend: Backend<'_>,
    ) -> Result<bool, Stopped> {
        let (d, used) = (layout.len(), layout.used());
        let (mut full, mut row) = (zeros(WHAT, g.len())?, zeros(WHAT, g.len())?);
        let (mut gradient, mut parts) = (zeros(WHAT, d)?, zeros(WHAT, d)?);
        let (mut form, mut factor) = (zeros(WHAT, packed(d))?, zeros(WHAT, d * d)?);
        let value = tabled.value(g);
        tabled.gradient(g, &mut full);
        layout.restrict(&full, &mut gradient);
        layout.restrict_form(&TabledCertificate(tabled), g, &mut row, &mut form, backend.cancel);
        tabled.measure();
        layout.diagonal(&TabledParts(tabled), g, &mut row, &mut parts);
        for i in 0..used {
            let scale = if parts[i] > 0.0 { 1.0 / parts[i].sqrt() } else { 1.0 };
            parts[i] = scale;
            gradient[i] *= scale;
            form[packed(i)..packed(i + 1)].iter_mut().zip(&parts).for_each(|(x, other)| *x *= scale * other);
        }
        let definite = factorise(&form, CERTIFICATE_ROUNDING, layout, backend, &mut factor).0;
        let left = 0.5 * forward(&factor, d, &mut gradient);
        Ok(definite && left <= CERTIFICATE_LEAVES.0 * value + CERTIFICATE_LEAVES.1 * tabled.value_scale())
    }
}

/// The layout of one network's variables.
pub(super) fn layout_of(width: usize, variables: &[Variable]) -> Result<Layout<f64>, Stopped> {
    let mut layout = Layout::default();
    layout.reserve(width, variables.len())?;
    layout.begin(width, 1);
    layout.place(0, variables);
    layout.list();
    Ok(layout)
}

/// A start: new rows for some players of the tables, by their index there.
struct Change {
    rows: Vec<(usize, Vec<f64>)>,
}

/// Newton's model at the best point of a candidate.
struct Model {
    layout: Layout<f64>,
    /// The factor of the Hessian.
    factor: Vec<f64>,
    /// Its diagonal, positive.
    diagonal: Vec<f64>,
    /// Θ there.
    value: f64,
}

/// Starts of large games, each with Θ where it is foretold to lead.
type Promising = Vec<(f64, Vec<f64>)>;

/// The starts that promise to lead below the best point, the most promising first.
pub(super) fn promising(
    problem: &Problem,
    candidate: &Candidate,
    tabled: &mut Tabled,
    cancel: &CancelToken,
) -> Result<Promising, Stopped> {
    let mut found = Vec::new();
    search_rows(Width::in_use(), problem, candidate, tabled, &mut found, cancel)?;
    // Ties by the order in which they were listed.
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(found)
}

widened! {
    #[inline(never)]
    fn search_rows<V>(
        problem: &Problem,
        candidate: &Candidate,
        tabled: &mut Tabled,
        found: &mut Promising,
        cancel: &CancelToken,
    ) -> Result<(), Stopped> {
        let g = &candidate.g;
        let layout = layout_of(g.len(), &candidate.variables)?;
        let backend = Backend { library: true, width: Width::in_use(), cancel: Some(cancel) };
        let Some(model) = model(tabled, candidate, layout, backend)? else { return Ok(()) };
        let lists: Vec<&[Variable]> = candidate.variables.chunk_by(|a, b| a.own == b.own).collect();
        let (mut tasks, mut workspace) = (Tasks::default(), Workspace::default());
        let mut full = zeros(WHAT, g.len())?;
        let mut gradient = zeros(WHAT, model.layout.len())?;
        let limits = Limits {
            iterations: ROW_STEPS, tolerance: ROW_TOLERANCE, acceptable: ROW_TOLERANCE, longest: f64::INFINITY,
        };
        let below = model.value - TIE * model.value.abs();
        let base = tabled.base(g);
        let n = problem.size;
        let mut scratch = Some(Scratch::new(n, 2)?);
        let mut end = g.clone();
        for change in changes(problem, candidate, tabled) {
            cancel.check()?;
            let rows: Vec<usize> = change.rows.iter().map(|&(row, _)| row).collect();
            tabled.beside(&base, None);
            let Some(held) = scratch.take() else { break };
            let mut part = tabled.of_rows(&rows, held)?;
            // The same variables in gains of these rows alone.
            let mut variables = Vec::new();
            tasks.clear(rows.len() * n, 1);
            let start = tasks.add(0, false, 0.0)?;
            for (i, (row, new)) in change.rows.iter().enumerate() {
                let here = |at: usize| i * n + at % n;
                variables.extend(lists[*row].iter().map(|v| Variable { entry: here(v.entry), own: here(v.own), ..*v }));
                tabled.support_of(*row).iter().zip(new).for_each(|(&at, &x)| start[here(at)] = x);
            }
            let near = part.value(start) <= HIGHEST * model.value;
            if near {
                let owner = [Owner { variables: &variables, incumbent: None }];
                minimise(&mut part, &mut tasks, &owner, limits, backend, &mut workspace)?;
            }
            scratch = Some(part.recycle());
            if !near {
                continue;
            }
            let (mut away, mut size) = (0.0, 0.0);
            for (i, &row) in rows.iter().enumerate() {
                for &at in tabled.support_of(row) {
                    end[at] = tasks.point(0)[i * n + at % n];
                    away += (end[at] - g[at]).powi(2);
                    size += g[at].powi(2);
                }
            }
            if away > BACK * BACK * size {
                let value = tabled.beside(&base, Some((&end, &rows)));
                tabled.gradient(&end, &mut full);
                model.layout.restrict(&full, &mut gradient);
                // At most some ten times what each unknown alone would gain.
                let alone: f64 = gradient.iter().zip(&model.diagonal).map(|(g, h)| g * g / h).sum();
                if value - ALONE * 0.5 * alone < below {
                    let foretold = value - TRUST * 0.5 * forward(&model.factor, model.layout.len(), &mut gradient);
                    if foretold < below {
                        found.push((foretold, end.clone()));
                    }
                }
            }
            for &at in rows.iter().flat_map(|&row| tabled.support_of(row)) {
                end[at] = g[at];
            }
        }
        Ok(())
    }
}

/// Newton's model at the best point; none where the Hessian is not definite even with some damping.
#[inline(always)]
fn model(
    tabled: &mut Tabled,
    candidate: &Candidate,
    layout: Layout<f64>,
    backend: Backend<'_>,
) -> Result<Option<Model>, Stopped> {
    let d = layout.len();
    let mut row = zeros(WHAT, candidate.g.len())?;
    let (mut hessian, mut factor) = (zeros(WHAT, packed(d))?, zeros(WHAT, d * d)?);
    let value = tabled.value(&candidate.g);
    tabled.keep(true);
    tabled.prepare(&candidate.g);
    layout.restrict_form(tabled, &candidate.g, &mut row, &mut hessian, backend.cancel);
    let largest = layout.largest(&hessian);
    for damping in [1e-12, 1e-8, 1e-4] {
        if factorise(&hessian, damping * largest, &layout, backend, &mut factor).0 {
            let least = f64::MIN_POSITIVE.max(damping * largest);
            let diagonal = (0..d).map(|i| hessian[packed(i) + i].max(least)).collect();
            return Ok(Some(Model { layout, factor, diagonal, value }));
        }
    }
    Ok(None)
}

/// The starts that change the rows of one player or two.
fn changes(problem: &Problem, candidate: &Candidate, tabled: &Tabled) -> Vec<Change> {
    let (n, r) = (problem.size, &problem.theta.double.r);
    let players: Vec<usize> = tabled.players().collect();
    let gains = |row: usize| -> Vec<f64> { tabled.support_of(row).iter().map(|&at| candidate.g[at]).collect() };
    let relative: Vec<bool> =
        candidate.variables.chunk_by(|a, b| a.own == b.own).map(|variables| variables[0].relative).collect();
    let scaled = |row: &[f64], factor: f64| -> Vec<f64> { row.iter().map(|x| factor * x).collect() };
    let all: Vec<Vec<f64>> = (0..players.len()).map(gains).collect();
    let size: Vec<f64> = all.iter().zip(&players).map(|(row, &i)| norm(row) * r[i].sqrt()).collect();
    let mut out = Vec::new();
    for (p, row) in all.iter().enumerate().filter(|&(p, _)| size[p] > 0.0) {
        out.push(Change { rows: vec![(p, scaled(row, -1.0))] });
        out.push(Change { rows: vec![(p, scaled(row, LEFT))] });
        let own = players[p] * n + players[p];
        for (at, &x) in row.iter().enumerate() {
            let position = tabled.support_of(p)[at];
            if x.abs() < GAIN * norm(row) || relative[p] && position == own {
                continue;
            }
            let mut new = row.clone();
            new[at] = -x;
            if relative[p]
                && let Ok(own) = tabled.support_of(p).binary_search(&own)
            {
                new[own] += 2.0 * x;
            }
            out.push(Change { rows: vec![(p, new)] });
        }
    }
    // Row q as p takes it.
    let taken = |p: usize, q: usize| -> Option<Vec<f64>> {
        let (of_p, of_q) = (tabled.support_of(p), tabled.support_of(q));
        let factor = (r[players[q]] / r[players[p]]).sqrt();
        let mut kept = 0.0_f64;
        let mut row: Vec<f64> = of_p
            .iter()
            .map(|&at| of_q.binary_search_by_key(&(at % n), |&e| e % n).map_or(0.0, |e| factor * all[q][e]))
            .collect();
        if relative[p] {
            let mean = row.iter().sum::<f64>() / row.len() as f64;
            row.iter_mut().for_each(|x| *x -= mean);
        }
        kept = kept.max(norm(&row) * r[players[p]].sqrt());
        (kept > 0.0 && kept >= super::moves::KEPT * size[q]).then_some(row)
    };
    for p in 0..players.len() {
        for q in (0..players.len()).filter(|&q| q != p && size[q] > 0.0) {
            let Some(of_q) = taken(p, q) else { continue };
            out.push(Change { rows: in_order((p, of_q.clone()), (q, scaled(&all[q], LEFT))) });
            if p < q
                && let Some(of_p) = taken(q, p)
            {
                for (a, b) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                    out.push(Change { rows: in_order((p, scaled(&of_q, a)), (q, scaled(&of_p, b))) });
                }
            }
        }
    }
    out
}

fn in_order(a: (usize, Vec<f64>), b: (usize, Vec<f64>)) -> Vec<(usize, Vec<f64>)> {
    if a.0 < b.0 { vec![a, b] } else { vec![b, a] }
}

impl Search<'_> {
    /// Finds the lowest Θ that it can for one candidate of a large game.
    pub(super) fn run_large(&mut self, candidate: &mut Candidate) -> Result<(), Stopped> {
        let cancel = self.dispatcher.cancel().clone();
        let mut tabled = Tabled::new(self.problem, &candidate.variables, &candidate.initial, &cancel)?;
        self.begin(1);
        self.tasks.add(0, false, 0.0)?.copy_from_slice(&candidate.initial);
        let reached = self.tabled(&mut tabled, candidate, true)?;
        candidate.take(Start::Canonical, self.tasks.point(0), reached);
        candidate.iterations = reached.iterations;
        candidate.note_quick();
        self.certify_large(&mut tabled, candidate)?;
        if candidate.certified || candidate.variables.is_empty() {
            return Ok(());
        }
        if candidate.variables.len() <= DOUBLED_UP_TO {
            let mut starts = self.double(std::slice::from_mut(candidate), &[0])?;
            let n = self.problem.size;
            for row in candidate.variables.chunk_by(|a, b| a.own == b.own) {
                let (i, start) = (row[0].own / n, self.tasks.add(0, false, 0.0)?);
                start.copy_from_slice(&candidate.initial);
                start[i * n..(i + 1) * n].fill(0.0);
                starts.push(Start::Reversed);
            }
            self.offer_large(&mut tabled, candidate, &mut starts)?;
        }
        for _ in 0..super::stages::ROUNDS {
            let mut promising = promising(self.problem, candidate, &mut tabled, &cancel)?;
            candidate.left_out += promising.len().saturating_sub(RESTARTS);
            promising.truncate(RESTARTS);
            self.begin(1);
            for (_, g) in &promising {
                self.tasks.add(0, false, 0.0)?.copy_from_slice(g);
            }
            if !self.offer_large(&mut tabled, candidate, &mut vec![Start::Reversed; promising.len()])? {
                break;
            }
        }
        if candidate.start != Start::Canonical {
            self.certify_large(&mut tabled, candidate)?;
        }
        Ok(())
    }

    /// Makes the listed descents; what the first reached.
    fn tabled(&mut self, tabled: &mut Tabled, candidate: &Candidate, first: bool) -> Result<Reached, Stopped> {
        let cancel = self.dispatcher.cancel();
        let backend = Backend { library: true, width: Width::in_use(), cancel: Some(cancel) };
        let owner = if first { Owner { variables: &candidate.variables, incumbent: None } } else { candidate.owner() };
        descend_tabled(Width::in_use(), tabled, self.tasks, owner, self.limits, backend, self.workspace)?;
        cancel.check()?;
        Ok(if self.tasks.len() > 0 { self.tasks.reached(0) } else { Reached::default() })
    }

    /// Makes the listed descents and keeps what is lower; whether anything was.
    fn offer_large(
        &mut self,
        tabled: &mut Tabled,
        candidate: &mut Candidate,
        starts: &mut Vec<Start>,
    ) -> Result<bool, Stopped> {
        self.tabled(tabled, candidate, false)?;
        let mut lower = false;
        for (task, start) in starts.drain(..).enumerate() {
            lower |= candidate.offer(start, self.tasks.point(task), self.tasks.reached(task));
        }
        Ok(lower)
    }

    fn certify_large(&mut self, tabled: &mut Tabled, candidate: &mut Candidate) -> Result<(), Stopped> {
        let cancel = self.dispatcher.cancel();
        let backend = Backend { library: true, width: Width::in_use(), cancel: Some(cancel) };
        let layout = layout_of(candidate.g.len(), &candidate.variables)?;
        candidate.certified = certify_tabled(Width::in_use(), tabled, &candidate.g, &layout, backend)?;
        Ok(cancel.check()?)
    }
}

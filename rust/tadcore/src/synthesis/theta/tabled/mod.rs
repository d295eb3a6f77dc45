//! Θ of one network of a large game, by tables as large as its unknowns are many.
//!
//! ‖E_p‖² and c_i‖Δ_i‖² are quadratic in the gains, and X = GᵀRG − M differs from −M only where two players are used in
//! one row. So for the entries that a network leaves free, its *support*,
//!
//! $$\Theta = \Theta_0 + b^\top(g - g_0) + \tfrac12 (g - g_0)^\top Q\,(g - g_0)
//!   + \gamma_1\sum_{(a, b)} X_{ab}^2 - \gamma_1\sum_{(a, b)} X_{ab}^2(g_0),$$
//!
//! with the sum over pairs (a, b) of one row. A value costs as many operations as Q has entries, where Θ over all m × N
//! gains costs several times mN². The tables are made at the start g₀, from Θ over all gains.
//!
//! The same tables restricted to the rows of a few players, the others fixed, are Θ as a function of these rows alone.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | g₀ | `origin` | the point that the tables are made at |
//! | Q, b | `quadratic`, `slope` | Hessian and gradient there, without the part of X |
//! | X_ab | `x` | one number for each pair a ≤ b |
//! | Θ₀ − γ₁ΣX²(g₀) | `rest` | what no gain changes |

mod forms;

use std::ops::Range;

pub(crate) use forms::{TabledCertificate, TabledParts};

use super::{Coefficients, Problem, RealGains};
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::{copy, reserve, zeros};
use crate::simd::{Width, widened};
use crate::synthesis::newton::{Objective, Variable};

/// What asks for memory here.
const WHAT: &str = "Θ of one network";
/// A pair of players that no row uses together, an entry of the gains outside of the support.
const NONE: u32 = u32::MAX;

/// The entries of one player's row that may differ from zero.
#[derive(Debug, Clone)]
struct Row {
    player: usize,
    /// Its entries in the support.
    entries: Range<usize>,
    /// Where its pairs begin in `Tabled::pairs`: an entry for each pair of its entries.
    pairs: usize,
}

/// Θ over the support of one network.
#[derive(Debug)]
pub(crate) struct Tabled {
    size: usize,
    width: usize,
    first: f64,
    value_scale: f64,
    fne: f64,
    target_norm: f64,
    gradient_parts: (f64, f64),
    rows: Vec<Row>,
    /// r of each of these rows.
    r: Vec<f64>,
    /// The entries of the support by their position in the gains; and by that position the entry.
    support: Vec<usize>,
    entry: Vec<u32>,
    /// Scratch by pairs of players, empty.
    seen: Vec<u32>,
    /// The row of each entry.
    row: Vec<u32>,
    pairs: Vec<u32>,
    /// Each pair by its players, M there without what other rows add, and how often X holds it.
    players: Vec<(usize, usize)>,
    target: Vec<f64>,
    often: Vec<f64>,
    origin: Vec<f64>,
    quadratic: Vec<f64>,
    slope: Vec<f64>,
    rest: f64,
    /// ‖X‖² over the pairs that no row uses.
    outside: f64,
    /// At the point last evaluated: its gains, b + Q(g − g₀), X.
    point: Vec<f64>,
    linear: Vec<f64>,
    x: Vec<f64>,
    /// X at the point kept for the Hessian, its gains, and the products of its rows.
    kept: Vec<f64>,
    held: Vec<f64>,
    gram: Vec<f64>,
    /// Scratch, as large as the support.
    part: Vec<f64>,
}

widened! {
    /// Θ over all gains, and its gradient.
    #[inline(never)]
    fn over_all_gains<V>(of: &Coefficients<f64>, g: &[f64], slope: &mut [f64], cancel: &CancelToken) -> Result<f64, Stopped> {
        let mut all = RealGains::<f64, 0>::new(of, Some(cancel))?;
        let value = all.value(g);
        all.gradient(g, slope);
        Ok(value)
    }
}

/// What tables of a few rows need that is as large as the game, so that it is filled once.
#[derive(Debug)]
pub(crate) struct Scratch {
    entry: Vec<u32>,
    seen: Vec<u32>,
}

impl Scratch {
    /// Scratch for tables of `rows` players of N.
    pub(crate) fn new(n: usize, rows: usize) -> Result<Self, Stopped> {
        let mut scratch = Self { entry: zeros(WHAT, rows * n)?, seen: zeros(WHAT, n * n)? };
        scratch.entry.fill(NONE);
        scratch.seen.fill(NONE);
        Ok(scratch)
    }
}

/// A point that others are evaluated beside.
#[derive(Debug, Default)]
pub(crate) struct Base {
    point: Vec<f64>,
    linear: Vec<f64>,
}

impl Tabled {
    /// The tables of `variables` at the gains `origin`.
    pub(crate) fn new(
        problem: &Problem,
        variables: &[Variable],
        origin: &[f64],
        cancel: &CancelToken,
    ) -> Result<Self, Stopped> {
        let (n, of) = (problem.size, &problem.theta.double);
        let mut support = Vec::new();
        reserve(WHAT, &mut support, 2 * variables.len())?;
        for row in variables.chunk_by(|a, b| a.own == b.own) {
            support.extend(row.iter().map(|v| v.entry).chain(row[0].relative.then_some(row[0].own)));
        }
        support.sort_unstable();
        let mut tabled = Self::shape(n, problem.rows, support, Scratch::new(n, problem.rows)?)?;
        (tabled.first, tabled.value_scale) = (of.first, of.scale.value);
        (tabled.fne, tabled.target_norm) = (of.scale.fne, of.scale.target);
        tabled.gradient_parts = (of.scale.quartic, 8.0 * of.scale.coupling + 2.0 * of.scale.closeness);
        tabled.r = tabled.rows.iter().map(|row| of.r[row.player]).collect();
        tabled.target = tabled.players.iter().map(|&(a, b)| of.target[a * n + b]).collect();

        let inside: f64 = tabled.target.iter().zip(&tabled.often).map(|(t, often)| often * t * t).sum();
        tabled.outside = (of.scale.target.powi(2) - inside).max(0.0);

        let mut slope = zeros(WHAT, origin.len())?;
        let value = over_all_gains(Width::in_use(), of, origin, &mut slope, cancel)?;
        tabled.origin = tabled.support.iter().map(|&at| origin[at]).collect();
        tabled.slope = tabled.support.iter().map(|&at| slope[at]).collect();
        let s = tabled.support.len();
        tabled.quadratic = zeros(WHAT, s * s)?;
        for e in 0..s {
            cancel.check()?;
            let (i, a) = (tabled.support[e] / n, tabled.support[e] % n);
            for f in 0..=e {
                let (j, b) = (tabled.support[f] / n, tabled.support[f] % n);
                let mut q = of.coupling.iter().map(|w| w[j * n + a] * w[i * n + b]).sum::<f64>();
                if a == b {
                    q += of.gram[i * of.rows + j] + if i == j { 0.5 * of.closeness[i] } else { 0.0 };
                }
                (tabled.quadratic[e * s + f], tabled.quadratic[f * s + e]) = (4.0 * q, 4.0 * q);
            }
        }
        // The part of X comes off value and slope: it is added at every point.
        tabled.begin(value)?;
        Ok(tabled)
    }

    /// Rows, pairs and empty vectors for a support in order.
    fn shape(n: usize, m: usize, support: Vec<usize>, scratch: Scratch) -> Result<Self, Stopped> {
        let mut rows: Vec<Row> = Vec::new();
        let (Scratch { mut entry, mut seen }, mut at) = (scratch, 0);
        let mut pairs = Vec::new();
        let (mut players, mut often, mut row_of) = (Vec::new(), Vec::new(), Vec::new());
        for of_row in support.chunk_by(|a, b| a / n == b / n) {
            reserve(WHAT, &mut pairs, of_row.len().pow(2))?;
            rows.push(Row { player: of_row[0] / n, entries: at..at + of_row.len(), pairs: pairs.len() });
            for &e in of_row {
                entry[e] = at as u32;
                row_of.push(rows.len() as u32 - 1);
                at += 1;
                for &f in of_row {
                    let (a, b) = (e % n, f % n);
                    let known = &mut seen[a.min(b) * n + a.max(b)];
                    if *known == NONE {
                        *known = players.len() as u32;
                        players.push((a.min(b), a.max(b)));
                        often.push(if a == b { 1.0 } else { 2.0 });
                    }
                    pairs.push(*known);
                }
            }
        }
        players.iter().for_each(|&(a, b)| seen[a * n + b] = NONE);
        let (s, count, lines) = (support.len(), players.len(), rows.len());
        Ok(Self {
            size: n,
            width: m * n,
            first: 0.0,
            value_scale: 0.0,
            fne: 0.0,
            target_norm: 0.0,
            gradient_parts: (0.0, 0.0),
            rows,
            r: Vec::new(),
            support,
            entry,
            seen,
            row: row_of,
            pairs,
            players,
            target: Vec::new(),
            often,
            origin: Vec::new(),
            quadratic: Vec::new(),
            slope: Vec::new(),
            rest: 0.0,
            outside: 0.0,
            point: zeros(WHAT, s)?,
            linear: zeros(WHAT, s)?,
            x: zeros(WHAT, count)?,
            kept: zeros(WHAT, count)?,
            held: zeros(WHAT, s)?,
            gram: zeros(WHAT, lines * lines)?,
            part: zeros(WHAT, s)?,
        })
    }

    /// Takes the part of X off `slope` and the value at the origin.
    fn begin(&mut self, value: f64) -> Result<(), Stopped> {
        self.point.copy_from_slice(&self.origin);
        self.square();
        let mut part = zeros(WHAT, self.support.len())?;
        self.slope_of_square(&mut part);
        self.slope.iter_mut().zip(&part).for_each(|(s, p)| *s -= p);
        self.rest = value - self.first * self.sum_of_squares();
        self.linear.copy_from_slice(&self.slope);
        Ok(())
    }

    /// Θ as a function of the rows of a few players, `rows` of these tables in order, around the point last evaluated: of
    /// gains that have no other rows.
    pub(crate) fn of_rows(&self, rows: &[usize], scratch: Scratch) -> Result<Self, Stopped> {
        let entries: Vec<usize> = rows.iter().flat_map(|&row| self.rows[row].entries.clone()).collect();
        let own = rows.iter().enumerate().flat_map(|(i, &row)| self.support_of(row).iter().map(move |&at| (i, at)));
        let support = own.map(|(i, at)| i * self.size + at % self.size).collect();
        let mut part = Self::shape(self.size, rows.len(), support, scratch)?;
        (part.first, part.value_scale) = (self.first, self.value_scale);
        (part.fne, part.target_norm, part.gradient_parts) = (self.fne, self.target_norm, self.gradient_parts);
        // Small beside what matters: the scale of a gradient needs no more.
        part.outside = (self.outside + self.sum_of_squares()).max(0.0);
        part.r = rows.iter().map(|&row| self.r[row]).collect();
        part.origin = entries.iter().map(|&e| self.point[e]).collect();
        part.slope = entries.iter().map(|&e| self.linear[e]).collect();
        let (s, own) = (self.support.len(), entries.len());
        part.quadratic = copy(WHAT, &[])?;
        reserve(WHAT, &mut part.quadratic, own * own)?;
        for &e in &entries {
            part.quadratic.extend(entries.iter().map(|&f| self.quadratic[e * s + f]));
        }
        // M less what the other rows add to X.
        part.target = vec![0.0; part.players.len()];
        part.point.copy_from_slice(&part.origin);
        part.square();
        let mut target = vec![0.0; part.players.len()];
        for (new, &old) in part.rows.iter().zip(rows) {
            let (count, old) = (new.entries.len().pow(2), self.rows[old].pairs);
            for (&p, &of) in part.pairs[new.pairs..][..count].iter().zip(&self.pairs[old..][..count]) {
                target[p as usize] = part.x[p as usize] - self.x[of as usize];
            }
        }
        part.target = target;
        part.square();
        part.rest = self.theta() - part.first * part.sum_of_squares();
        part.linear.copy_from_slice(&part.slope);
        Ok(part)
    }

    /// Gives back what [`Self::of_rows`] was given, as empty as it was.
    pub(crate) fn recycle(self) -> Scratch {
        let Self { mut entry, seen, support, .. } = self;
        support.iter().for_each(|&at| entry[at] = NONE);
        Scratch { entry, seen }
    }

    /// Evaluates Θ at `g` and keeps what serves points beside it.
    #[inline(always)]
    pub(crate) fn base(&mut self, g: &[f64]) -> Base {
        self.value(g);
        Base { point: self.point.clone(), linear: self.linear.clone() }
    }

    /// Θ at a point that differs from `base` in a few rows alone; without a point, at the base itself.
    #[inline(always)]
    pub(crate) fn beside(&mut self, base: &Base, other: Option<(&[f64], &[usize])>) -> f64 {
        self.point.copy_from_slice(&base.point);
        self.linear.copy_from_slice(&base.linear);
        let s = self.support.len();
        if let Some((g, rows)) = other {
            for e in rows.iter().flat_map(|&row| self.rows[row].entries.clone()) {
                let step = g[self.support[e]] - base.point[e];
                self.point[e] = g[self.support[e]];
                self.linear.iter_mut().zip(&self.quadratic[e * s..]).for_each(|(l, q)| *l += step * q);
            }
        }
        self.square();
        self.theta()
    }

    /// Rows of these tables, by their players.
    pub(crate) fn players(&self) -> impl Iterator<Item = usize> {
        self.rows.iter().map(|row| row.player)
    }

    /// The support of a row, as positions in the gains.
    pub(crate) fn support_of(&self, row: usize) -> &[usize] {
        &self.support[self.rows[row].entries.clone()]
    }

    /// X at the point.
    #[inline(always)]
    fn square(&mut self) {
        self.x.iter_mut().zip(&self.target).for_each(|(x, t)| *x = -t);
        for (row, r) in self.rows.iter().zip(&self.r) {
            let g = &self.point[row.entries.clone()];
            let pairs = &self.pairs[row.pairs..][..g.len().pow(2)];
            for (a, (ga, pairs)) in g.iter().zip(pairs.chunks_exact(g.len())).enumerate() {
                for (gb, &p) in g[a..].iter().zip(&pairs[a..]) {
                    self.x[p as usize] += r * ga * gb;
                }
            }
        }
    }

    #[inline(always)]
    fn sum_of_squares(&self) -> f64 {
        self.x.iter().zip(&self.often).map(|(x, often)| often * x * x).sum()
    }

    /// 4γ₁ r_i g_i X by entries.
    #[inline(always)]
    fn slope_of_square(&self, out: &mut [f64]) {
        for (row, r) in self.rows.iter().zip(&self.r) {
            let g = &self.point[row.entries.clone()];
            let pairs = &self.pairs[row.pairs..][..g.len().pow(2)];
            for (out, pairs) in out[row.entries.clone()].iter_mut().zip(pairs.chunks_exact(g.len())) {
                let sum: f64 = g.iter().zip(pairs).map(|(g, &p)| g * self.x[p as usize]).sum();
                *out = 4.0 * self.first * r * sum;
            }
        }
    }

    /// Θ at the point last evaluated.
    #[inline(always)]
    fn theta(&self) -> f64 {
        let steps = self.point.iter().zip(&self.origin).zip(self.linear.iter().zip(&self.slope));
        let quadratic: f64 = steps.map(|((g, g0), (now, then))| (g - g0) * (now + then)).sum();
        self.rest + 0.5 * quadratic + self.first * self.sum_of_squares()
    }
}

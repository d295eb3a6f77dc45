//! From the canonical start to the global minimum: which descents are made, and when no more are needed.
//!
//! 1. Newton from the canonical start. Most entries end here: the certificate of `objective` proves the
//!    minimum global (of random networks, about four in five at n = 3 and three in five at n = 5).
//! 2. Otherwise a second look in complex gains and a third in stacked gains, both from the canonical start with a fixed
//!    pattern of a second part B as large as the gains. Each descends without long jumps between basins and comes back
//!    to the real gains A, A + B and A − B, from where Newton finishes.
//! 3. A last look: Newton from the canonical start without one row at a time, then from the best point with one row or
//!    two rows reversed, again while that goes lower: GᵀRG does not see the sign of a row, so minima come in families
//!    that differ by signs.
//!
//! The lowest Θ is kept; a look must win by more than rounding, so ties go to the earliest. Everything here is a
//! function of (t_k, topology) alone. How often each look is needed: `docs/decisions/0003-synthesis.md`.

use super::complex::{ComplexGains, minimise_complex};
use super::newton::{Limits, Objective, Reached, Rival, Workspace};
use super::objective::{RealGains, minimise_real, norm};
use super::problem::Problem;
use super::start::{self, Variable};
use crate::width::Width;

/// The look that won.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Newton from the canonical start.
    Canonical,
    /// The second look, in complex gains.
    Complex,
    /// The third look, in stacked gains.
    Stacked,
    /// The last look, with rows reversed or left out.
    Reversed,
}

/// Size of the second part B at the start, relative to ‖F‖.
const FAR: f64 = 1.0;
/// Longest step of a second or third look, relative to ‖F‖: no jump from basin to basin.
const LONGEST_STEP: f64 = 0.3;
/// Relative gradient at which a second or third look has found its basin.
const BASIN: f64 = 1e-6;
/// Steps of a second or third look.
const LOOK_ITERATIONS: usize = 300;
/// Constrained players up to which pairs of rows are reversed too; beyond, one row at a time.
const PAIRS_UP_TO: usize = 8;
/// Rounds of reversals, each from the best point of the one before.
const ROUNDS: usize = 4;
/// Iterations of the first descent up to which later ones may end early, back at the best point or unable to win: more
/// of them mean a narrow valley, whose floor is worth following to its end.
const QUICK: usize = 30;
/// Distance, relative to the best gains, at which a descent is taken to be back at them.
const BACK: f64 = 1e-3;
/// How much lower, relatively, a look must be to win.
const TIE: f64 = 1e-9;
/// How far below zero, relative to its largest diagonal entry, rounding may push the certificate's form.
const CERTIFICATE_ROUNDING: f64 = 1e-12;

/// Scratch reused from solve to solve.
#[derive(Debug)]
pub(super) struct Scratch {
    width: Width,
    pub(super) newton: Workspace,
    doubled: Vec<Variable>,
    pair: Vec<f64>,
    shift: Vec<f64>,
    trial: Vec<f64>,
    form: Vec<f64>,
    restricted: Vec<f64>,
}

impl Default for Scratch {
    fn default() -> Self {
        let empty = Vec::new;
        Self {
            width: Width::detect(),
            newton: Workspace::default(),
            doubled: Vec::new(),
            pair: empty(),
            shift: empty(),
            trial: empty(),
            form: empty(),
            restricted: empty(),
        }
    }
}

/// The best point of all looks.
pub(super) struct Best {
    pub reached: Reached,
    pub look: Look,
    pub certified: bool,
    pub iterations: usize,
    quick: bool,
}

/// Finds the global minimum of Θ on `variables` from the canonical start in `g`, and leaves it there.
pub(super) fn search<const N: usize, const M: usize>(
    problem: &Problem,
    variables: &[Variable],
    g: &mut [f64],
    limits: Limits,
    s: &mut Scratch,
) -> Best {
    let start = g.to_vec();
    let mut real = RealGains::<N, M>::new(problem, 1);
    let reached = minimise_real(s.width, &mut real, g, variables, limits, None, &mut s.newton);
    let certified = certify(&mut real, g, variables, s);
    let mut best = Best {
        reached,
        look: Look::Canonical,
        certified,
        iterations: reached.iterations,
        quick: reached.iterations <= QUICK,
    };
    if certified {
        return best;
    }
    let scales = (real.gradient_scale(&start), real.value_scale());
    let mut complex = ComplexGains::<N, M>::new(problem, scales);
    look(&mut complex, Look::Complex, problem, &mut real, variables, &start, g, &mut best, limits, s);
    let mut stacked = RealGains::<N, M>::new(problem, 2);
    look(&mut stacked, Look::Stacked, problem, &mut real, variables, &start, g, &mut best, limits, s);
    for i in 0..problem.rows {
        scale_rows(problem.size, &start, &[i, i], 0.0, &mut s.trial);
        finish(Look::Reversed, &mut real, variables, g, &mut best, limits, s);
    }
    for _ in 0..ROUNDS {
        let before = best.reached.value;
        reversals(problem, &mut real, variables, g, &mut best, limits, s);
        if best.reached.value == before {
            break;
        }
    }
    if best.look != Look::Canonical {
        best.certified = certify(&mut real, g, variables, s);
    }
    best
}

/// A problem in twice as many gains.
trait Doubled {
    fn descend(
        &mut self,
        width: Width,
        g: &mut [f64],
        variables: &[Variable],
        limits: Limits,
        w: &mut Workspace,
    ) -> Reached;
}

impl<const N: usize, const M: usize> Doubled for ComplexGains<'_, N, M> {
    fn descend(
        &mut self,
        width: Width,
        g: &mut [f64],
        variables: &[Variable],
        limits: Limits,
        w: &mut Workspace,
    ) -> Reached {
        minimise_complex(width, self, g, variables, limits, w)
    }
}

impl<const N: usize, const M: usize> Doubled for RealGains<'_, N, M> {
    fn descend(
        &mut self,
        width: Width,
        g: &mut [f64],
        variables: &[Variable],
        limits: Limits,
        w: &mut Workspace,
    ) -> Reached {
        minimise_real(width, self, g, variables, limits, None, w)
    }
}

/// Newton from the point in `g` with one row or two rows reversed.
fn reversals<const N: usize, const M: usize>(
    problem: &Problem,
    real: &mut RealGains<N, M>,
    variables: &[Variable],
    g: &mut [f64],
    best: &mut Best,
    limits: Limits,
    s: &mut Scratch,
) {
    let from = g.to_vec();
    let m = problem.rows;
    for i in 0..m {
        let partners = if m <= PAIRS_UP_TO { i..m } else { i..i + 1 };
        for j in partners {
            scale_rows(problem.size, &from, &[i, j], -1.0, &mut s.trial);
            if s.trial != from {
                finish(Look::Reversed, real, variables, g, best, limits, s);
            }
        }
    }
}

/// The gains with the named rows times `factor` (a row named twice once).
fn scale_rows(n: usize, from: &[f64], rows: &[usize; 2], factor: f64, out: &mut Vec<f64>) {
    out.clear();
    out.extend_from_slice(from);
    let distinct = if rows[0] == rows[1] { &rows[..1] } else { &rows[..] };
    for &i in distinct {
        out[i * n..(i + 1) * n].iter_mut().for_each(|x| *x *= factor);
    }
}

/// A fixed pattern of numbers between −size and size, without symmetry: the golden angle spreads it.
fn spread(len: usize, size: f64, phase: f64, out: &mut Vec<f64>) {
    out.clear();
    out.extend((0..len).map(|v| size * (phase + phase * 2.399_963_229_728_653 * v as f64).cos()));
}

/// Descends in a doubled problem from the canonical start and comes back to the real one.
fn look<const N: usize, const M: usize, O: Doubled>(
    doubled: &mut O,
    name: Look,
    problem: &Problem,
    real: &mut RealGains<N, M>,
    variables: &[Variable],
    start: &[f64],
    g: &mut [f64],
    best: &mut Best,
    limits: Limits,
    s: &mut Scratch,
) {
    let (width, scale) = (start.len(), norm(&problem.fne));
    s.doubled.clear();
    s.doubled.extend_from_slice(variables);
    s.doubled.extend(variables.iter().map(|v| Variable { entry: v.entry + width, own: v.own + width, ..*v }));
    let size = FAR * scale / (variables.len() as f64).sqrt();
    spread(variables.len(), size, 1.0, &mut s.shift);
    s.pair.clear();
    s.pair.extend_from_slice(start);
    s.pair.resize(2 * width, 0.0);
    start::advance(&mut s.pair[width..], variables, &s.shift);
    let short =
        Limits { iterations: LOOK_ITERATIONS, tolerance: BASIN, acceptable: BASIN, longest: LONGEST_STEP * scale };
    best.iterations += doubled.descend(s.width, &mut s.pair, &s.doubled, short, &mut s.newton).iterations;
    for sign in [0.0, 1.0, -1.0] {
        let (a, b) = s.pair.split_at(width);
        s.trial.clear();
        s.trial.extend(a.iter().zip(b).map(|(a, b)| a + sign * b));
        finish(name, real, variables, g, best, limits, s);
    }
}

/// Newton from `s.trial`; keeps the point in `g` when it is lower.
fn finish<const N: usize, const M: usize>(
    name: Look,
    real: &mut RealGains<N, M>,
    variables: &[Variable],
    g: &mut [f64],
    best: &mut Best,
    limits: Limits,
    s: &mut Scratch,
) {
    let rival = Rival { g, value: best.reached.value, near: BACK * norm(g) };
    let reached =
        minimise_real(s.width, real, &mut s.trial, variables, limits, best.quick.then_some(rival), &mut s.newton);
    best.iterations += reached.iterations;
    if reached.value < best.reached.value - TIE * best.reached.value.abs() {
        g.copy_from_slice(&s.trial);
        best.reached = reached;
        best.look = name;
    }
}

/// Whether the certificate proves the critical point `g` to be a global minimiser.
pub(super) fn certify<const N: usize, const M: usize>(
    real: &mut RealGains<N, M>,
    g: &[f64],
    variables: &[Variable],
    s: &mut Scratch,
) -> bool {
    let (d, width) = (variables.len(), real.width());
    real.value(g);
    s.form.resize(width * width, 0.0);
    s.restricted.resize(d * d, 0.0);
    real.certificate_form(&mut s.form);
    start::restrict_form(&s.form, width, variables, &mut s.restricted, d);
    let largest = (0..d).fold(0.0, |m: f64, i| m.max(s.restricted[i * d + i].abs()));
    for i in 0..d {
        s.restricted[i * d + i] += CERTIFICATE_ROUNDING * largest;
    }
    largest == 0.0 || super::dense::factorise(&mut s.restricted[..d * d], d)
}

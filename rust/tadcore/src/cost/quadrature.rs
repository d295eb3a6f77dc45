//! What an ordinary step costs: z(s h) is its Taylor series, so the integrand is a polynomial to rounding.

use crate::game::Interaction;
use crate::policy::Policy;
use crate::simulation::apply;

/// Nodes and weights of the 8-point Gauss–Legendre rule on [0, 1], exact to degree 15.
const GAUSS: [(f64, f64); 8] = [
    (0.019_855_071_751_231_856, 0.050_614_268_145_188_13),
    (0.101_666_761_293_186_64, 0.111_190_517_226_687_24),
    (0.237_233_795_041_835_5, 0.156_853_322_938_943_63),
    (0.408_282_678_752_175_1, 0.181_341_891_689_181),
    (0.591_717_321_247_825, 0.181_341_891_689_181),
    (0.762_766_204_958_164_5, 0.156_853_322_938_943_63),
    (0.898_333_238_706_813_4, 0.111_190_517_226_687_24),
    (0.980_144_928_248_768_1, 0.050_614_268_145_188_13),
];
/// Degree of the expansion of z over a piece with ‖C‖h ≤ ½.
const DEGREE: usize = 16;

/// Adds to `total` what a step of length `h` from z costs each player, ‖C‖h ≤ ½; `rows` are the feedback rows of all.
pub(super) fn add_step(
    policy: &Policy,
    running: &[Vec<f64>],
    (c, rows): (&[f64], &[f64]),
    (z, dim, h): (&[f64], usize, f64),
    total: &mut [f64],
) {
    let series = expansion(c, z, z.len() / dim, dim, h);
    for (s, weight) in GAUSS {
        let at = evaluate(&series, s);
        for (j, value) in total.iter_mut().zip(integrands(policy, running, rows, &at, dim)) {
            *j += 0.5 * h * weight * value;
        }
    }
}

/// ‖z‖² weighted row by row.
pub(super) fn weighted(weights: &[f64], z: &[f64], dim: usize) -> f64 {
    weights.iter().zip(z.chunks_exact(dim)).map(|(w, row)| w * row.iter().map(|x| x * x).sum::<f64>()).sum()
}

/// Twice the integrand of each objective at the state `z`; `rows` are the feedback rows of all players.
fn integrands(policy: &Policy, running: &[Vec<f64>], rows: &[f64], z: &[f64], dim: usize) -> Vec<f64> {
    let game = policy.game();
    let (n, w) = (game.n(), game.weights());
    let size = z.len() / dim;
    let mut u = vec![0.0; dim];
    let effort: Vec<f64> = rows
        .chunks_exact(size)
        .map(|row| {
            apply(row, z, dim, &mut u);
            u.iter().map(|x| x * x).sum()
        })
        .collect();
    let team: f64 = w.r_d.iter().zip(&effort).map(|(r, e)| r * e).sum();
    let (target, attacker) = (w.r_tau * effort[n], w.r_a * effort[n + 1]);
    let own = match game.interaction() {
        Interaction::I1 => vec![team, target, attacker],
        Interaction::I2 => vec![attacker - team - target],
    };
    running.iter().zip(own).map(|(q, own)| weighted(q, z, dim) + own).collect()
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, x| m.max(x.abs()))
}

/// Coefficients of z(s h), s in [0, 1]: (C h)^j z / j!.
///
/// They end where all terms are below rounding, and those of each row too: the rows of a game that diverges are many
/// orders of magnitude apart, and one that moves apart from the others has a cost of its own. What is small is judged by
/// (|C|h)^j |z| / j!, in which nothing cancels, so that no later term can be larger again.
fn expansion(c: &[f64], z: &[f64], size: usize, dim: usize, h: f64) -> Vec<Vec<f64>> {
    let mut series = vec![z.to_vec()];
    let mut bound: Vec<f64> = z.chunks_exact(dim).map(largest).collect();
    let (mut so_far, mut next) = (bound.clone(), vec![0.0; size]);
    for j in 1..=DEGREE {
        let mut term = vec![0.0; z.len()];
        for (row, out) in c.chunks_exact(size).zip(term.chunks_exact_mut(dim)) {
            apply(row, &series[j - 1], dim, out);
        }
        term.iter_mut().for_each(|x| *x *= h / j as f64);
        for (row, out) in c.chunks_exact(size).zip(&mut next) {
            *out = row.iter().zip(&bound).map(|(c, b)| c.abs() * b).sum::<f64>() * (h / j as f64);
        }
        std::mem::swap(&mut bound, &mut next);
        let row_by_row = bound.iter().zip(&so_far).all(|(b, most)| *b <= 1e-16 * most);
        let done = row_by_row && largest(&term) <= 1e-18 * largest(z);
        so_far.iter_mut().zip(&bound).for_each(|(most, b)| *most = most.max(*b));
        series.push(term);
        if done {
            break;
        }
    }
    series
}

/// The polynomial at s, by Horner's rule.
fn evaluate(series: &[Vec<f64>], s: f64) -> Vec<f64> {
    let mut value = vec![0.0; series[0].len()];
    for term in series.iter().rev() {
        value.iter_mut().zip(term).for_each(|(v, t)| *v = *v * s + t);
    }
    value
}

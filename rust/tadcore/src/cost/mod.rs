//! What a run cost each player: J of eq:fullobj (I1) and eq:obj:zero_sum (I2), over the time the run took.
//!
//! J = ½‖z(t_end)‖²_F + ½∫(‖z‖²_Q ± ‖u‖²_R)dt with the terminal weight at the time of termination. Between instants
//! z(t_k + s) = exp(Cs)z(t_k) is expanded in its Taylor series, so the integrand is a polynomial to rounding and
//! Gauss–Legendre quadrature of matching order integrates it exactly; a step with ‖C‖δ > ½ is cut into pieces first.
//! Where that would take more than some pieces, ½ z(t_k)ᵀ W z(t_k) takes their place, W the Gramian of the step.
//!
//! Costs carry all axes: they are the paper's own J, not a reduced factor.

mod gramian;

use gramian::WHAT;

use crate::cancel::CancelToken;
use crate::error::RunError;
use crate::game::Interaction;
use crate::memory::{append, zeros};
use crate::policy::{Policy, closed_loop};
use crate::simulation::{Record, apply};

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
/// Pieces of one step at most; a step that needs more is stiff.
const PIECES: f64 = 32.0;

/// J of each player along `record`: J_d, J_τ, J_a in I1, the one J in I2 (minimised by the attacker, maximised by the
/// team).
///
/// # Errors
/// [`RunError::Cost`] where one lies beyond the range of double precision; or when there is no memory, or `cancel` was
/// raised.
pub fn costs(policy: &Policy, record: &Record, cancel: &CancelToken) -> Result<Vec<f64>, RunError> {
    let game = policy.game();
    let (size, dim, m) = (game.size(), record.dim, game.constrained());
    let step = game.grid().step();
    let running = game.state_weights(false);
    let mut total = vec![0.0; running.len()];
    let mut rows = Vec::new();
    let mut c = zeros(WHAT, size * size)?;
    for k in 0..record.steps {
        cancel.check()?;
        let gains = &record.gains[k * m * size..(k + 1) * m * size];
        let free = policy.free_rows(k);
        closed_loop::matrix(&free, gains, &mut c);
        rows.clear();
        append(WHAT, &mut rows, gains)?;
        append(WHAT, &mut rows, free.target.as_deref().unwrap_or_default())?;
        append(WHAT, &mut rows, &free.attacker)?;
        // A game that ended at a crossing ends within its last step, which a record that stops before does not hold.
        let step = if k == record.end && record.after > 0.0 { record.after } else { step };
        let norm = closed_loop::norm(&c, size) * step;
        let pieces = (2.0 * norm).ceil().max(1.0);
        let mut z = relative(record, k, size, dim);
        if pieces > PIECES {
            let mut forms = forms(policy, &running, &rows, cancel)?;
            gramian::gramians(&c, size, step, &mut forms, cancel)?;
            total.iter_mut().zip(&forms).for_each(|(j, w)| *j += 0.5 * quadratic(w, &z, dim));
            continue;
        }
        let h = step / pieces;
        for _ in 0..pieces as usize {
            cancel.check()?;
            let series = expansion(&c, &z, size, dim, h);
            for (s, weight) in GAUSS {
                let at = evaluate(&series, s);
                for (j, value) in total.iter_mut().zip(integrands(policy, &running, &rows, &at, dim)) {
                    *j += 0.5 * h * weight * value;
                }
            }
            z = evaluate(&series, 1.0);
        }
    }
    let z = relative(record, record.steps, size, dim);
    for (j, f) in total.iter_mut().zip(game.state_weights(true)) {
        *j += 0.5 * weighted(&f, &z, dim);
    }
    let finite = total.iter().all(|j| j.is_finite());
    if finite { Ok(total) } else { Err(RunError::Cost { time: record.time(game.grid()) }) }
}

/// z of row k of a record.
fn relative(record: &Record, k: usize, size: usize, dim: usize) -> Vec<f64> {
    let row = &record.positions[k * (size + 1) * dim..(k + 1) * (size + 1) * dim];
    let mut z = Vec::new();
    crate::simulation::relative_state(row, dim, &mut z);
    z
}

/// ‖z‖² weighted row by row.
fn weighted(weights: &[f64], z: &[f64], dim: usize) -> f64 {
    weights.iter().zip(z.chunks_exact(dim)).map(|(w, row)| w * row.iter().map(|x| x * x).sum::<f64>()).sum()
}

/// Twice the integrand of each objective at the state `z`; `rows` are the feedback rows of all players.
fn integrands(policy: &Policy, running: &[Vec<f64>], rows: &[f64], z: &[f64], dim: usize) -> Vec<f64> {
    let game = policy.game();
    let (n, size, w) = (game.n(), game.size(), game.weights());
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

/// The same as quadratic forms: of each objective the M with zᵀ M z twice the integrand at z.
fn forms(policy: &Policy, running: &[Vec<f64>], rows: &[f64], cancel: &CancelToken) -> Result<Vec<Vec<f64>>, RunError> {
    let game = policy.game();
    let (n, size, w) = (game.n(), game.size(), game.weights());
    let team = |sign: f64| w.r_d.iter().map(move |r| sign * r).enumerate();
    let own: Vec<Vec<(usize, f64)>> = match game.interaction() {
        Interaction::I1 => vec![team(1.0).collect(), vec![(n, w.r_tau)], vec![(n + 1, w.r_a)]],
        Interaction::I2 => vec![team(-1.0).chain([(n, -w.r_tau), (n + 1, w.r_a)]).collect()],
    };
    let form = |(efforts, q): (&Vec<(usize, f64)>, &Vec<f64>)| {
        let mut m = zeros(WHAT, size * size)?;
        for (player, r) in efforts {
            cancel.check()?;
            let row = &rows[player * size..(player + 1) * size];
            m.iter_mut().enumerate().for_each(|(ij, x)| *x += r * row[ij / size] * row[ij % size]);
        }
        q.iter().enumerate().for_each(|(i, q)| m[i * size + i] += q);
        Ok(m)
    };
    own.iter().zip(running).map(form).collect()
}

/// zᵀ W z, summed over the axes.
fn quadratic(w: &[f64], z: &[f64], dim: usize) -> f64 {
    let mut product = vec![0.0; dim];
    let rows = w.chunks_exact(z.len() / dim).zip(z.chunks_exact(dim));
    rows.map(|(row, own)| {
        apply(row, z, dim, &mut product);
        own.iter().zip(&product).map(|(x, y)| x * y).sum::<f64>()
    })
    .sum()
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

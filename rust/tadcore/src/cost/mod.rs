//! What a run cost each player: J of eq:fullobj (I1) and eq:obj:zero_sum (I2), over the time the run took.
//!
//! J = ½‖z(t_end)‖²_F + ½∫(‖z‖²_Q ± ‖u‖²_R)dt with the terminal weight at the time of termination. Between instants
//! z(t_k + s) = exp(Cs)z(t_k). Where ‖C‖δ ≤ ½ it is expanded in its Taylor series, so the integrand is a polynomial to
//! rounding and Gauss–Legendre quadrature of matching order integrates it exactly. Elsewhere large parts may cancel in
//! a cost, so it is computed from S = ∫zzᵀdt in double-double arithmetic and rounded once, in the end.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | Q, F | [`Game::state_weights`] | running and terminal weights of each player on the rows of z |
//! | R | `add_stiff_step`, `quadrature` | r_d, r_τ and r_a of [`Weights`](crate::game::Weights) |
//! | C | `policy::closed_loop` | ż = Cz with the feedback of the instant before |
//! | S = ∫zzᵀdt | `moments` | what a stiff step costs is tr(MS) |
//!
//! Costs carry all axes: they are the paper's own J, not a reduced factor. Over a step whose gains turn z and Jz are
//! integrated together, J a quarter turn (see `policy::closed_loop`).

mod double_double;
mod moments;
mod quadrature;

use double_double::{DoubleDouble, Numbers};
use moments::{Moments, effort};
use quadrature::weighted;

use std::borrow::Cow;

use crate::cancel::CancelToken;
use crate::error::{RunError, Stopped};
use crate::game::{Game, Interaction};
use crate::memory::{append, zeros};
use crate::policy::{GainKind, Policy, closed_loop};
use crate::simulation::{Record, acted_on};

/// What asks for memory here.
const WHAT: &str = "the costs of one run";
/// ‖C‖δ of an ordinary step at most. In larger ones roundings may grow beyond those of a sum: by random games to 1e-12
/// of a cost from 16 on, to 1e-8 from 1,000 on.
const ORDINARY: f64 = 0.5;

/// J of each player along `record`: J_d, J_τ, J_a in I1, the one J in I2 (minimised by the attacker, maximised by the
/// team).
///
/// # Errors
/// [`RunError::Cost`] where one lies beyond the range of double precision; or when there is no memory, or `cancel` was
/// raised.
pub fn costs(policy: &Policy, record: &Record, cancel: &CancelToken) -> Result<Vec<f64>, RunError> {
    let game = policy.game();
    let (size, dim, m) = (game.size(), record.dim, game.constrained());
    let grid = game.grid();
    let running = game.state_weights(false);
    let mut total = vec![0.0; running.len()];
    let mut stiff: Option<Vec<DoubleDouble>> = None;
    let mut rows = Vec::new();
    let mut c = zeros(WHAT, size * size * if record.kind == GainKind::Scalar { 1 } else { 4 })?;
    for k in 0..record.steps {
        cancel.check()?;
        let of_step = k * m * size..(k + 1) * m * size;
        let (mut gains, mut free) = (Cow::from(&record.gains[of_step.clone()]), policy.free_rows(k));
        // The recorded imaginary parts are on Jz, also those of a mirror image.
        let turn = record.turn.get(of_step).filter(|turn| turn.iter().any(|x| *x != 0.0));
        if let Some(turn) = turn {
            gains = closed_loop::beside_turned(&gains, turn, size).into();
            free = free.beside_turned();
        }
        let kind = if turn.is_some() { GainKind::Turning } else { GainKind::Scalar };
        let width = free.attacker.len();
        let c = &mut c[..width * width];
        closed_loop::matrix(&free, &gains, c);
        rows.clear();
        append(WHAT, &mut rows, &gains)?;
        append(WHAT, &mut rows, free.target.as_deref().unwrap_or_default())?;
        append(WHAT, &mut rows, &free.attacker)?;
        // A game that ended at a crossing ends within its last step, which a record that stops before does not hold.
        let cut = (k == record.end && record.after > 0.0).then_some(record.after);
        let step = cut.unwrap_or(grid.step());
        if closed_loop::norm(c, width) * step <= ORDINARY {
            let z = relative(record, k, size, dim);
            quadrature::add_step(policy, &running, (c, &rows), (&acted_on(&z, kind), dim, step), &mut total);
            continue;
        }
        let step = cut.map_or(DoubleDouble::quotient(grid.horizon(), grid.steps() as f64), DoubleDouble::exact);
        let total = stiff.get_or_insert_with(|| vec![DoubleDouble::ZERO; running.len()]);
        let mut z = exact_state(record, k, size, dim)?;
        if turn.is_some() {
            z = beside_turned(&z, size)?;
        }
        let s = Moments::new(&rows, size, dim, cancel)?.over_step(&mut z, step)?;
        add_stiff_step(game, &running, &rows, &s, total, cancel)?;
    }
    let terminal = game.state_weights(true);
    match stiff {
        None => {
            let z = relative(record, record.steps, size, dim);
            total.iter_mut().zip(terminal).for_each(|(j, f)| *j += 0.5 * weighted(&f, &z, dim));
        }
        Some(stiff) => add_stiff_end(&exact_state(record, record.steps, size, dim)?, &terminal, stiff, &mut total),
    }
    let finite = total.iter().all(|j| j.is_finite());
    if finite { Ok(total) } else { Err(RunError::Cost { time: record.time(grid) }) }
}

fn half(x: f64) -> DoubleDouble {
    DoubleDouble::exact(0.5 * x)
}

/// Row k of the positions in a record.
fn positions(record: &Record, k: usize, size: usize, dim: usize) -> &[f64] {
    &record.positions[k * (size + 1) * dim..(k + 1) * (size + 1) * dim]
}

/// z of row k of a record.
fn relative(record: &Record, k: usize, size: usize, dim: usize) -> Vec<f64> {
    let mut z = Vec::new();
    crate::simulation::relative_state(positions(record, k, size, dim), dim, &mut z);
    z
}

/// The same without a rounding, axis by axis.
fn exact_state(record: &Record, k: usize, size: usize, dim: usize) -> Result<Numbers, Stopped> {
    let (players, attacker) = positions(record, k, size, dim).split_at(size * dim);
    let mut z = Numbers::zeros(size * dim)?;
    for (e, &x) in players.iter().enumerate() {
        z.set(e % dim * size + e / dim, DoubleDouble::difference(x, attacker[e % dim]));
    }
    Ok(z)
}

/// z and Jz in the plane, axis by axis.
fn beside_turned(z: &Numbers, size: usize) -> Result<Numbers, Stopped> {
    let mut both = Numbers::zeros(4 * size)?;
    for i in 0..size {
        let (x, y) = (z.at(i), z.at(size + i));
        both.set(i, x);
        both.set(size + i, y.times(DoubleDouble::exact(-1.0)));
        both.set(2 * size + i, y);
        both.set(3 * size + i, x);
    }
    Ok(both)
}

/// Adds to `total` what the stiff steps cost each player, and what the weights `terminal` make of the state at the end.
fn add_stiff_end(z: &Numbers, terminal: &[Vec<f64>], stiff: Vec<DoubleDouble>, total: &mut [f64]) {
    for ((mut j, weights), total) in stiff.into_iter().zip(terminal).zip(total) {
        let (size, axes) = (weights.len(), z.nearest().len() / weights.len());
        for (i, f) in weights.iter().enumerate() {
            j = (0..axes).map(|x| z.at(x * size + i)).fold(j, |j, x| j.plus_product(x.times(x), half(*f)));
        }
        *total = j.plus(DoubleDouble::exact(*total)).hi;
    }
}

/// Adds to `total` what a step with the moments S costs each player.
fn add_stiff_step(
    game: &Game,
    running: &[Vec<f64>],
    rows: &[f64],
    s: &Numbers,
    total: &mut [DoubleDouble],
    cancel: &CancelToken,
) -> Result<(), Stopped> {
    let (n, w) = (game.n(), game.weights());
    let size = rows.len() / (n + 2);
    let mut efforts = Vec::with_capacity(n + 2);
    for row in rows.chunks_exact(size) {
        cancel.check()?;
        efforts.push(effort(s, row)?);
    }
    let team = |sign: f64| w.r_d.iter().map(move |r| sign * r).enumerate();
    let own: Vec<Vec<(usize, f64)>> = match game.interaction() {
        Interaction::I1 => vec![team(1.0).collect(), vec![(n, w.r_tau)], vec![(n + 1, w.r_a)]],
        Interaction::I2 => vec![team(-1.0).chain([(n, -w.r_tau), (n + 1, w.r_a)]).collect()],
    };
    for ((j, own), q) in total.iter_mut().zip(own).zip(running) {
        *j = own.iter().fold(*j, |j, &(player, r)| j.plus_product(efforts[player], half(r)));
        *j = q.iter().enumerate().fold(*j, |j, (i, q)| j.plus_product(s.at(i * size + i), half(*q)));
    }
    Ok(())
}

//! The paper's runs through the core alone, and what must hold of every run: work counts, batches, threads, budgets.

use tadcore::cancel::CancelToken;
use tadcore::cost;
use tadcore::ensemble::{self, Batch, End};
use tadcore::error::{Cancelled, RunError};
use tadcore::game::bank::{self, Setup as Start};
use tadcore::game::{Game, Interaction};
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::simulation::{Outcome, Record, Setup, simulate};

fn policy(game: Game, bytes: usize) -> Policy {
    Policy::new(game, bytes, &CancelToken::new()).expect("an equilibrium")
}

fn paper(interaction: Interaction, lambda: f64) -> Policy {
    policy(bank::paper_game(interaction, lambda).expect("valid"), DEFAULT_TABLE_BYTES)
}

fn run(policy: &Policy, start: &Start) -> Record {
    let positions = start.positions.concat();
    let setup = Setup { dim: 2, positions: &positions, visibility: &start.visibility, capture: &start.capture };
    simulate(policy, &setup, &CancelToken::new()).expect("a run")
}

/// Grid indices at which the network differs from the one before.
fn changes(record: &Record) -> Vec<usize> {
    (1..record.steps).filter(|&k| record.networks[k] != record.networks[k - 1]).collect()
}

/// Section VI.1 of the paper, to the digit (δ = 0.005).
#[test]
fn the_first_interaction_comes_out_to_the_digit() {
    let limited = bank::paper_i1_limited();
    let full = Start { visibility: vec![f64::INFINITY; 3], ..limited.clone() };
    let (evading, suicidal) = (paper(Interaction::I1, 1.0), paper(Interaction::I1, 0.0));
    let captured = run(&evading, &full);
    assert_eq!((captured.outcome, captured.steps), (Outcome::Captured, 532));
    let intercepted = run(&evading, &limited);
    assert_eq!((intercepted.outcome, intercepted.steps), (Outcome::Intercepted(0), 279));
    assert_eq!(changes(&intercepted), [32, 98, 115, 183, 192]);
    let second = run(&suicidal, &full);
    assert_eq!((second.outcome, second.steps), (Outcome::Intercepted(1), 475));
    let first = run(&suicidal, &limited);
    assert_eq!((first.outcome, first.steps), (Outcome::Intercepted(0), 334));
    assert_eq!(changes(&first), [34, 46, 97, 112, 174]);
    assert!(first.controls.iter().chain(&first.positions).all(|x| x.is_finite()));
}

/// Section VI.2 with the printed parameters: what an independent implementation computed.
#[test]
fn the_second_interaction_comes_out_as_recomputed() {
    let limited = bank::paper_i2_limited();
    let policy = paper(Interaction::I2, 1.0);
    let with = |visibility: [f64; 4]| run(&policy, &Start { visibility: visibility.to_vec(), ..limited.clone() });
    let full = with([f64::INFINITY; 4]);
    assert_eq!((full.outcome, full.steps), (Outcome::Intercepted(0), 655));
    let far = with([5.0, 3.0, 0.3, 10.0]);
    assert_eq!((far.outcome, far.steps), (Outcome::Captured, 785));
    let near = with([5.0, 3.0, 0.3, 2.5]);
    assert_eq!((near.outcome, near.steps), (Outcome::Intercepted(0), 708));
    assert_eq!(changes(&near), [100, 201, 211, 262]);
    let wide = with([5.0, 3.0, 0.6, 2.5]);
    assert_eq!((wide.outcome, wide.steps), (Outcome::Intercepted(0), 699));
    assert_eq!((0..wide.steps).find(|&k| (0..4).any(|j| wide.networks[k].sees(2, j))), Some(281));
}

/// Work counts guard speed on any machine.
#[test]
fn a_run_solves_each_step_once_and_a_second_run_solves_nothing() {
    let policy = paper(Interaction::I1, 1.0);
    let first = run(&policy, &bank::paper_i1_limited());
    let stats = policy.table();
    assert_eq!((stats.entries, stats.misses, stats.hits), (280, 280, 0));
    assert_eq!(first.unconverged, 0);
    assert!(first.iterations <= 1_300, "{} iterations", first.iterations);
    let second = run(&policy, &bank::paper_i1_limited());
    assert_eq!(policy.table().misses, 280);
    assert_eq!(first, second);
    assert_eq!(
        cost::costs(&policy, &first, &CancelToken::new()).expect("not cancelled"),
        cost::costs(&policy, &second, &CancelToken::new()).expect("not cancelled")
    );
}

/// With everyone in sight the zero-sum value is ½ z(0)ᵀP(0)z(0), and J of I1 is ½ z(0)ᵀP_p(0)z(0), when the game runs
/// its full length.
#[test]
fn costs_are_the_value_functions_when_everyone_sees_everyone() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let game = bank::unit_game(interaction, vec![1.0, 0.7], 1.2, 0.8, 1.0, 1.0, 0.0005).expect("valid");
        let policy = policy(game, DEFAULT_TABLE_BYTES);
        let m = policy.game().constrained();
        let start = Start {
            positions: vec![vec![0.0, 0.0], vec![1.0, 1.5], vec![4.0, 1.0], vec![-4.0, 2.0]],
            visibility: vec![f64::INFINITY; m],
            capture: vec![1e-6; 3],
        };
        let record = run(&policy, &start);
        assert_eq!(record.outcome, Outcome::Timeout);
        let mut z = Vec::new();
        tadcore::simulation::relative_state(&start.positions.concat(), 2, &mut z);
        for (j, p) in cost::costs(&policy, &record, &CancelToken::new())
            .expect("costs")
            .into_iter()
            .zip(policy.equilibrium().node(0).chunks_exact(9))
        {
            let value: f64 =
                (0..9).map(|e| p[e] * (0..2).map(|x| z[e / 3 * 2 + x] * z[e % 3 * 2 + x]).sum::<f64>()).sum();
            // The sampled feedback is held over a step, so J differs from the value by O(δ).
            assert!((j - 0.5 * value).abs() < 2e-3 * value.abs().max(1.0), "{interaction:?}: {j} {}", 0.5 * value);
        }
    }
}

fn lattice(trials: usize) -> Vec<f64> {
    let mut state = 0.37_f64;
    (0..trials * 10)
        .map(|_| {
            state = (state * 97.31 + 0.271).fract();
            6.0 * state - 3.0
        })
        .collect()
}

#[test]
fn batches_are_runs_whatever_the_threads_and_the_budget() {
    let game = bank::unit_game(Interaction::I1, vec![1.0; 3], 1.2, 0.8, 1.0, 6.0, 0.02).expect("valid");
    let start = bank::paper_i1_limited();
    let positions = lattice(40);
    let batch = Batch { dim: 2, positions: &positions, visibility: &start.visibility, capture: &start.capture };
    let large = policy(game.clone(), DEFAULT_TABLE_BYTES);
    let small = policy(game, 100_000);
    let cancel = CancelToken::new();
    let one = ensemble::run(&large, &batch, Some(1), &cancel).expect("a batch");
    let two = ensemble::run(&large, &batch, Some(2), &cancel).expect("a batch");
    let bounded = ensemble::run(&small, &batch, Some(2), &cancel).expect("a batch");
    assert_eq!(one, two);
    assert_eq!(one, bounded);
    let stats = small.table();
    assert!(stats.bytes <= 100_000 && stats.entries > 0, "{stats:?}");
    for (i, end) in one.iter().enumerate() {
        let setup = Setup {
            dim: 2,
            positions: &positions[i * 10..(i + 1) * 10],
            visibility: &start.visibility,
            capture: &start.capture,
        };
        let record = simulate(&large, &setup, &cancel).expect("a run");
        assert_eq!(End::from(&record), *end, "trial {i}");
    }
    let kinds: std::collections::HashSet<i8> = one.iter().map(|end| end.outcome.code()).collect();
    assert!(kinds.len() >= 2, "the sample should end in more than one way");
}

#[test]
fn a_bad_row_is_refused_before_anything_runs_and_a_raised_token_stops() {
    let policy = paper(Interaction::I1, 1.0);
    let start = bank::paper_i1_limited();
    let batch = |row: [f64; 30]| {
        let batch = Batch { dim: 2, positions: &row, visibility: &start.visibility, capture: &start.capture };
        let token = CancelToken::new();
        token.cancel();
        (ensemble::run(&policy, &batch, Some(1), &CancelToken::new()), ensemble::run(&policy, &batch, Some(1), &token))
    };
    let mut row = [0.0; 30];
    row.copy_from_slice(&lattice(3));
    row[25] = f64::NAN;
    let (refused, _) = batch(row);
    assert!(matches!(refused, Err(RunError::Game(_))), "{refused:?}");
    assert_eq!(policy.table().misses, 0);
    row[25] = 0.0;
    let (done, cancelled) = batch(row);
    assert_eq!(done.map(|ends| ends.len()), Ok(3));
    assert_eq!(cancelled, Err(RunError::Cancelled(Cancelled)));
}

/// A game that is over before it begins has one row, with the network of its start.
#[test]
fn a_game_over_at_once_is_recorded_with_its_network() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let mut start = bank::paper_i1_limited();
        start.positions[3] = vec![-2.0, 1.95];
        if interaction == Interaction::I2 {
            start.visibility.push(10.0);
        }
        let record = run(&paper(interaction, 1.0), &start);
        assert_eq!((record.outcome, record.steps, record.networks.len()), (Outcome::Captured, 0, 1));
        // d₁ sees as far as 5: everyone; d₃ as far as 1.25: d₁ at a distance of 1.
        let network = &record.networks[0];
        assert!((0..4).all(|j| network.sees(0, j) && network.sees(2, j) == (j == 0)));
        assert_eq!((record.unconverged, record.positions), (0, start.positions.concat()));
    }
}

/// Every player moves by its recorded velocity times δ, but for what the velocity changes within a step: positions and
/// controls are recorded by different ways.
#[test]
fn players_move_by_their_velocities() {
    for (interaction, start) in
        [(Interaction::I1, bank::paper_i1_limited()), (Interaction::I2, bank::paper_i2_limited())]
    {
        let policy = paper(interaction, 1.0);
        let (record, step) = (run(&policy, &start), policy.game().grid().step());
        let row = 5 * 2;
        for k in 0..record.steps {
            for p in 0..5 {
                let at = |k: usize, x: usize| k * row + p * 2 + x;
                let difference = |x: usize| {
                    record.positions[at(k + 1, x)] - record.positions[at(k, x)] - step * record.controls[at(k, x)]
                };
                let speed = record.controls[at(k, 0)].hypot(record.controls[at(k, 1)]);
                let off = difference(0).hypot(difference(1));
                assert!(off < 0.05 * step * (speed + 0.2), "player {p} at {k}: {off} of {}", step * speed);
            }
        }
    }
}

/// J along a run from its recorded states alone, by the corrected trapezoid rule: with the slopes ℓ' of the integrand at
/// both ends of a step, ∫ℓ = δ/2 (ℓ₀ + ℓ₁) + δ²/12 (ℓ₀' − ℓ₁') + O(δ⁵). A coarse step is cut into many `parts`, which the
/// classical Runge–Kutta method follows. No exponential is in it; the free players' feedback is written out from P.
fn costs_by_trapezoids(policy: &Policy, record: &Record, parts: usize) -> Vec<f64> {
    type Plane = [f64; 2];
    let (game, equilibrium) = (policy.game(), policy.equilibrium());
    let (w, size, step) = (game.weights(), game.size(), game.grid().step() / parts as f64);
    let relative = |k: usize| -> Vec<Plane> {
        let row = &record.positions[k * 2 * (size + 1)..(k + 1) * 2 * (size + 1)];
        let attacker = [row[2 * size], row[2 * size + 1]];
        (0..size).map(|i| [row[2 * i] - attacker[0], row[2 * i + 1] - attacker[1]]).collect()
    };
    let times =
        |row: &[f64], z: &[Plane]| -> Plane { [0, 1].map(|x| row.iter().zip(z).map(|(g, v)| g * v[x]).sum::<f64>()) };
    let dot = |u: Plane, v: Plane| u[0] * v[0] + u[1] * v[1];
    let running = game.state_weights(false);
    let mut total = vec![0.0; running.len()];
    for k in 0..record.steps {
        let mut rows: Vec<Vec<f64>> = record.gains[k * game.constrained() * size..(k + 1) * game.constrained() * size]
            .chunks_exact(size)
            .map(<[f64]>::to_vec)
            .collect();
        let first = game.interaction() == Interaction::I1;
        if first {
            rows.push(equilibrium.p(1, k)[(size - 1) * size..].iter().map(|x| -x / w.r_tau).collect());
        }
        let own = equilibrium.p(if first { 2 } else { 0 }, k);
        rows.push((0..size).map(|j| (0..size).map(|i| own[i * size + j]).sum::<f64>() / w.r_a).collect());
        // Of every objective the integrand and its slope along ż_i = u_i − u_a, at a state under the rows of this step.
        let integrands = |z: &[Plane]| -> Vec<[f64; 2]> {
            let u: Vec<Plane> = rows.iter().map(|row| times(row, z)).collect();
            let moved: Vec<Plane> = (0..size).map(|i| [u[i][0] - u[size][0], u[i][1] - u[size][1]]).collect();
            let turned: Vec<Plane> = rows.iter().map(|row| times(row, &moved)).collect();
            let effort: Vec<[f64; 2]> = (0..=size).map(|i| [dot(u[i], u[i]), 2.0 * dot(u[i], turned[i])]).collect();
            let of = |e: usize| {
                let team: f64 = w.r_d.iter().zip(&effort).map(|(r, effort)| r * effort[e]).sum();
                let (target, attacker) = (w.r_tau * effort[size - 1][e], w.r_a * effort[size][e]);
                if first { vec![team, target, attacker] } else { vec![attacker - team - target] }
            };
            let state = |q: &[f64]| -> [f64; 2] {
                let sum = |of: &dyn Fn(usize) -> f64| (0..size).map(|i| q[i] * of(i)).sum::<f64>();
                [sum(&|i| dot(z[i], z[i])), sum(&|i| 2.0 * dot(z[i], moved[i]))]
            };
            let (values, slopes) = (of(0), of(1));
            (0..running.len())
                .map(|j| (state(&running[j]), j))
                .map(|(s, j)| [s[0] + values[j], s[1] + slopes[j]])
                .collect()
        };
        let slope = |z: &[Plane]| -> Vec<Plane> {
            let own = times(&rows[size], z);
            rows[..size].iter().map(|row| times(row, z)).map(|u| [u[0] - own[0], u[1] - own[1]]).collect()
        };
        let ahead = |z: &[Plane], by: f64, slope: &[Plane]| -> Vec<Plane> {
            z.iter().zip(slope).map(|(z, s)| [z[0] + by * s[0], z[1] + by * s[1]]).collect()
        };
        let mut z = relative(k);
        for part in 1..=parts {
            let from = integrands(&z);
            z = if part == parts {
                relative(k + 1)
            } else {
                let a = slope(&z);
                let b = slope(&ahead(&z, 0.5 * step, &a));
                let c = slope(&ahead(&z, 0.5 * step, &b));
                let d = slope(&ahead(&z, step, &c));
                let sum = ahead(&ahead(&ahead(&a, 2.0, &b), 2.0, &c), 1.0, &d);
                ahead(&z, step / 6.0, &sum)
            };
            for (total, (from, to)) in total.iter_mut().zip(from.into_iter().zip(integrands(&z))) {
                *total += 0.5 * (step / 2.0 * (from[0] + to[0]) + step * step / 12.0 * (from[1] - to[1]));
            }
        }
    }
    let z = relative(record.steps);
    for (total, f) in total.iter_mut().zip(game.state_weights(true)) {
        *total += 0.5 * (0..size).map(|i| f[i] * dot(z[i], z[i])).sum::<f64>();
    }
    total
}

#[test]
fn costs_are_the_integrals_over_the_recorded_states() {
    for (interaction, start) in
        [(Interaction::I1, bank::paper_i1_limited()), (Interaction::I2, bank::paper_i2_limited())]
    {
        let policy = paper(interaction, 1.0);
        let record = run(&policy, &start);
        let (computed, expected) = (
            cost::costs(&policy, &record, &CancelToken::new()).expect("costs"),
            costs_by_trapezoids(&policy, &record, 1),
        );
        assert_eq!(computed.len(), expected.len());
        for (a, b) in computed.iter().zip(&expected) {
            assert!((a - b).abs() < 1e-8 * b.abs().max(1.0), "{interaction:?}: {a} and {b}");
        }
    }
}

/// Coarse steps, in which ‖C‖δ lies between 0.3 and 11. In the first two games some are ordinary and some are stiff.
#[test]
fn costs_of_coarse_steps_are_the_integrals_over_the_motion() {
    for (interaction, start) in
        [(Interaction::I1, bank::paper_i1_limited()), (Interaction::I2, bank::paper_i2_limited())]
    {
        for (r_d, horizon, step) in [
            (vec![1.0; 3], 1.0, 0.1),
            (vec![1.0; 3], 1.2, 0.12),
            (vec![1.0; 3], 3.0, 0.25),
            (vec![1.0, 0.01, 1.0], 1.2, 0.4),
            (vec![4.0; 3], 0.5, 0.5),
        ] {
            let game = bank::unit_game(interaction, r_d, 1.2, 0.8, 1.0, horizon, step).expect("valid");
            let policy = policy(game, DEFAULT_TABLE_BYTES);
            let record = run(&policy, &start);
            let computed = cost::costs(&policy, &record, &CancelToken::new()).expect("costs");
            let expected = costs_by_trapezoids(&policy, &record, 2000);
            assert_eq!(computed.len(), expected.len());
            for (a, b) in computed.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{interaction:?}, {step}: {a} and {b}");
            }
        }
    }
}

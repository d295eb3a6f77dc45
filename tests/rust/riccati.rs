//! The Riccati layer against closed forms and independent routes.

use std::f64::consts::FRAC_PI_2;

use tadcore::cancel::CancelToken;
use tadcore::error::EquilibriumError;
use tadcore::game::{Game, Grid, Interaction, Weights, bank};
use tadcore::riccati::{Equilibrium, solve};

type Fallible = Result<(), Box<dyn std::error::Error>>;

/// Weights whose every entry a test may change; λ = 1 and ones by default.
fn weights(interaction: Interaction, n: usize) -> Weights {
    let own = if interaction == Interaction::I1 { vec![1.0; n] } else { Vec::new() };
    let terms = interaction.terms();
    Weights {
        r_d: vec![1.0; n],
        r_tau: 1.2,
        r_a: 0.8,
        q_da: own.clone(),
        f_da: own,
        q_ad: vec![1.0; n],
        f_ad: vec![1.0; n],
        q_atau: 1.0,
        f_atau: 1.0,
        q_taua: 1.0,
        f_taua: 1.0,
        lambda: 1.0,
        gamma: vec![1.0 / terms as f64; terms],
    }
}

fn game(interaction: Interaction, w: Weights, horizon: f64, steps: usize) -> Result<Game, Box<dyn std::error::Error>> {
    Ok(Game::new(interaction, w, Grid::new(horizon, horizon / steps as f64)?)?)
}

fn run(game: &Game) -> Result<Equilibrium, EquilibriumError> {
    solve(game, &CancelToken::new())
}

fn escape(game: &Game) -> Option<f64> {
    match run(game) {
        Err(EquilibriumError::FiniteEscape { escape_time, .. }) => Some(escape_time),
        _ => None,
    }
}

fn norm(a: &[f64]) -> f64 {
    a.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// ‖a − b‖ / ‖b‖.
fn error(a: &[f64], b: &[f64]) -> f64 {
    norm(&a.iter().zip(b).map(|(x, y)| x - y).collect::<Vec<_>>()) / norm(b)
}

fn multiply(n: usize, a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for i in 0..n {
        for k in 0..n {
            for j in 0..n {
                out[i * n + j] += a[i * n + k] * b[k * n + j];
            }
        }
    }
    out
}

/// The paper's own 2N × 2N equations, terms in the order of eq:Riccati and eq:RDE, by the classical Runge–Kutta method.
struct Paper {
    m: usize,
    s: Vec<Vec<f64>>,
    q: Vec<Vec<f64>>,
    f: Vec<Vec<f64>>,
}

impl Paper {
    fn new(game: &Game) -> Self {
        let (n, w) = (game.size(), game.weights());
        let m = 2 * n;
        let kron = |d: &[f64]| {
            let mut out = vec![0.0; m * m];
            for i in 0..m {
                out[i * m + i] = d[i / 2];
            }
            out
        };
        let mut inverse: Vec<f64> = w.r_d.iter().map(|r| 1.0 / r).collect();
        inverse.push(0.0);
        let mut last = vec![0.0; n];
        last[n - 1] = 1.0 / w.r_tau;
        let s_a: Vec<f64> = (0..m * m).map(|ij| if (ij / m) % 2 == (ij % m) % 2 { 1.0 / w.r_a } else { 0.0 }).collect();
        Self {
            m,
            s: vec![kron(&inverse), kron(&last), s_a],
            q: game.state_weights(false).iter().map(|q| kron(q)).collect(),
            f: game.state_weights(true).iter().map(|f| kron(f)).collect(),
        }
    }

    /// dP/ds = −Ṗ.
    fn derivative(&self, p: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let m = self.m;
        let triple = |a: &[f64], s: &[f64], b: &[f64]| multiply(m, &multiply(m, a, s), b);
        let mut out = self.q.clone();
        if let [p] = p {
            let s: Vec<f64> = (0..m * m).map(|i| self.s[2][i] - self.s[0][i] - self.s[1][i]).collect();
            for (o, v) in out[0].iter_mut().zip(triple(p, &s, p)) {
                *o -= v;
            }
            return out;
        }
        for g in 0..3 {
            for o in 0..3 {
                for (x, v) in out[g].iter_mut().zip(triple(&p[g], &self.s[o], &p[o])) {
                    *x -= v;
                }
                if o != g {
                    for (x, v) in out[g].iter_mut().zip(triple(&p[o], &self.s[o], &p[g])) {
                        *x -= v;
                    }
                }
            }
        }
        out
    }

    /// P after `horizon`, in `steps` steps of order 4.
    fn integrate(&self, horizon: f64, steps: usize) -> Vec<Vec<f64>> {
        let h = horizon / steps as f64;
        let mut p = self.f.clone();
        let shift = |p: &[Vec<f64>], k: &[Vec<f64>], h: f64| -> Vec<Vec<f64>> {
            p.iter().zip(k).map(|(p, k)| p.iter().zip(k).map(|(p, k)| p + h * k).collect()).collect()
        };
        for _ in 0..steps {
            let k1 = self.derivative(&p);
            let k2 = self.derivative(&shift(&p, &k1, 0.5 * h));
            let k3 = self.derivative(&shift(&p, &k2, 0.5 * h));
            let k4 = self.derivative(&shift(&p, &k3, h));
            for g in 0..p.len() {
                for i in 0..p[g].len() {
                    p[g][i] += h / 6.0 * (k1[g][i] + 2.0 * (k2[g][i] + k3[g][i]) + k4[g][i]);
                }
            }
        }
        p
    }
}

/// P ⊗ I₂.
fn kron(n: usize, p: &[f64]) -> Vec<f64> {
    let m = 2 * n;
    (0..m * m)
        .map(|ij| {
            let (i, j) = (ij / m, ij % m);
            if i % 2 == j % 2 { p[(i / 2) * n + j / 2] } else { 0.0 }
        })
        .collect()
}

#[test]
fn agrees_with_the_papers_own_equations() -> Fallible {
    for (interaction, n) in
        [(Interaction::I1, 1), (Interaction::I1, 2), (Interaction::I1, 3), (Interaction::I2, 1), (Interaction::I2, 3)]
    {
        let mut w = weights(interaction, n);
        for i in 0..n {
            w.r_d[i] = 0.7 + 0.5 * i as f64;
            w.q_ad[i] = 1.1 - 0.2 * i as f64;
            if interaction == Interaction::I1 {
                w.f_da[i] = 0.6 + 0.3 * i as f64;
            }
        }
        w.lambda = 0.7;
        w.f_taua = 0.9;
        let game = game(interaction, w, 1.0, 7)?;
        let ours = run(&game)?;
        let paper = Paper::new(&game).integrate(1.0, 2000);
        for (g, p) in paper.iter().enumerate() {
            let e = error(&kron(n + 1, ours.p(g, 0)), p);
            assert!(e < 3e-12, "{interaction:?}, n = {n}, group {g}: {e:.1e}");
        }
    }
    Ok(())
}

#[test]
fn a_lone_evader_follows_the_tangent() -> Fallible {
    // With every other player all but unable to move, P_τ' = −1 − P_τ² in I1 and P' = 1 + P² in I2.
    for interaction in [Interaction::I1, Interaction::I2] {
        let mut w = weights(interaction, 1);
        (w.r_d[0], w.r_a, w.r_tau) = (1e30, 1e30, 1.0);
        (w.f_taua, w.f_atau) = (1e-30, 1e-30);
        let time = escape(&game(interaction, w.clone(), 2.0, 10)?).ok_or("no escape")?;
        assert!((time / FRAC_PI_2 - 1.0).abs() < 1e-12, "{interaction:?}: {time}");
        let at = escape(&game(interaction, w.clone(), FRAC_PI_2, 10)?).ok_or("no escape at the horizon itself")?;
        assert!(at <= FRAC_PI_2);
        for gap in [0.1, 1e-3, 1e-6] {
            let horizon = FRAC_PI_2 - gap;
            let solved = run(&game(interaction, w.clone(), horizon, 10)?)?;
            let (p, sign) =
                if interaction == Interaction::I1 { (solved.p(1, 0)[3], -1.0) } else { (solved.p(0, 0)[3], 1.0) };
            let e = (sign * p / horizon.tan() - 1.0).abs();
            assert!(e < 1e-12 / gap + 1e-12, "{interaction:?}, {gap} before the pole: {e:.1e}");
        }
    }
    Ok(())
}

#[test]
fn known_escapes_of_i2() -> Fallible {
    // (r_d, r_τ, r_a, weights of the defenders, weight of the target, escape time), reference/cases.json
    let cases = [
        (vec![1.0], 1.0, 0.8, 1.0, 0.01, 3.2197539590990143),
        (vec![1.0; 3], 1.2, 0.8, 3.0, 0.1, 0.11905084462320856),
        (vec![10.0; 3], 1.2, 0.3, 1.0, 1.0, 0.15925099506602167),
    ];
    for (r_d, r_tau, r_a, d, tau, exact) in cases {
        let n = r_d.len();
        let w = Weights {
            r_d,
            r_tau,
            r_a,
            q_ad: vec![d; n],
            f_ad: vec![d; n],
            q_atau: tau,
            f_atau: tau,
            ..weights(Interaction::I2, n)
        };
        // Whatever the grid, also with the pole deep inside one step.
        for steps in [1, 3, 100, 1200] {
            let time = escape(&game(Interaction::I2, w.clone(), 6.0, steps)?).ok_or("missed")?;
            assert!((time / exact - 1.0).abs() < 1e-12, "{time} instead of {exact}");
        }
        assert!(run(&game(Interaction::I2, w.clone(), exact * (1.0 - 1e-9), 4)?).is_ok());
        assert!(escape(&game(Interaction::I2, w.clone(), exact, 4)?).is_some());
        assert!(escape(&game(Interaction::I2, w, exact * (1.0 + 1e-9), 4)?).is_some());
    }
    Ok(())
}

#[test]
fn known_escapes_of_i1() -> Fallible {
    // Escape times from a Taylor series of order 24 in 80-bit arithmetic, marched to the pole.
    let one = Weights {
        r_d: vec![1.74],
        r_tau: 0.125,
        r_a: 0.52,
        q_da: vec![0.284],
        f_da: vec![15.4],
        q_ad: vec![8.18],
        f_ad: vec![6.95],
        q_atau: 0.115,
        f_atau: 0.519,
        q_taua: 0.722,
        f_taua: 0.376,
        lambda: 0.5,
        gamma: vec![0.25; 4],
    };
    let three = Weights {
        r_d: vec![3.33, 2.05, 0.0701],
        r_tau: 0.488,
        r_a: 2.58,
        q_da: vec![0.563, 0.716, 4.94],
        f_da: vec![0.148, 0.162, 4.39],
        q_ad: vec![10.2, 0.156, 0.0871],
        f_ad: vec![5.76, 1.45, 0.243],
        q_atau: 0.0817,
        f_atau: 1.32,
        q_taua: 0.147,
        f_taua: 9.13,
        lambda: 1.0,
        gamma: vec![0.25; 4],
    };
    // Passes within 1e-8 of poles in the complex plane some times before it escapes.
    let near_misses = Weights {
        r_d: vec![2.98, 0.0849],
        r_tau: 1.96,
        r_a: 7.16,
        q_da: vec![0.0844, 0.191],
        f_da: vec![0.608, 0.543],
        q_ad: vec![14.2, 0.101],
        f_ad: vec![0.168, 2.09],
        q_atau: 0.117,
        f_atau: 1.92,
        q_taua: 2.06,
        f_taua: 1.33,
        lambda: 0.5,
        gamma: vec![0.25; 4],
    };
    let cases = [
        (one, 2.1801305679397247, 1e-11),
        (three, 2.294757258785107, 1e-11),
        (near_misses, 4.636_127_359_805_48, 1e-8),
    ];
    for (w, exact, tolerance) in cases {
        for steps in [1, 10, 1000] {
            let time = escape(&game(Interaction::I1, w.clone(), 5.0, steps)?).ok_or("missed")?;
            assert!((time / exact - 1.0).abs() < tolerance, "{time} instead of {exact}");
        }
        let solved = run(&game(Interaction::I1, w, exact * (1.0 - 1e-3), 100)?)?;
        assert!(solved.as_slice().iter().all(|v| v.is_finite()));
    }
    Ok(())
}

#[test]
fn matrices_are_symmetric_to_the_bit() -> Fallible {
    for interaction in [Interaction::I1, Interaction::I2] {
        for n in [1, 2, 4, 7, 8, 11] {
            let solved = run(&bank::varied_game(interaction, n, 0.05, 0.001)?)?;
            let size = n + 1;
            for k in 0..=solved.steps() {
                for g in 0..solved.groups() {
                    let p = solved.p(g, k);
                    for i in 0..size {
                        for j in 0..size {
                            assert_eq!(p[i * size + j], p[j * size + i], "{interaction:?}, n = {n}, k = {k}");
                        }
                    }
                }
            }
        }
    }
    Ok(())
}

#[test]
fn a_suicidal_attacker_and_the_target_ignore_the_defenders() -> Fallible {
    let solved = run(&bank::paper_game(Interaction::I1, 0.0)?)?;
    for k in 0..=solved.steps() {
        for g in [1, 2] {
            assert!(solved.p(g, k)[..15].iter().all(|&v| v == 0.0), "group {g}, k = {k}");
        }
    }
    // Stationary gains at T = 20, reference/cases.json.
    let long = bank::unit_game(Interaction::I1, vec![1.0; 3], 1.2, 0.8, 0.0, 20.0, 0.005)?;
    let solved = run(&long)?;
    let (k1, k4) = (solved.p(1, 0)[15], solved.p(2, 0)[15]);
    assert!((k1 + 0.37889257).abs() < 1e-8 && (k4 - 1.18200575).abs() < 1e-8);
    assert!((k1 / 1.2 + k4 / 0.8 - 1.16176338).abs() < 1e-8);
    Ok(())
}

#[test]
fn the_grid_does_not_change_the_solution() -> Fallible {
    for (interaction, n) in [(Interaction::I1, 3), (Interaction::I1, 9), (Interaction::I2, 3)] {
        let one = run(&bank::varied_game(interaction, n, 6.0, 6.0)?)?;
        let many = run(&bank::varied_game(interaction, n, 6.0, 6.0 / 20_000.0)?)?;
        let some = run(&bank::varied_game(interaction, n, 6.0, 6.0 / 50.0)?)?;
        for g in 0..one.groups() {
            assert!(error(one.p(g, 0), many.p(g, 0)) < 1e-12);
            for k in 0..=50 {
                let e = error(some.p(g, k), many.p(g, k * 400));
                assert!(e < 1e-11, "{interaction:?}, n = {n}, k = {k}: {e:.1e}");
            }
        }
    }
    Ok(())
}

#[test]
fn residuals_are_small_and_see_another_game() -> Fallible {
    for (interaction, n) in [(Interaction::I1, 3), (Interaction::I1, 10), (Interaction::I2, 1), (Interaction::I2, 3)] {
        for steps in [1, 5, 60, 1200] {
            let game = bank::varied_game(interaction, n, 6.0, 6.0 / steps as f64)?;
            let solved = run(&game)?;
            let residual = solved.residual(&game, &CancelToken::new()).expect("memory");
            assert_eq!(residual.len(), solved.groups() * (steps + 1));
            let worst = residual.iter().copied().fold(0.0, f64::max);
            assert!(worst < 1e-9, "{interaction:?}, n = {n}, {steps} steps: {worst:.1e}");
            let mut w = game.weights().clone();
            w.q_ad[0] *= 1.01;
            let other = Game::new(interaction, w, *game.grid())?;
            assert!(
                solved.residual(&other, &CancelToken::new()).expect("memory").iter().copied().fold(0.0, f64::max)
                    > 1e-5
            );
        }
    }
    Ok(())
}

#[test]
fn long_horizons_become_stationary() -> Fallible {
    for (interaction, n) in [(Interaction::I1, 3), (Interaction::I1, 10), (Interaction::I2, 3)] {
        let solved = run(&bank::varied_game(interaction, n, 400.0, 0.5)?)?;
        for g in 0..solved.groups() {
            let e = error(solved.p(g, 0), solved.p(g, 300));
            assert!(e < 1e-11, "{interaction:?}, n = {n}, group {g}: {e:.1e}");
        }
    }
    Ok(())
}

#[test]
fn weights_over_twelve_orders_are_solved_or_refused() -> Fallible {
    // Cheap control against dear distances and the other way round, over horizons that do not make it hopelessly stiff.
    let scales = [1e-6, 1e-3, 1.0, 1e3, 1e6];
    let mut solved_games = 0;
    for interaction in [Interaction::I1, Interaction::I2] {
        for (i, &r) in scales.iter().enumerate() {
            for (j, &q) in scales.iter().enumerate() {
                let mut w = weights(interaction, 2);
                (w.r_d[0], w.r_d[1], w.r_a) = (r, scales[(i + 2) % 5], scales[(j + 1) % 5]);
                (w.q_ad[0], w.f_ad[1], w.q_atau, w.f_taua) =
                    (q, scales[(i + j) % 5], scales[(i + 3) % 5], scales[4 - j]);
                let game = game(interaction, w, 1e-3, 20)?;
                match run(&game) {
                    Ok(solved) => {
                        solved_games += 1;
                        assert!(solved.as_slice().iter().all(|v| v.is_finite()));
                        let worst = solved
                            .residual(&game, &CancelToken::new())
                            .expect("memory")
                            .iter()
                            .copied()
                            .fold(0.0, f64::max);
                        assert!(worst < 1e-4, "{interaction:?} ({i}, {j}): {worst:.1e}");
                    }
                    Err(EquilibriumError::FiniteEscape { escape_time, horizon }) => {
                        assert!(escape_time > 0.0 && escape_time <= horizon);
                    }
                    Err(EquilibriumError::StepBudget { reached, horizon, .. }) => assert!(reached < horizon),
                    Err(EquilibriumError::Undetermined { change, .. }) => assert!(change > 1e-5),
                    Err(other) => return Err(other.into()),
                }
            }
        }
    }
    assert!(solved_games > 5);
    Ok(())
}

#[test]
fn relabelling_the_defenders_relabels_the_solution() -> Fallible {
    for interaction in [Interaction::I1, Interaction::I2] {
        let mut w = weights(interaction, 3);
        w.r_d = vec![0.8, 1.1, 1.9];
        w.f_ad = vec![0.5, 1.0, 0.7];
        let mut turned = w.clone();
        turned.r_d.rotate_left(1);
        turned.f_ad.rotate_left(1);
        let (a, b) = (run(&game(interaction, w, 2.0, 40)?)?, run(&game(interaction, turned, 2.0, 40)?)?);
        let place = |i: usize| if i < 3 { (i + 1) % 3 } else { i };
        for k in 0..=40 {
            for g in 0..a.groups() {
                let moved: Vec<f64> = (0..16).map(|ij| a.p(g, k)[place(ij / 4) * 4 + place(ij % 4)]).collect();
                assert!(error(b.p(g, k), &moved) < 1e-11);
            }
        }
    }
    Ok(())
}

#[test]
fn feedback_rows_are_the_equilibrium_controls() -> Fallible {
    for interaction in [Interaction::I1, Interaction::I2] {
        let game = bank::varied_game(interaction, 2, 1.0, 0.1)?;
        let (solved, w) = (run(&game)?, game.weights());
        let mut rows = vec![0.0; 12];
        solved.feedback(&game, 4, &mut rows);
        let sign = if interaction == Interaction::I1 { -1.0 } else { 1.0 };
        let last = solved.groups() - 1;
        for j in 0..3 {
            let attacker: f64 = (0..3).map(|i| solved.p(last, 4)[i * 3 + j]).sum();
            assert_eq!(rows[j], sign * solved.p(0, 4)[j] / w.r_d[0]);
            assert_eq!(rows[3 + j], sign * solved.p(0, 4)[3 + j] / w.r_d[1]);
            assert_eq!(rows[6 + j], sign * solved.p(last.min(1), 4)[6 + j] / w.r_tau);
            assert!((rows[9 + j] - attacker / w.r_a).abs() < 1e-14);
        }
    }
    Ok(())
}

#[test]
fn a_raised_token_stops_the_solver() -> Fallible {
    let token = CancelToken::new();
    token.cancel();
    for interaction in [Interaction::I1, Interaction::I2] {
        let result = solve(&bank::paper_game(interaction, 1.0)?, &token);
        assert!(matches!(result, Err(EquilibriumError::Cancelled(_))));
    }
    Ok(())
}

/// Work counts: they guard the speed on any machine.
#[test]
fn steps_do_not_creep_up() -> Fallible {
    for (n, most) in [(3, 140), (10, 270), (30, 430)] {
        let solved = run(&bank::varied_game(Interaction::I1, n, 6.0, 0.005)?)?;
        assert!(solved.integrator_steps() <= most, "n = {n}: {}", solved.integrator_steps());
    }
    assert_eq!(run(&bank::paper_game(Interaction::I2, 1.0)?)?.integrator_steps(), 1200);
    Ok(())
}

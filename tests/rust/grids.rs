//! The time grid of every game: its instants to the last digit, and an answer for every grid that is accepted.

use proptest::prelude::*;
use tadcore::cancel::CancelToken;
use tadcore::ensemble::{self, Batch, End};
use tadcore::error::EquilibriumError;
use tadcore::game::{Game, Grid, Interaction, bank};
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::riccati::solve;
use tadcore::simulation::{Outcome, Setup, simulate};

/// How many grids each property meets; solving the tiny games on them takes some seconds.
const GRIDS: u32 = 10_000;

fn cases(count: u32) -> ProptestConfig {
    ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(count) }
}

/// A positive normal double as m 2^e.
fn parts(x: f64) -> (i128, i32) {
    let bits = x.to_bits();
    ((bits & ((1 << 52) - 1) | 1 << 52) as i128, (bits >> 52) as i32 - 1075)
}

/// T and δ as people write them, in decimal or as whatever a computation left, with a quotient that is whole as nearly
/// as the rule demands.
fn grid(most: usize) -> impl Strategy<Value = (f64, f64, usize)> {
    let decimal = |digits: i32| (1..2_000_u32).prop_map(move |m| f64::from(m) / 10f64.powi(digits));
    let step = prop_oneof![decimal(2), decimal(3), decimal(4), 1e-4..0.3_f64];
    // The rule says "within 1e-9 of the number of steps".
    let off = prop_oneof![3 => Just(0.0), 1 => -0.99e-9..0.99e-9_f64];
    (step, 1..=most, off, any::<bool>()).prop_map(|(step, steps, off, written)| {
        let horizon = step * steps as f64 * (1.0 + off);
        // 49 × 0.01 is 0.49000000000000005; people write 0.49.
        let written = written && off == 0.0;
        let horizon = if written { format!("{horizon:.14e}").parse().unwrap_or(horizon) } else { horizon };
        (horizon.min(6.0), horizon.min(6.0) / horizon * step, steps)
    })
}

proptest! {
    #![proptest_config(cases(GRIDS))]

    /// t_k is the double nearest to k T / K, in exact arithmetic, for horizons of every size.
    #[test]
    fn instants_are_rounded_once(
        significand in 0..1_u64 << 52,
        power in 60..2_000_u64,
        steps in prop_oneof![1..1_000_usize, 1..1_000_000_000_usize],
        share in 0.0..1.0_f64,
    ) {
        let horizon = f64::from_bits(power << 52 | significand);
        let grid = Grid::new(horizon, horizon / steps as f64).expect("a grid");
        prop_assert_eq!(grid.steps(), steps);
        prop_assert_eq!((grid.time(0), grid.time(steps)), (0.0, horizon));
        let k = ((steps as f64 * share) as usize).clamp(1, steps);
        let ((m, e), (found, low)) = (parts(horizon), parts(grid.time(k)));
        // |t K − k T| ≤ K ulp(t) / 2, in units of ulp(t); a tie goes to the even one.
        let off = 2 * ((k as i128 * m) << (e - low)) - 2 * found * steps as i128;
        prop_assert!(off.abs() <= steps as i128, "T = {horizon:e}, K = {steps}, k = {k}: {:e}", grid.time(k));
        prop_assert!(off.abs() < steps as i128 || found % 2 == 0);
    }

    /// Every grid that is accepted has an equilibrium or an escape, in both interactions; nothing else is an answer.
    #[test]
    fn every_grid_is_solved((horizon, step, steps) in grid(60), n in 1..=3_usize, lambda in 0.0..=1.0_f64) {
        for interaction in [Interaction::I1, Interaction::I2] {
            let game = bank::unit_game(interaction, vec![1.0; n], 1.2, 0.8, lambda, horizon, step).expect("a game");
            prop_assert_eq!(game.grid().steps(), steps);
            match solve(&game, &CancelToken::new()) {
                Ok(solved) => prop_assert!(solved.as_slice().iter().all(|p| p.is_finite())),
                Err(EquilibriumError::FiniteEscape { .. }) => {}
                Err(other) => prop_assert!(false, "{interaction:?}, T = {horizon:?}, δ = {step:?}: {other}"),
            }
        }
    }
}

proptest! {
    #![proptest_config(cases(300))]

    /// A game that nobody ends runs out of time at T itself, alone and in a batch; P(T) = F at its last node.
    #[test]
    fn timeouts_are_at_the_horizon((horizon, step, steps) in grid(2_000)) {
        let game = bank::unit_game(Interaction::I1, vec![1.0], 1.2, 0.8, 1.0, horizon, step).expect("a game");
        let policy = Policy::new(game, DEFAULT_TABLE_BYTES, &CancelToken::new()).expect("an equilibrium");
        let (far, sight, reach) = ([0.0, 40.0, 40.0, 0.0, 0.0, 0.0], [9.0], [1e-9; 2]);
        let setup = Setup { dim: 2, positions: &far, visibility: &sight, capture: &reach };
        let run = simulate(&policy, &setup, &CancelToken::new()).expect("a run");
        let batch = Batch { dim: 2, positions: &far, visibility: &sight, capture: &reach };
        let ends = ensemble::run(&policy, &batch, Some(1), &CancelToken::new()).expect("a batch");
        prop_assert_eq!((run.outcome, run.steps), (Outcome::Timeout, steps));
        prop_assert_eq!(ends, vec![End::from(&run)]);
        let game: &Game = policy.game();
        prop_assert_eq!(game.grid().time(run.steps), horizon);
        let last: Vec<f64> = game.state_weights(true).iter().flat_map(|f| [f[0], 0.0, 0.0, f[1]]).collect();
        prop_assert_eq!(policy.equilibrium().node(steps), &last[..]);
    }
}

//! What holds for every game: random games of every size, both interactions, in the plane and in space.
//!
//! The oracle tests in Python compare with SciPy within tolerances; here it is what must hold to the bit, or at sizes
//! that are too slow there. `PROPTEST_CASES` sets how many games each property meets.

use proptest::prelude::*;
use tadcore::cancel::CancelToken;
use tadcore::cost::costs;
use tadcore::ensemble::{self, Batch, Between, End};
use tadcore::game::{Game, Grid, Interaction, Weights};
use tadcore::network::Topology;
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::simulation::{Outcome, Record, Rules, Setup, Termination, simulate, simulate_with};
use tadcore::synthesis::Synthesizer;

/// A game and a start, before anything is solved.
#[derive(Debug, Clone)]
struct Drawn {
    game: Game,
    dim: usize,
    positions: Vec<f64>,
    visibility: Vec<f64>,
    capture: Vec<f64>,
}

impl Drawn {
    /// None where the game has no equilibrium: a property of the game, not a failure.
    fn policy(&self) -> Option<Policy> {
        Policy::new(self.game.clone(), DEFAULT_TABLE_BYTES, &CancelToken::new()).ok()
    }

    fn setup(&self) -> Setup<'_> {
        Setup { dim: self.dim, positions: &self.positions, visibility: &self.visibility, capture: &self.capture }
    }

    fn run(&self, policy: &Policy) -> Record {
        simulate(policy, &self.setup(), &CancelToken::new()).expect("a valid run")
    }
}

fn weight() -> impl Strategy<Value = f64> {
    (-1.0..1.0_f64).prop_map(|x| (1.5 * x).exp())
}

prop_compose! {
    fn drawn(most: usize)(n in 1..=most, first in any::<bool>(), dim in 2..=3_usize)(
        w in prop::collection::vec(weight(), 5 * n),
        single in prop::collection::vec(weight(), 6),
        lambda in 0.0..=1.0_f64,
        gamma in prop::collection::vec(0.05..=1.0_f64, 4),
        steps in 1..12_usize,
        positions in prop::collection::vec(-2.0..2.0_f64, (n + 2) * dim),
        visibility in prop::collection::vec(0.31..4.0_f64, n + usize::from(!first)),
        capture in prop::collection::vec(0.02..0.3_f64, n + 1),
        first in Just(first), dim in Just(dim), n in Just(n),
    ) -> Drawn {
        let interaction = if first { Interaction::I1 } else { Interaction::I2 };
        let part = |i: usize| w[i * n..(i + 1) * n].to_vec();
        let own = |i: usize| if first { part(i) } else { Vec::new() };
        let weights = Weights {
            r_d: part(0), q_da: own(1), f_da: own(2), q_ad: part(3), f_ad: part(4),
            r_tau: single[0], r_a: single[1], q_atau: single[2], f_atau: single[3], q_taua: single[4], f_taua: single[5],
            lambda, gamma: gamma[..interaction.terms()].to_vec(),
        };
        let grid = Grid::new(0.02 * steps as f64, 0.02).expect("a grid");
        let game = Game::new(interaction, weights, grid).expect("a valid game");
        Drawn { game, dim, positions, visibility, capture }
    }
}

/// Everything of a record but its positions and controls.
fn same_but_moved(one: &Record, other: &Record) -> bool {
    (one.outcome, one.steps, &one.networks, &one.gains, &one.theta)
        == (other.outcome, other.steps, &other.networks, &other.gains, &other.theta)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(
        std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(40)) })]

    /// No number of a run, of its gains or of its costs is anything but finite.
    #[test]
    fn everything_is_finite(drawn in drawn(8)) {
        let Some(policy) = drawn.policy() else { return Ok(()) };
        let record = drawn.run(&policy);
        prop_assert!(policy.equilibrium().as_slice().iter().all(|p| p.is_finite()));
        for values in [&record.positions, &record.controls, &record.gains, &record.theta, &record.terms] {
            prop_assert!(values.iter().all(|x| x.is_finite()));
        }
        prop_assert!(costs(&policy, &record, &CancelToken::new()).expect("costs").iter().all(|j| j.is_finite()));
        prop_assert!(record.theta.iter().all(|&theta| theta >= 0.0));
    }

    /// A quarter turn and a reflection of the plane and a doubling of all lengths round nothing: the same bits.
    #[test]
    fn exact_symmetries_change_no_bit(drawn in drawn(6), factor in prop::sample::select(vec![0.125, 0.5, 2.0, 1024.0])) {
        let Some(policy) = drawn.policy() else { return Ok(()) };
        let record = drawn.run(&policy);
        let (all, d) = (&drawn.positions, drawn.dim);
        // The first two axes change places, the new first one is reversed: of two squares the order does not matter.
        let turn = |x: &[f64]| -> Vec<f64> {
            x.chunks_exact(d).flat_map(|p| [&[-p[1], p[0]], &p[2..]].concat()).collect()
        };
        let reflect = |x: &[f64]| -> Vec<f64> {
            x.chunks_exact(d).flat_map(|p| [&[-p[0]], &p[1..]].concat()).collect()
        };
        let scale = |x: &[f64]| -> Vec<f64> { x.iter().map(|v| factor * v).collect() };
        let mapped = [
            (Drawn { positions: turn(all), ..drawn.clone() }, turn(&record.positions), turn(&record.controls)),
            (Drawn { positions: reflect(all), ..drawn.clone() }, reflect(&record.positions), reflect(&record.controls)),
            (
                Drawn {
                    positions: scale(all),
                    visibility: scale(&drawn.visibility),
                    capture: scale(&drawn.capture),
                    ..drawn.clone()
                },
                scale(&record.positions),
                scale(&record.controls),
            ),
        ];
        for (moved, positions, controls) in mapped {
            let other = moved.run(&policy);
            prop_assert!(same_but_moved(&record, &other));
            prop_assert_eq!(&other.positions, &positions);
            prop_assert_eq!(&other.controls, &controls);
        }
    }

    /// Any network: a player that sees no one has no gain at all, and gains on players that are not seen cancel.
    #[test]
    fn gains_use_only_what_is_seen(drawn in drawn(8), seed in prop::collection::vec(any::<bool>(), 81)) {
        let Some(policy) = drawn.policy() else { return Ok(()) };
        let (m, n) = (drawn.game.constrained(), drawn.game.size());
        let network = Topology::from_fn(m, n, |i, j| seed[i * n + j] && i % 3 != 2);
        let gains = policy.solve(0, &network, &mut Synthesizer::new(), &CancelToken::new()).expect("memory").gains;
        prop_assert!(gains.theta.is_finite() && gains.theta >= 0.0);
        for (i, row) in gains.rows.chunks_exact(n).enumerate() {
            let blind = (0..n).all(|j| !network.sees(i, j));
            prop_assert!(!blind || row.iter().all(|&g| g == 0.0));
            for j in (0..n).filter(|&j| j != i && !network.sees(i, j)) {
                prop_assert_eq!(row[j], 0.0);
            }
            // Without the attacker in sight only differences z_j - z_i can be used: the row sums to nothing.
            if !network.sees_attacker(i) {
                let size: f64 = row.iter().map(|g| g.abs()).sum();
                prop_assert!(row.iter().sum::<f64>().abs() <= 1e-13 * (1.0 + size));
            }
        }
    }

    /// Everyone sees everyone: the equilibrium's own feedback, and nothing left to minimise.
    #[test]
    fn full_sight_is_the_equilibrium(drawn in drawn(8)) {
        let Some(policy) = drawn.policy() else { return Ok(()) };
        let (m, n) = (drawn.game.constrained(), drawn.game.size());
        let gains = policy.solve(0, &Topology::complete(m, n), &mut Synthesizer::new(), &CancelToken::new()).expect("memory").gains;
        let mut feedback = vec![0.0; (n + 1) * n];
        policy.equilibrium().feedback(policy.game(), 0, &mut feedback);
        let largest = feedback.iter().fold(1.0, |most: f64, g| most.max(g.abs()));
        let p = policy.equilibrium().node(0).iter().fold(1.0, |most: f64, p| most.max(p.abs()));
        prop_assert!(gains.theta <= 1e-18 * p.powi(4), "{} {p}", gains.theta);
        for (g, f) in gains.rows.iter().zip(&feedback) {
            prop_assert!((g - f).abs() <= 1e-8 * largest);
        }
    }

    /// Theorem delayproperty, to the bit and for several players at once: until the networks first differ, nothing does.
    #[test]
    fn a_radius_matters_from_its_first_edge_on(drawn in drawn(6), wider in prop::collection::vec(1.0..3.0_f64, 7)) {
        let Some(policy) = drawn.policy() else { return Ok(()) };
        let visibility = drawn.visibility.iter().zip(&wider).map(|(z, w)| z * w).collect();
        let other = Drawn { visibility, ..drawn.clone() }.run(&policy);
        let one = drawn.run(&policy);
        let same = one.networks.iter().zip(&other.networks).take_while(|(a, b)| a == b).count();
        let (row, m) = ((drawn.game.n() + 2) * drawn.dim, drawn.game.constrained() * drawn.game.size());
        // The positions at the first instant that differs are still the same; its controls are not.
        let seen = (same + 1).min(one.networks.len()).min(other.networks.len());
        prop_assert_eq!(&one.positions[..seen * row], &other.positions[..seen * row]);
        prop_assert_eq!(&one.controls[..same * row], &other.controls[..same * row]);
        prop_assert_eq!(&one.gains[..same * m], &other.gains[..same * m]);
    }

    /// A game in a batch, beside others and for any number of threads, ends as it does alone.
    #[test]
    fn a_batch_is_its_single_runs(drawn in drawn(9), shifts in prop::collection::vec(-0.5..0.5_f64, 1..20), threads in 1..4_usize) {
        let Some(policy) = drawn.policy() else { return Ok(()) };
        let moved: Vec<Vec<f64>> = shifts
            .iter()
            .map(|s| drawn.positions.iter().enumerate().map(|(e, x)| x + s * (e as f64).cos()).collect())
            .collect();
        let all = moved.concat();
        let Drawn { dim, visibility, capture, .. } = &drawn;
        let batch = Batch { dim: *dim, positions: &all, visibility, capture };
        let ends = ensemble::run(&policy, &batch, Some(threads), &CancelToken::new()).expect("a valid batch");
        for (end, positions) in ends.iter().zip(moved) {
            let alone = Drawn { positions, ..drawn.clone() }.run(&policy);
            prop_assert_eq!(*end, End::from(&alone));
        }
    }

    /// Between instants, too, a game in a batch is what it is alone; a continuous end is on the rim of its radius.
    #[test]
    fn a_batch_passes_and_ends_as_its_single_runs(drawn in drawn(6), shifts in prop::collection::vec(-0.5..0.5_f64, 1..20), threads in 1..4_usize) {
        let Some(policy) = drawn.policy() else { return Ok(()) };
        let moved: Vec<Vec<f64>> = shifts
            .iter()
            .map(|s| drawn.positions.iter().enumerate().map(|(e, x)| 0.3 * x + s * (e as f64).cos()).collect())
            .collect();
        let (all, none, n) = (moved.concat(), CancelToken::new(), drawn.game.n());
        // Radii that are small beside a step are entered and left within one.
        let capture: Vec<f64> = drawn.capture.iter().map(|sigma| 0.05 * sigma).collect();
        let drawn = Drawn { capture, ..drawn };
        let Drawn { dim, visibility, capture, .. } = &drawn;
        let batch = Batch { dim: *dim, positions: &all, visibility, capture };
        for termination in [Termination::Sampled, Termination::Continuous] {
            let between = Between { termination, passes: true };
            let ends = ensemble::run_with(&policy, &batch, between, None, Some(threads), &none).expect("a valid batch");
            for (end, positions) in ends.iter().zip(&moved) {
                let one = Drawn { positions: positions.clone(), ..drawn.clone() };
                let alone = simulate_with(&policy, &one.setup(), Rules { termination, ..Rules::default() }, &none).expect("a run");
                prop_assert_eq!(*end, End { passed: !alone.passes.is_empty(), ..End::from(&alone) });
                prop_assert!(alone.passes.is_empty() || termination == Termination::Sampled);
                if alone.after > 0.0 {
                    let row = if let Outcome::Intercepted(i) = alone.outcome { i } else { n };
                    let last = &alone.positions[alone.steps * (n + 2) * dim..];
                    let z: f64 = (0..*dim).map(|x| (last[row * dim + x] - last[(n + 1) * dim + x]).powi(2)).sum();
                    prop_assert!((z.sqrt() - capture[row]).abs() < 1e-12, "{} {}", z.sqrt(), capture[row]);
                }
            }
        }
    }

    /// A table of bytes that are none of ours is refused or harmless, whatever its header says.
    #[test]
    fn a_table_of_any_bytes_is_refused(drawn in drawn(3), at in any::<prop::sample::Index>(), bytes in prop::collection::vec(any::<u8>(), 1..40)) {
        let Some(policy) = drawn.policy() else { return Ok(()) };
        drawn.run(&policy);
        let mut table = policy.save_transitions(&CancelToken::new()).expect("memory");
        let from = at.index(table.len());
        let whole = table.clone();
        table.splice(from..(from + bytes.len()).min(whole.len()), bytes);
        if table != whole {
            prop_assert!(policy.load_transitions(&table, &CancelToken::new()).is_err());
        }
    }
}

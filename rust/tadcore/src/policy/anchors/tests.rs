//! What is followed between anchors against a search at the instant itself.

use super::*;
use crate::game::{Interaction, bank};
use crate::policy::DEFAULT_TABLE_BYTES;
use crate::synthesis::Start;

fn policy(interaction: Interaction) -> Policy {
    let game = bank::paper_game(interaction, 0.5).expect("the paper's game");
    Policy::new(game, DEFAULT_TABLE_BYTES, &CancelToken::new()).expect("an equilibrium")
}

fn gains(policy: &Policy, step: usize, form: &Topology) -> Gains {
    policy.gains(step, form, None, &mut Synthesizer::new(), &CancelToken::new()).expect("memory")
}

#[test]
fn p_moves_little_from_anchor_to_anchor() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let policy = policy(interaction);
        let steps = &policy.anchors.steps;
        assert_eq!((steps[0], steps[steps.len() - 1]), (0, policy.equilibrium.steps()));
        for pair in steps.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            assert!(a < b && b - a <= LONGEST);
            assert!(b - a == 1 || !moved(&policy.equilibrium, a, b), "{a} to {b}");
            let next = b + 1;
            let more = b == policy.equilibrium.steps() || b - a == LONGEST || moved(&policy.equilibrium, a, next);
            assert!(more, "{a} to {b} could be longer");
        }
        // Most instants lie between anchors.
        assert!(4 * steps.len() < policy.equilibrium.steps(), "{}", steps.len());
    }
}

/// Every network of the paper's games at some instants: the lowest minimum, for a few steps; bitwise the
/// same whatever was asked for before.
#[test]
fn what_is_followed_is_what_is_found_by_searching() {
    // Measured: 2.17 and 2.64 steps; from the minimum at one anchor alone they are more.
    for (interaction, every, most) in [(Interaction::I1, 5, 2.25), (Interaction::I2, 97, 2.75)] {
        let (policy, other) = (policy(interaction), policy(interaction));
        let (m, n) = (policy.game.constrained(), policy.game.size());
        let (mut steps, mut searched, mut followed) = (0, 0, 0);
        for key in (0..1u64 << (m * n)).step_by(every) {
            let form = Topology::from_key(m, n, key);
            let k = 1 + (key as usize * 37) % (policy.equilibrium.steps() - 1);
            let found = gains(&policy, k, &form);
            let (mut solver, cancel) = (Synthesizer::new(), CancelToken::new());
            let alone = other.gains(k, &form, Some(Options::default()), &mut solver, &cancel).expect("memory");
            assert!((found.theta - alone.theta).abs() <= 1e-9 * alone.theta + 1e-20, "{k} {form:?}");
            assert_eq!(found.certified, alone.certified, "{k} {form:?}");
            let far = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(far(&found.rows, &alone.rows) <= 1e-7 * norm(&alone.rows), "{k} {form:?}");
            // Asked for in another order, from another instant of the same stretch.
            gains(&other, k.saturating_sub(7), &form);
            assert_eq!(gains(&other, k, &form), found, "{k} {form:?}");
            if found.start == Start::Between {
                followed += 1;
                steps += found.iterations;
                searched += alone.iterations;
            }
        }
        assert!(followed > 20 && searched > 10 * steps, "{followed} {steps} {searched}");
        assert!(f64::from(steps as u32) <= most * f64::from(followed), "{followed} {steps} {searched}");
    }
}

/// An anchor's own gains are those of the search there.
#[test]
fn anchors_are_searched() {
    let policy = policy(Interaction::I1);
    let form = Topology::from_fn(3, 4, |i, j| i != j && (i + j) % 2 == 1);
    for &k in &policy.anchors.steps[..4] {
        let (mut solver, cancel) = (Synthesizer::new(), CancelToken::new());
        let alone = policy.gains(k, &form, Some(Options::default()), &mut solver, &cancel).expect("memory");
        assert_eq!(gains(&policy, k, &form), alone);
    }
}

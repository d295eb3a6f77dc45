//! Who wins the paper's game from random positions: an ensemble in lockstep, cold and then from a warm table.
//!
//! `cargo run --release --example ensemble -- [trials] [threads]`

use std::time::Instant;

use tadcore::cancel::CancelToken;
use tadcore::ensemble::{self, Batch};
use tadcore::game::{Interaction, bank};
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::simulation::Outcome;

/// Uniform numbers in [−3, 3) from a counter (SplitMix64).
fn uniform(count: usize) -> Vec<f64> {
    (0..count as u64)
        .map(|i| {
            let mut z = (i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            6.0 * ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 3.0
        })
        .collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let trials = arguments.next().map_or(Ok(10_000), |text| text.parse())?;
    let threads = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let game = bank::paper_game(Interaction::I1, 1.0)?;
    let setup = bank::paper_i1_limited();
    let cancel = CancelToken::new();
    let policy = Policy::new(game, DEFAULT_TABLE_BYTES, &cancel)?;
    let positions = uniform(trials * 5 * 2);
    let batch = Batch { dim: 2, positions: &positions, visibility: &setup.visibility, capture: &setup.capture };
    for table in ["cold", "warm", "warm", "warm"] {
        let began = Instant::now();
        let ends = ensemble::run(&policy, &batch, Some(threads), &cancel)?;
        let seconds = began.elapsed().as_secs_f64();
        let count = |wanted: fn(&Outcome) -> bool| ends.iter().filter(|end| wanted(&end.outcome)).count();
        let steps: usize = ends.iter().map(|end| end.step).sum();
        println!(
            "{table}: {} intercepted, {} captured, {} out of time; {:.0} trials/s, {:.2} ns a trial-step; {:?}",
            count(|o| matches!(o, Outcome::Intercepted(_))),
            count(|o| *o == Outcome::Captured),
            count(|o| *o == Outcome::Timeout),
            trials as f64 / seconds,
            1e9 * seconds / steps as f64,
            policy.table(),
        );
    }
    Ok(())
}

//! Ensembles of the paper's game (I1, limited observations) from random starts: a warm table, a cold one, and larger
//! teams, on one thread.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use tadcore::cancel::CancelToken;
use tadcore::ensemble::{self, Batch};
use tadcore::game::{Game, Interaction, bank};
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};

/// Uniform numbers in [−3, 3) from a counter (SplitMix64).
fn uniform(count: usize) -> Vec<f64> {
    let mix = |i: u64| {
        let mut z = (i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        6.0 * ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64 - 3.0
    };
    (0..count as u64).map(mix).collect()
}

fn policy(game: &Game) -> Policy {
    Policy::new(game.clone(), DEFAULT_TABLE_BYTES, &CancelToken::new()).expect("an equilibrium")
}

fn trials(c: &mut Criterion) {
    let cancel = CancelToken::new();
    let game = bank::paper_game(Interaction::I1, 1.0).expect("the paper's game is valid");
    let start = bank::paper_i1_limited();
    let mut group = c.benchmark_group("ensemble");
    group.sample_size(10);
    for (name, count) in [("paper-i1/cold", 1_000), ("paper-i1/warm", 10_000)] {
        let positions = uniform(count * 5 * 2);
        let batch = Batch { dim: 2, positions: &positions, visibility: &start.visibility, capture: &start.capture };
        let play = |policy: &Policy| ensemble::run(policy, &batch, Some(1), &cancel).expect("a batch");
        group.throughput(Throughput::Elements(count as u64));
        let warm = policy(&game);
        group.bench_function(name, |b| {
            if name.ends_with("cold") {
                b.iter_batched(|| policy(&game), |policy| black_box(play(&policy)), BatchSize::PerIteration);
            } else {
                play(&warm);
                b.iter(|| black_box(play(&warm)));
            }
        });
    }
    for n in [5, 8, 12] {
        let game = bank::unit_game(Interaction::I1, vec![1.0; n], 1.2, 0.8, 1.0, 2.0, 0.01).expect("a valid game");
        let (visibility, capture) = (vec![1.5; n], vec![0.1; n + 1]);
        let positions = uniform(50 * (n + 2) * 2);
        let batch = Batch { dim: 2, positions: &positions, visibility: &visibility, capture: &capture };
        let play = |policy: &Policy| ensemble::run(policy, &batch, Some(1), &cancel).expect("a batch");
        group.throughput(Throughput::Elements(50));
        let warm = policy(&game);
        play(&warm);
        group.bench_function(format!("n={n}/warm"), |b| b.iter(|| black_box(play(&warm))));
    }
    group.finish();
}

criterion_group!(benches, trials);
criterion_main!(benches);

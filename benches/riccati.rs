//! The Riccati equations on a 1,201-node grid: cold, on one thread.
//!
//! I1 is `bank::varied_game` with the paper's horizon. In I2 that game has an equilibrium on [0, 6] for n = 3, but for
//! n = 10 its solution escapes at 0.0961, so the horizon there is 0.09, with as many nodes.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use tadcore::cancel::CancelToken;
use tadcore::game::{Interaction, bank};
use tadcore::riccati;

fn riccati(c: &mut Criterion) {
    let token = CancelToken::new();
    let cases = [
        ("riccati/n", Interaction::I1, 3, 6.0),
        ("riccati/n", Interaction::I1, 10, 6.0),
        ("riccati/n", Interaction::I1, 30, 6.0),
        ("riccati_I2/n", Interaction::I2, 3, 6.0),
        ("riccati_I2/n", Interaction::I2, 10, 0.09),
    ];
    for (name, interaction, n, horizon) in cases {
        let Ok(game) = bank::varied_game(interaction, n, horizon, horizon / 1200.0) else { continue };
        if riccati::solve(&game, &token).is_err() {
            continue;
        }
        let mut group = c.benchmark_group(name);
        group.sample_size(if n > 10 { 20 } else { 50 });
        group.bench_with_input(BenchmarkId::from_parameter(n), &game, |b, game| {
            b.iter(|| riccati::solve(black_box(game), &token));
        });
        group.finish();
    }
}

criterion_group!(benches, riccati);
criterion_main!(benches);

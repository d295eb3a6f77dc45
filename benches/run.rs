//! One recorded run of the paper's game (I1, limited observations): cold, with Riccati and every synthesis, and warm,
//! from the table.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use tadcore::cancel::CancelToken;
use tadcore::game::{Interaction, bank};
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::simulation::{Setup, simulate};

fn run(c: &mut Criterion) {
    let game = bank::paper_game(Interaction::I1, 1.0).expect("the paper's game is valid");
    let start = bank::paper_i1_limited();
    let positions: Vec<f64> = start.positions.concat();
    let setup = Setup { dim: 2, positions: &positions, visibility: &start.visibility, capture: &start.capture };
    let cancel = CancelToken::new();
    let mut group = c.benchmark_group("run");
    group.bench_function("paper-i1/cold", |b| {
        b.iter(|| {
            let policy = Policy::new(game.clone(), DEFAULT_TABLE_BYTES, &cancel).expect("an equilibrium");
            black_box(simulate(&policy, &setup, &cancel).expect("a run"))
        });
    });
    let policy = Policy::new(game.clone(), DEFAULT_TABLE_BYTES, &cancel).expect("an equilibrium");
    group.bench_function("paper-i1/warm", |b| {
        b.iter(|| black_box(simulate(&policy, &setup, &cancel).expect("a run")));
    });
    group.finish();
}

criterion_group!(benches, run);
criterion_main!(benches);

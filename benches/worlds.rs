//! Ensembles of the paper's game (I1, limited observations) in worlds that fail, talk and shake, beside the plain one: all
//! from a warm table, on one thread, in turns.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use tadcore::cancel::CancelToken;
use tadcore::ensemble::{self, Batch, Between};
use tadcore::game::{Interaction, bank};
use tadcore::network::Frame;
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::random::Begin;
use tadcore::simulation::{Chances, Communication, World};

const TRIALS: usize = 20_000;

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

/// Worlds by name: mean times as a sensor may have them, links that fail, a tenth of the length scale.
fn worlds() -> Vec<(&'static str, Option<World>)> {
    let never = || vec![f64::INFINITY; 3];
    let quiet = World {
        mean_time_to_failure: never(),
        mean_time_to_repair: never(),
        mean_time_detected: never(),
        mean_time_missed: never(),
        begin: vec![Begin::Up; 3],
        communication: None,
        disturbance: vec![0.0; 5],
    };
    let talk = |radius: f64, up: f64, down: f64| Communication {
        radius: vec![Some(radius); 3],
        relays: None,
        frame: Frame::Relative,
        mean_time_up: vec![up; 3],
        mean_time_down: vec![down; 3],
        begin: Begin::Up,
    };
    let none = f64::INFINITY;
    let links = |communication| World { communication: Some(communication), ..quiet.clone() };
    vec![
        ("plain", None),
        ("quiet", Some(quiet.clone())),
        (
            "sensors",
            Some(World { mean_time_to_failure: vec![3.0; 3], mean_time_to_repair: vec![0.2; 3], ..quiet.clone() }),
        ),
        ("edges", Some(World { mean_time_detected: vec![1.0; 3], mean_time_missed: vec![0.05; 3], ..quiet.clone() })),
        ("links everywhere", Some(links(talk(none, none, none)))),
        ("links of radius 2", Some(links(talk(2.0, none, none)))),
        ("links that fail", Some(links(talk(2.0, 5.0, 0.5)))),
        ("disturbed attacker", Some(World { disturbance: vec![0.0, 0.0, 0.0, 0.0, 0.05], ..quiet.clone() })),
        ("all disturbed", Some(World { disturbance: vec![0.05; 5], ..quiet.clone() })),
    ]
}

fn trials(c: &mut Criterion) {
    let cancel = CancelToken::new();
    let game = bank::paper_game(Interaction::I1, 1.0).expect("the paper's game is valid");
    let start = bank::paper_i1_limited();
    let positions = uniform(TRIALS * 5 * 2);
    let batch = Batch { dim: 2, positions: &positions, visibility: &start.visibility, capture: &start.capture };
    let policy = Policy::new(game, DEFAULT_TABLE_BYTES, &cancel).expect("an equilibrium");
    let mut group = c.benchmark_group("worlds");
    group.sample_size(10);
    for (name, world) in worlds() {
        let chances = world.as_ref().map(|world| Chances { world, seed: 1, trial: 0 });
        let play =
            || ensemble::run_with(&policy, &batch, Between::NOTHING, chances, Some(1), &cancel).expect("a batch");
        let steps: usize = play().iter().map(|end| end.step).sum();
        group.throughput(Throughput::Elements(steps as u64));
        group.bench_function(name, |b| b.iter(|| black_box(play())));
    }
    group.finish();
}

criterion_group!(benches, trials);
criterion_main!(benches);

//! One synthesis: min Θ₁ at mid-game under random networks of density ½, n = 3, 5, 10, 20.
//!
//! `canonical` cycles through networks whose first descent is certified (Newton alone and the certificate);
//! `any` cycles through all networks drawn, restarts included.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use tadcore::cancel::CancelToken;
use tadcore::game::{Interaction, bank};
use tadcore::network::Topology;
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::synthesis::{Options, Synthesizer};

/// Networks drawn for each size.
const NETWORKS: usize = 64;

fn networks(rows: usize, size: usize) -> Vec<Topology> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut coin = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state >> 40 & 1 == 1
    };
    (0..NETWORKS)
        .map(|_| {
            let bits: Vec<bool> = (0..rows * size).map(|_| coin()).collect();
            Topology::from_fn(rows, size, |i, j| bits[i * size + j])
        })
        .collect()
}

fn synthesis(c: &mut Criterion) {
    for n in [3, 5, 10, 20] {
        let game = bank::varied_game(Interaction::I1, n, 3.0, 0.01).expect("a valid game");
        let policy = Policy::new(game, DEFAULT_TABLE_BYTES, &CancelToken::new()).expect("an equilibrium");
        let problem = policy.problem(150, &CancelToken::new()).expect("memory");
        let all = networks(problem.rows(), problem.size());
        let mut solver = Synthesizer::new();
        let options = Options::default();
        let certified: Vec<Topology> =
            all.iter().filter(|t| solver.solve(&problem, t, options).expect("memory").certified).cloned().collect();
        let mut group = c.benchmark_group("synthesis");
        if n >= 10 {
            group.sample_size(10);
        }
        for (kind, set) in [("canonical", &certified), ("any", &all)] {
            if set.is_empty() {
                continue;
            }
            let mut turn = set.iter().cycle();
            group.bench_function(format!("{kind}/{n}"), |b| {
                b.iter(|| turn.next().map(|t| black_box(solver.solve(&problem, t, options).expect("memory"))));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, synthesis);
criterion_main!(benches);

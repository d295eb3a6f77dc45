//! Ensembles against the recorded runs they stand for: every outcome and every final instant equal, for any size, number
//! of axes, threads and table.

use tadcore::cancel::CancelToken;
use tadcore::ensemble::{self, Batch, End};
use tadcore::error::{RunError, TableError};
use tadcore::game::{Interaction, bank};
use tadcore::network::Topology;
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::simulation::{Setup, simulate};
use tadcore::synthesis::{Options, Synthesizer};

/// Numbers in [0, 1), one after another (SplitMix64).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

struct Case {
    policy: Policy,
    dim: usize,
    trials: usize,
    positions: Vec<f64>,
    visibility: Vec<f64>,
    capture: Vec<f64>,
}

/// M random games of n defenders; their radii differ from trial to trial, or are shared.
fn case(interaction: Interaction, n: usize, dim: usize, trials: usize, shared: bool, bytes: usize) -> Case {
    let r_d = (0..n).map(|i| 0.8 + 0.3 * (i % 3) as f64).collect();
    case_of(interaction, r_d, dim, trials, shared, bytes)
}

/// The same for given control weights of the defenders.
fn case_of(interaction: Interaction, r_d: Vec<f64>, dim: usize, trials: usize, shared: bool, bytes: usize) -> Case {
    let n = r_d.len();
    // Unit weights in I2 escape early: at 0.31 with five defenders, at 0.16 with seven.
    let horizon = if interaction == Interaction::I2 && n > 3 { 0.1 } else { 1.5 };
    let mut draws = Draws(1000 * n as u64 + dim as u64);
    let game = bank::unit_game(interaction, r_d, 1.2, 0.8, 1.0, horizon, 0.01).expect("a valid game");
    let m = game.constrained();
    let rows = if shared { 1 } else { trials };
    let policy = Policy::new(game, bytes, &CancelToken::new()).expect("an equilibrium");
    Case {
        policy,
        dim,
        trials,
        positions: (0..trials * (n + 2) * dim).map(|_| draws.between(-2.0, 2.0)).collect(),
        visibility: (0..rows * m).map(|_| draws.between(0.4, 3.0)).collect(),
        capture: (0..rows * (n + 1)).map(|_| draws.between(0.05, 0.3)).collect(),
    }
}

impl Case {
    fn batch(&self) -> Batch<'_> {
        Batch { dim: self.dim, positions: &self.positions, visibility: &self.visibility, capture: &self.capture }
    }

    fn play(&self, threads: usize) -> Vec<End> {
        ensemble::run(&self.policy, &self.batch(), Some(threads), &CancelToken::new()).expect("a valid batch")
    }

    fn one_by_one(&self) -> Vec<End> {
        let game = self.policy.game();
        let row = |all: &'_ [f64], width: usize, i: usize| -> std::ops::Range<usize> {
            let i = if all.len() == width { 0 } else { i };
            i * width..(i + 1) * width
        };
        (0..self.trials)
            .map(|i| {
                let setup = Setup {
                    dim: self.dim,
                    positions: &self.positions[row(&self.positions, (game.n() + 2) * self.dim, i)],
                    visibility: &self.visibility[row(&self.visibility, game.constrained(), i)],
                    capture: &self.capture[row(&self.capture, game.size(), i)],
                };
                let record = simulate(&self.policy, &setup, &CancelToken::new()).expect("a valid run");
                End::from(&record)
            })
            .collect()
    }
}

#[test]
fn every_trial_ends_as_it_would_alone() {
    let mut kinds = std::collections::HashSet::new();
    for interaction in [Interaction::I1, Interaction::I2] {
        for (n, trials) in [(1, 37), (2, 37), (3, 37), (4, 21), (5, 13), (7, 3)] {
            for dim in [2, 3] {
                let case = case(interaction, n, dim, trials, n % 2 == 0, DEFAULT_TABLE_BYTES);
                let ends = case.play(1);
                assert_eq!(ends, case.one_by_one(), "{interaction:?} {n} {dim}");
                kinds.extend(ends.iter().map(|end| (end.outcome.code(), end.step > 0)));
            }
        }
    }
    // Every outcome, at the start and later: 2 × 2 + the timeouts.
    assert_eq!(kinds.len(), 5, "{kinds:?}");
    // Beyond the sizes known to the compiler, keys of more than one word, and an odd number of axes.
    for (n, dim, trials) in [(8, 2, 2), (9, 3, 1), (3, 1, 20), (2, 4, 20)] {
        let case = case(Interaction::I1, n, dim, trials, true, DEFAULT_TABLE_BYTES);
        assert_eq!(case.play(1), case.one_by_one(), "{n} {dim}");
    }
}

#[test]
fn threads_and_the_table_change_nothing() {
    let reference = case(Interaction::I1, 3, 2, 600, true, DEFAULT_TABLE_BYTES);
    let ends = reference.play(1);
    let cold = reference.policy.table();
    assert_eq!(reference.play(1), ends);
    let warm = reference.policy.table();
    // Work counts: a warm table solves nothing, and every miss is an entry.
    assert_eq!((warm.misses, warm.entries), (cold.misses, cold.entries));
    assert_eq!(cold.misses, cold.entries as u64);
    for threads in [2, 3, 8] {
        let other = case(Interaction::I1, 3, 2, 600, true, DEFAULT_TABLE_BYTES);
        assert_eq!(other.play(threads), ends, "{threads} threads");
        assert_eq!(other.policy.table().entries, cold.entries, "{threads} threads");
    }
    // No room at all, and room for some entries: solved again where they are not kept, never wrong, never over.
    for bytes in [0, 200_000] {
        let small = case(Interaction::I1, 3, 2, 600, true, bytes);
        for threads in [1, 2] {
            assert_eq!(small.play(threads), ends, "{bytes} bytes");
        }
        assert!(small.policy.table().bytes <= bytes, "{:?}", small.policy.table());
    }
}

/// Defenders of one kind change places: fewer syntheses than entries, and the same bits whoever asked first.
#[test]
fn equal_defenders_share_their_answers() {
    for (interaction, n, trials) in [(Interaction::I1, 3, 300), (Interaction::I2, 3, 60), (Interaction::I1, 5, 20)] {
        let make = |bytes| case_of(interaction, vec![1.0; n], 2, trials, true, bytes);
        let reference = make(DEFAULT_TABLE_BYTES);
        let ends = reference.play(1);
        assert_eq!(ends, reference.one_by_one(), "{interaction:?} {n}");
        let stats = reference.policy.table();
        // The recorded runs solve for themselves; what they add is as much as they miss.
        let fresh = make(DEFAULT_TABLE_BYTES);
        assert_eq!(fresh.play(1), ends);
        assert!(fresh.policy.table().misses < fresh.policy.table().entries as u64, "{stats:?}");
        for threads in [2, 3] {
            let other = make(DEFAULT_TABLE_BYTES);
            assert_eq!(other.play(threads), ends, "{threads} threads");
            assert_eq!(other.policy.table().entries, fresh.policy.table().entries, "{threads} threads");
            assert_eq!(sorted(&other.policy), sorted(&fresh.policy), "{threads} threads");
        }
        for bytes in [0, 20_000] {
            assert_eq!(make(bytes).play(2), ends, "{bytes} bytes");
        }
        // Half of the trials first, in the other direction: others ask first, and every entry has the same bits.
        let split = make(DEFAULT_TABLE_BYTES);
        let width = 2 * (n + 2);
        let last = Batch { positions: &split.positions[trials / 2 * width..], ..split.batch() };
        ensemble::run(&split.policy, &last, Some(1), &CancelToken::new()).expect("a batch");
        assert_eq!(split.play(1), ends);
        assert_eq!(sorted(&split.policy), sorted(&fresh.policy));
    }
}

/// The entries of a saved table in order, without the checksum.
fn sorted(policy: &Policy) -> Vec<Vec<u8>> {
    let bytes = policy.save_transitions(&CancelToken::new()).expect("memory");
    let words = (policy.game().constrained() * policy.game().size()).div_ceil(64);
    let len = 8 * (1 + words + policy.game().size().pow(2));
    // Behind the header and the game's identity, of which the header says how long it is.
    let first = 40 + u64::from_le_bytes(bytes[24..32].try_into().expect("eight bytes")) as usize;
    let mut entries: Vec<Vec<u8>> = bytes[first..bytes.len() - 8].chunks_exact(len).map(<[u8]>::to_vec).collect();
    entries.sort();
    entries
}

/// The gains of a relabelled network are the relabelled gains, to the bit where only one relabelling leads there, and those
/// that the network itself leads to without any sharing, to rounding.
#[test]
fn relabelled_networks_have_relabelled_gains() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let game = bank::unit_game(interaction, vec![1.0, 1.0, 1.3, 1.0], 1.2, 0.8, 1.0, 0.2, 0.05).expect("a game");
        let (m, n) = (game.constrained(), game.size());
        let policy = Policy::new(game, 0, &CancelToken::new()).expect("an equilibrium");
        let mut solver = Synthesizer::new();
        let (mut draws, mut compared) = (Draws(5), 0);
        for _ in 0..60 {
            let density = draws.next();
            let seen: Vec<bool> = (0..m * n).map(|_| draws.next() < density).collect();
            let topology = Topology::from_fn(m, n, |i, j| seen[i * n + j]);
            let own = policy.solve(2, &topology, &mut solver, &CancelToken::new()).expect("memory");
            let orders = [[1, 0, 2, 3, 4], [3, 1, 2, 0, 4], [0, 3, 2, 1, 4], [1, 3, 2, 0, 4], [3, 0, 2, 1, 4]];
            let symmetric = orders.iter().any(|order| topology.relabelled(order) == topology);
            for order in orders.iter().filter(|_| !symmetric) {
                compared += 1;
                let other =
                    policy.solve(2, &topology.relabelled(order), &mut solver, &CancelToken::new()).expect("memory");
                for (i, row) in other.transition.chunks_exact(n).enumerate() {
                    assert!((0..n).all(|j| row[j] == own.transition[order[i] * n + order[j]]));
                }
                for (i, row) in other.gains.rows.chunks_exact(n).enumerate() {
                    assert!((0..n).all(|j| row[j] == own.gains.rows[order[i] * n + order[j]]));
                }
                assert!((0..n).all(|j| other.attacker[j] == own.attacker[order[j]]));
            }
            let problem = policy.problem(2, &CancelToken::new()).expect("memory");
            let alone = solver.solve(&problem, &topology, Options::default()).expect("memory");
            assert!((alone.theta - own.gains.theta).abs() <= 1e-9 * alone.theta + 1e-20, "{topology:?}");
            for (a, b) in alone.rows.iter().zip(&own.gains.rows) {
                assert!((a - b).abs() < 1e-7, "{topology:?}");
            }
        }
        assert!(compared > 150, "{compared}");
    }
}

#[test]
fn a_bad_row_is_refused_before_anything_runs_and_a_raised_token_stops() {
    let mut bad = case(Interaction::I1, 2, 2, 50, true, DEFAULT_TABLE_BYTES);
    let token = CancelToken::new();
    token.cancel();
    assert!(matches!(ensemble::run(&bad.policy, &bad.batch(), Some(2), &token), Err(RunError::Cancelled(_))));
    bad.positions[8 * 33 + 5] = f64::NAN;
    let error = ensemble::run(&bad.policy, &bad.batch(), Some(1), &CancelToken::new()).expect_err("a bad row");
    assert_eq!(error.to_string(), "positions[2, 1] is NaN, but it must be a finite number");
    assert_eq!(bad.policy.table().entries, 0);
}

#[test]
fn a_saved_table_comes_back_whole_and_a_damaged_one_is_refused() {
    let make = |interaction, n| case(interaction, n, 2, 40, true, DEFAULT_TABLE_BYTES);
    for n in [2, 3, 4] {
        let first = make(Interaction::I1, n);
        let ends = first.play(1);
        let bytes = first.policy.save_transitions(&CancelToken::new()).expect("memory");

        let second = make(Interaction::I1, n);
        assert_eq!(second.policy.load_transitions(&bytes, &CancelToken::new()), Ok(first.policy.table().entries));
        assert_eq!(second.policy.save_transitions(&CancelToken::new()).expect("memory"), bytes);
        assert_eq!(second.play(1), ends);
        assert_eq!(second.policy.table().misses, 0);

        let load = |bytes: &[u8]| second.policy.load_transitions(bytes, &CancelToken::new());
        // Its first bytes say how long it is, so that nothing longer need be read.
        assert_eq!(second.policy.transitions_length(&bytes[..40]), Ok(bytes.len() as u64));
        let mut vast = bytes.clone();
        vast[32..40].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(matches!(load(&vast), Err(TableError::TooMany { found: u64::MAX, .. })));
        let small = case(Interaction::I1, n, 2, 40, true, 1000);
        assert!(matches!(small.policy.transitions_length(&bytes[..40]), Err(TableError::TooMany { .. })));
        assert_eq!(load(&[]), Err(TableError::Foreign));
        assert_eq!(
            make(Interaction::I2, n).policy.load_transitions(&bytes, &CancelToken::new()),
            Err(TableError::OtherGame)
        );
        for at in [40, 57, bytes.len() / 2, bytes.len() - 1] {
            let mut damaged = bytes.clone();
            damaged[at] ^= 4;
            assert_eq!(load(&damaged), Err(TableError::Damaged), "byte {at}");
        }
        assert_eq!(load(&bytes[..bytes.len() - 8]), Err(TableError::Damaged));
        let mut former = bytes.clone();
        former[8] = 1;
        assert_eq!(load(&former), Err(TableError::Format { found: 1, expected: 3 }));
    }
}

/// What a process of this environment does: refused, or the width in use and how the trials of one batch end.
#[test]
#[ignore = "runs in a process of its own, from the test below"]
fn what_this_process_does() {
    match bank::paper_game(Interaction::I1, 1.0) {
        Err(error) => println!("refused: {error}"),
        Ok(_) => {
            let case = case(Interaction::I1, 3, 2, 100, true, DEFAULT_TABLE_BYTES);
            println!("used: {} {:?}", tadcore::simd::in_use().expect("a width"), case.play(1));
        }
    }
}

/// Where the environment asks for a width that cannot be had, no game is made; every other one ends all trials alike.
#[test]
fn the_environment_chooses_a_width_or_is_refused() {
    let told = |value: &str| {
        let program = std::env::current_exe().expect("this program");
        let test = ["--exact", "what_this_process_does", "--ignored", "--nocapture"];
        let output = std::process::Command::new(program).args(test).env("TADCORE_SIMD", value).output();
        let text = String::from_utf8(output.expect("a process").stdout).expect("UTF-8");
        let line = text.lines().find_map(|line| line.split_once("used: ").or_else(|| line.split_once("refused: ")));
        line.expect("a line that begins with what was used").1.to_owned()
    };
    let refused = told("sse2");
    let (said, widths) = refused.split_once("; this processor has ").expect("the widths of the processor");
    let rule = "it must be baseline, avx2 or avx512 (or empty: the widest)";
    assert_eq!(said, format!("TADCORE_SIMD is \"sse2\", but {rule}"));
    let widths: Vec<&str> = widths.split(", ").collect();
    let ends = |value: &str| told(value).split_once(' ').map(|(used, ends)| (used.to_owned(), ends.to_owned()));
    let widest = ends("").expect("the widest");
    assert_eq!(widest.0, widths[widths.len() - 1]);
    for name in ["baseline", "avx2", "avx512"] {
        if widths.contains(&name) {
            assert_eq!(ends(name), Some((name.to_owned(), widest.1.clone())));
        } else {
            let only = widths.join(", ");
            assert_eq!(told(name), format!("TADCORE_SIMD is {name:?}, but this processor has only {only}"));
        }
    }
}

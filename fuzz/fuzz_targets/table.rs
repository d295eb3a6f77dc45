//! Any bytes as a saved table: refused, or read into a table that plays without a panic.
//!
//! The header and the checksum of the bytes are made right, so that the fuzzer gets past what tells accidents.

#![no_main]

use std::sync::LazyLock;

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use tadcore::cancel::CancelToken;
use tadcore::ensemble::{self, Batch};
use tadcore::game::{Game, Interaction, bank};
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};

#[derive(Debug, Arbitrary)]
struct Input {
    game: u8,
    /// Bytes as they are, without any repair.
    raw: bool,
    /// Numbers written over the entries, each at its place.
    changes: Vec<(u16, u64)>,
    bytes: Vec<u8>,
}

struct Known {
    game: Game,
    table: Vec<u8>,
}

fn policy(game: &Game) -> Policy {
    Policy::new(game.clone(), DEFAULT_TABLE_BYTES, &CancelToken::new()).expect("an equilibrium")
}

fn play(policy: &Policy, n: usize) -> Vec<u8> {
    let positions: Vec<f64> = (0..12 * (n + 2) * 2).map(|i| 2.0 * (1.7 * i as f64).sin()).collect();
    let (visibility, capture) = (vec![1.5; policy.game().constrained()], vec![0.1; n + 1]);
    let batch = Batch { dim: 2, positions: &positions, visibility: &visibility, capture: &capture };
    // A table that was tampered with gives other numbers, and may drive a player beyond all bounds: that is an error.
    let _ = ensemble::run(policy, &batch, Some(1), &CancelToken::new());
    policy.save_transitions(&CancelToken::new()).expect("memory")
}

/// A per-step table by index, one by hashing and one of keys of two words.
static KNOWN: LazyLock<Vec<Known>> = LazyLock::new(|| {
    [(Interaction::I1, 2), (Interaction::I1, 3), (Interaction::I2, 3), (Interaction::I1, 8)]
        .into_iter()
        .map(|(interaction, n)| {
            let game = bank::unit_game(interaction, vec![1.0; n], 1.2, 0.8, 1.0, 0.05, 0.01).expect("a valid game");
            let table = play(&policy(&game), n);
            Known { game, table }
        })
        .collect()
});

/// The checksum of the format, so that what is changed on purpose is not refused as an accident.
fn sealed(mut table: Vec<u8>) -> Vec<u8> {
    let end = table.len() - 8;
    let sum = u64::from(crc32fast::hash(&table[..end]));
    table[end..].copy_from_slice(&sum.to_le_bytes());
    table
}

fuzz_target!(|input: Input| {
    let known = &KNOWN[usize::from(input.game) % KNOWN.len()];
    let bytes = if input.raw {
        input.bytes
    } else {
        let mut table = known.table.clone();
        let words = table.len() / 8;
        for (at, value) in input.changes {
            let at = 8 * (usize::from(at) % words);
            table[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
        sealed(table)
    };
    let policy = policy(&known.game);
    if policy.load_transitions(&bytes, &CancelToken::new()).is_ok() {
        play(&policy, known.game.n());
    }
});

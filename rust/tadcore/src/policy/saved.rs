//! A table of transitions as bytes: saved beside a study, read back before the next one, which then starts warm.
//!
//! Little-endian: the magic (8 bytes), the format, N, m, K (u32 each), the length of the game's identity in bytes and the
//! number of entries (u64 each), the identity, then the entries: step (u64), key (words of u64), exp(Cδ) by columns
//! (N² f64). The last eight bytes hold the CRC-32 of all before. The identity is every weight, the grid, a receding horizon, a criterion other than the paper's and the version
//! of this crate, since another version may choose other gains.

use super::step_table::padded;
use super::transitions::Transitions;
use crate::cancel::CancelToken;
use crate::error::{Stopped, TableError};
use crate::game::{Criterion, Game, Interaction};
use crate::memory::{reserve, zeros};

const MAGIC: &[u8; 8] = b"tadtable";
const FORMAT: u32 = 3;
/// Bytes, in whole entries, that are checked between two looks at the cancel token.
const POLL: usize = 1 << 22;
const HEADER: usize = 8 + 4 * 4 + 2 * 8;

fn checksum(bytes: &[u8]) -> u64 {
    crc32fast::hash(bytes).into()
}

/// What two games share only if every answer of their policies is the same.
fn identity(game: &Game) -> Vec<u8> {
    let w = game.weights();
    let lists = [&w.r_d, &w.q_da, &w.f_da, &w.q_ad, &w.f_ad, &w.gamma];
    let single = [w.r_tau, w.r_a, w.q_atau, w.f_atau, w.q_taua, w.f_taua, w.lambda, game.grid().horizon()];
    let numbers = lists.into_iter().flatten().chain(&single).map(|x| x.to_bits());
    let interaction = u64::from(game.interaction() == Interaction::I1);
    let sizes = [interaction, game.n() as u64, game.grid().steps() as u64];
    let mut out: Vec<u8> = sizes.into_iter().chain(numbers).flat_map(u64::to_le_bytes).collect();
    // What is as in the paper says nothing, so that its tables are those of former versions.
    if let Some(ahead) = game.prediction_horizon() {
        out.extend_from_slice(b"receding");
        out.extend_from_slice(&ahead.to_bits().to_le_bytes());
    }
    if game.criterion() == Criterion::Component {
        out.extend_from_slice(b"component");
    }
    out.extend_from_slice(env!("CARGO_PKG_VERSION").as_bytes());
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// Reads numbers from the front of a slice that was measured before.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn u32(&mut self) -> u32 {
        self.0.split_off(..4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes)
    }

    fn u64(&mut self) -> u64 {
        self.0.split_off(..8).and_then(|b| b.try_into().ok()).map_or(0, u64::from_le_bytes)
    }
}

/// What a table of a game looks like in bytes.
struct Shape {
    size: usize,
    constrained: usize,
    steps: usize,
    /// Instants that have entries of their own.
    instants: usize,
    /// Words of a key.
    words: usize,
    /// Bytes of an entry.
    entry: usize,
    identity: Vec<u8>,
}

impl Shape {
    fn of(game: &Game) -> Self {
        let (size, constrained) = (game.size(), game.constrained());
        let words = (constrained * size).div_ceil(64);
        let (entry, steps) = (8 * (1 + words + size * size), game.grid().steps());
        let instants = if game.prediction_horizon().is_some() { 1 } else { steps };
        Self { size, constrained, steps, instants, words, entry, identity: identity(game) }
    }

    /// The numbers that follow the format.
    fn numbers(&self) -> [u32; 3] {
        [self.size as u32, self.constrained as u32, self.steps as u32]
    }

    /// Whether the bytes of an entry are one of such a table: a checksum tells an accident, not an intention.
    fn holds(&self, entry: &[u8]) -> bool {
        let bits = (self.constrained * self.size) % 64;
        let beyond = if bits == 0 { 0 } else { u64::MAX << bits };
        let mut reader = Reader(entry);
        let step = reader.u64();
        let last = (0..self.words).map(|_| reader.u64()).last().unwrap_or(0);
        step < self.instants as u64
            && last & beyond == 0
            && (0..self.size * self.size).all(|_| f64::from_bits(reader.u64()).is_finite())
    }
}

/// The table of transitions of a game as bytes.
pub(super) fn write(transitions: &Transitions, game: &Game, cancel: &CancelToken) -> Result<Vec<u8>, Stopped> {
    let shape = Shape::of(game);
    let mut out = Vec::new();
    out.extend_from_slice(MAGIC);
    for number in std::iter::once(FORMAT).chain(shape.numbers()) {
        out.extend_from_slice(&number.to_le_bytes());
    }
    out.extend_from_slice(&(shape.identity.len() as u64).to_le_bytes());
    let count_at = out.len();
    out.extend_from_slice(&[0; 8]);
    out.extend_from_slice(&shape.identity);
    let mut count = 0u64;
    for step in 0..transitions.instants() {
        let table = transitions.step_table(step);
        for (i, key) in table.keys().enumerate() {
            cancel.check()?;
            // Just before an escape a step may overflow. Such entries are no saved table's, and are solved again.
            if !table.matrix(i + 1).iter().all(|x| x.is_finite()) {
                continue;
            }
            count += 1;
            reserve("the table as bytes", &mut out, shape.entry + 8)?;
            out.extend_from_slice(&(step as u64).to_le_bytes());
            key.iter().for_each(|word| out.extend_from_slice(&word.to_le_bytes()));
            for column in table.matrix(i + 1).chunks_exact(padded(shape.size)) {
                column[..shape.size].iter().for_each(|x| out.extend_from_slice(&x.to_le_bytes()));
            }
        }
    }
    out[count_at..count_at + 8].copy_from_slice(&count.to_le_bytes());
    out.extend_from_slice(&checksum(&out).to_le_bytes());
    Ok(out)
}

/// The bytes of the table that begins with these, of a game whose tables hold at most `capacity` bytes.
///
/// # Errors
/// [`TableError`] for a beginning of no table, or of one of another game, format or size: what follows need not be read.
pub(super) fn length(start: &[u8], game: &Game, capacity: usize) -> Result<u64, TableError> {
    let shape = Shape::of(game);
    if start.len() < HEADER || &start[..8] != MAGIC {
        return Err(TableError::Foreign);
    }
    let mut reader = Reader(&start[8..]);
    let format = reader.u32();
    if format != FORMAT {
        return Err(TableError::Format { found: format, expected: FORMAT });
    }
    let numbers = [reader.u32(), reader.u32(), reader.u32()];
    let (identity, count) = (reader.u64(), reader.u64());
    if numbers != shape.numbers() || identity != shape.identity.len() as u64 {
        return Err(TableError::OtherGame);
    }
    // In memory an entry takes more than here.
    let most = capacity / shape.entry;
    if count > most as u64 {
        return Err(TableError::TooMany { found: count, most });
    }
    Ok(HEADER as u64 + identity + count * shape.entry as u64 + 8)
}

/// Hands the entries of a saved table of at most `capacity` bytes to `each`: step, key and padded matrix.
///
/// # Errors
/// [`TableError`] for bytes that are no table, or one of another game, version or format; no entry is handed over then.
pub(super) fn read(
    bytes: &[u8],
    game: &Game,
    capacity: usize,
    cancel: &CancelToken,
    mut each: impl FnMut(usize, &[u64], &[f64]),
) -> Result<(), TableError> {
    if length(bytes, game, capacity)? != bytes.len() as u64 {
        return Err(TableError::Damaged);
    }
    let shape = Shape::of(game);
    let (data, sum) = bytes.split_at(bytes.len() - 8);
    if Reader(sum).u64() != checksum(data) {
        return Err(TableError::Damaged);
    }
    let Some(body) = data[HEADER..].strip_prefix(&shape.identity[..]) else {
        return Err(TableError::OtherGame);
    };
    // Nothing is handed over before all of it is known to be sound.
    for entries in body.chunks(POLL.next_multiple_of(shape.entry)) {
        cancel.check()?;
        if !entries.chunks_exact(shape.entry).all(|entry| shape.holds(entry)) {
            return Err(TableError::Damaged);
        }
    }
    let rows = padded(shape.size);
    let (mut key, mut matrix) = (vec![0; shape.words], zeros("a table", shape.size * rows)?);
    for entry in body.chunks_exact(shape.entry) {
        cancel.check()?;
        let mut reader = Reader(entry);
        let step = reader.u64() as usize;
        key.iter_mut().for_each(|word| *word = reader.u64());
        for column in matrix.chunks_exact_mut(rows) {
            column[..shape.size].iter_mut().for_each(|x| *x = f64::from_bits(reader.u64()));
        }
        each(step, &key, &matrix);
    }
    Ok(())
}

//! Many games of one policy, outcomes only, in lockstep.
//!
//! The trials are cut into chunks of at most [`CHUNK`], fewer in large games, where each trial may need a matrix of its
//! own; a chunk's states fit the second cache, and at each instant the
//! part of the table in use fits the first, while the next instant's is on its way. Chunks are played by a pool of
//! threads made for the call; what a trial does depends on its own row and on nothing else, so the outcomes are the
//! same bits for any number of threads and any way of cutting.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | X(0) | [`Batch::positions`] | initial positions |
//! | ζ, σ | [`Batch::visibility`], [`Batch::capture`] | radii |
//! | max ‖z_i‖ | [`End::diverged`] | whether a trial diverges: [`crate::simulation::divergence`] |
//! | mask, relay, ς | [`Chances`] | what fails, who is told, who is shaken: the draws of a recorded run |
//! | exp(Cδ) | [`crate::policy::Policy`]'s transitions | one N × N matrix per (instant, topology) |
//! | S | [`run_scored`] | how far a trial is from every outcome |

mod agenda;
mod between;
mod chunk;
mod fates;
mod flips;
pub mod games;
mod lineages;
mod noise;
mod scores;
mod trials;

use std::thread::available_parallelism;

use rayon::prelude::*;

use crate::cancel::CancelToken;
use crate::error::RunError;
use crate::game::validation::rule;
use crate::memory;
use crate::policy::{Policy, step_table};
use crate::simd::Width;
use crate::simulation::{Chances, Outcome, Record, Setup, Termination};
use chunk::{Chunk, Worker};
use fates::Played;
pub use lineages::Lineages;
pub use scores::columns;
use tadcore_kernels::ensemble::{block, sweep};

/// Trials of one chunk at most.
pub const CHUNK: usize = 8192;
/// Bytes, at most, of the transitions that the trials of a chunk may need at one instant, if each needs its own.
const CHUNK_BYTES: usize = 64 << 20;
/// Bytes that a thread may need before anything is tabulated.
const THREAD_BYTES: usize = 16 << 20;
/// Addresses that the system's allocator takes for a thread of its own, of which little is touched.
const HEAP_BYTES: usize = 64 << 20;
/// Trials that are checked between two looks at the cancel token.
const CHECKED: usize = 4096;
/// Threads beyond which more would only be started: for each core, and on machines of few.
const THREADS: (usize, usize) = (4, 64);

/// How one trial ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct End {
    /// In which way.
    pub outcome: Outcome,
    /// The grid index.
    pub step: usize,
    /// Whether the game diverged before its end or at it.
    pub diverged: bool,
    /// How long after that instant: 0 unless the game ended at a crossing between two.
    pub after: f64,
    /// Whether a capture radius was entered between two instants, where that was asked for.
    pub passed: bool,
}

/// What is done between instants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Between {
    /// When a trial ends.
    pub termination: Termination,
    /// Whether passes are looked for.
    pub passes: bool,
}

impl Between {
    /// Nothing: termination is tested at instants, and only there.
    pub const NOTHING: Self = Self { termination: Termination::Sampled, passes: false };
}

impl End {
    /// What an end is before its trial is played.
    pub(super) const NOT_PLAYED: Self =
        Self { outcome: Outcome::Timeout, step: 0, diverged: false, after: 0.0, passed: false };
}

/// As a batch has it that does not look for passes.
impl From<&Record> for End {
    fn from(record: &Record) -> Self {
        let (outcome, step, after) = (record.outcome, record.grid_index(), record.after);
        Self { outcome, step, diverged: record.diverged.is_some(), after, passed: false }
    }
}

/// Positions and radii of M games; radii are M rows, or one row shared by all.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    /// Axes.
    pub dim: usize,
    /// M × (n + 2) × dim.
    pub positions: &'a [f64],
    /// M × m or 1 × m.
    pub visibility: &'a [f64],
    /// M × (n + 1) or 1 × (n + 1).
    pub capture: &'a [f64],
}

impl Batch<'_> {
    /// M.
    #[must_use]
    pub fn len(&self, players: usize) -> usize {
        self.positions.len() / (players * self.dim)
    }

    fn position(&self, i: usize, players: usize) -> &[f64] {
        &self.positions[i * players * self.dim..(i + 1) * players * self.dim]
    }

    fn capture_row(&self, i: usize, width: usize) -> &[f64] {
        row(self.capture, width, i)
    }

    fn setup(&self, i: usize, n: usize, m: usize) -> Setup<'_> {
        Setup {
            dim: self.dim,
            positions: self.position(i, n + 2),
            visibility: row(self.visibility, m, i),
            capture: self.capture_row(i, n + 1),
        }
    }
}

/// Row i of `all`, or its only row.
fn row(all: &[f64], width: usize, i: usize) -> &[f64] {
    let i = if all.len() == width { 0 } else { i };
    &all[i * width..(i + 1) * width]
}

/// Plays every game of `batch`; how each ended, in order.
///
/// # Errors
/// [`RunError`] for the first row that breaks a rule, before anything is played, or when the caller cancelled.
pub fn run(policy: &Policy, batch: &Batch, threads: Option<usize>, cancel: &CancelToken) -> Result<Vec<End>, RunError> {
    run_with(policy, batch, Between::NOTHING, None, threads, cancel)
}

/// The same, with more or less done between the instants, and in a world: row i is the trial that is i after the first.
///
/// # Errors
/// As [`run`], and for a world that cannot be accepted.
pub fn run_with(
    policy: &Policy,
    batch: &Batch,
    between: Between,
    chances: Option<Chances>,
    threads: Option<usize>,
    cancel: &CancelToken,
) -> Result<Vec<End>, RunError> {
    if let Some(chances) = chances.filter(|_| between != Between::NOTHING) {
        chances.world.refuse_between()?;
    }
    Ok(checked(policy, batch, between, chances, None, Scored::No, threads, cancel)?.0)
}

/// The same with how far each trial was from every outcome, [`columns`] numbers each: all trials are played to T, and
/// end as by [`run_with`].
///
/// # Errors
/// As [`run_with`].
pub fn run_scored(
    policy: &Policy,
    batch: &Batch,
    chances: Option<Chances>,
    threads: Option<usize>,
    cancel: &CancelToken,
) -> Result<(Vec<End>, Vec<f64>), RunError> {
    checked(policy, batch, Between::NOTHING, chances, None, Scored::Columns, threads, cancel)
}

/// The same for rows that share a past and part ([`Lineages`]), with the course of one score: K + 1 numbers each, of
/// which that at t_k is what the score would be if the game ended there.
///
/// # Errors
/// As [`run_with`], and for lineages or a column that cannot be.
#[allow(clippy::too_many_arguments, reason = "what is played, whose draws, and what is followed")]
pub fn run_courses(
    policy: &Policy,
    batch: &Batch,
    chances: Chances,
    lineages: Lineages,
    column: usize,
    threads: Option<usize>,
    cancel: &CancelToken,
) -> Result<(Vec<End>, Vec<f64>), RunError> {
    let game = policy.game();
    lineages.check(batch.len(game.n() + 2), game.grid().steps())?;
    rule("column", column as f64, column < columns(game.n()), "the number of a score")?;
    let (between, scored) = (Between::NOTHING, Scored::Course(column));
    checked(policy, batch, between, Some(chances), Some(lineages), scored, threads, cancel)
}

/// Which scores are asked for.
#[derive(Clone, Copy)]
enum Scored {
    No,
    /// Of every outcome, at the end.
    Columns,
    /// One, after every instant.
    Course(usize),
}

/// Checks every row, and plays.
#[allow(clippy::too_many_arguments, reason = "what is played, whose draws, and what is asked for")]
fn checked(
    policy: &Policy,
    batch: &Batch,
    between: Between,
    chances: Option<Chances>,
    lineages: Option<Lineages>,
    scored: Scored,
    threads: Option<usize>,
    cancel: &CancelToken,
) -> Result<(Vec<End>, Vec<f64>), RunError> {
    let (n, m) = (policy.game().n(), policy.game().constrained());
    let trials = batch.len(n + 2);
    let conditions = chances.map(|chances| chances.conditions(policy.game(), trials as u64)).transpose()?;
    let played = chances.zip(conditions.as_ref()).map(|(chances, conditions)| Played { chances, conditions, lineages });
    for i in 0..trials {
        if i % CHECKED == 0 {
            cancel.check()?;
        }
        batch.setup(i, n, m).check(policy.game())?;
    }
    let (mut ends, mut scores) = (Vec::new(), Vec::new());
    memory::grow("the outcomes of a batch", &mut ends, trials, End::NOT_PLAYED)?;
    let (width, course) = match scored {
        Scored::No => (0, None),
        Scored::Columns => (columns(n), None),
        Scored::Course(column) => (policy.game().grid().steps() + 1, Some(column)),
    };
    memory::grow("the scores of a batch", &mut scores, trials.saturating_mul(width), 0.0)?;
    let threads = threads_for(threads, trials.div_ceil(block::BLOCK))?;
    let answers = Answers { ends: &mut ends, scores: &mut scores, course };
    play(policy, batch, played.as_ref(), between, threads, Width::in_use(), answers, cancel)?;
    Ok((ends, scores))
}

/// How many threads to start where so many could have work, and fewer where the process may not have the memory for
/// them: what is small is allocated by calls that end the process where they fail, and does not come to that.
fn threads_for(threads: Option<usize>, work: usize) -> Result<usize, RunError> {
    let cores = available_parallelism().map_or(1, usize::from);
    let threads = threads.filter(|&t| t > 0).unwrap_or(cores).min(THREADS.1.max(THREADS.0 * cores));
    let threads = threads.min(work).max(1);
    // Stacks, chunks and what the allocator keeps for each thread: asked for together, and given back.
    let room = |threads: usize| {
        let heaps = if threads > 1 { (threads + 1) * HEAP_BYTES } else { 0 };
        memory::reserve_exact("the threads of a batch", &mut Vec::<u8>::new(), (threads + 1) * THREAD_BYTES + heaps)
    };
    let threads = (2..=threads).rev().find(|&t| room(t).is_ok()).unwrap_or(1);
    room(threads)?;
    Ok(threads)
}

/// Trials of one chunk at most in a game of N = `size`.
fn most_trials(size: usize) -> usize {
    (CHUNK_BYTES / (size_of::<f64>() * size * step_table::padded(size))).clamp(block::BLOCK, CHUNK)
}

/// Where the ends of trials are written, and their scores; no scores where none are asked for.
struct Answers<'a> {
    ends: &'a mut [End],
    scores: &'a mut [f64],
    /// The score that is followed, if one is.
    course: Option<usize>,
}

impl<'a> Answers<'a> {
    /// Those of chunks of so many trials.
    fn cut(self, size: usize) -> Vec<Self> {
        let columns = self.scores.len() / self.ends.len().max(1);
        let mut rest = self.scores;
        let of_chunk = |ends: &'a mut [End]| {
            let (scores, others) = std::mem::take(&mut rest).split_at_mut(columns * ends.len());
            rest = others;
            Self { ends, scores, course: self.course }
        };
        self.ends.chunks_mut(size).map(of_chunk).collect()
    }
}

/// Plays checked trials in chunks.
#[allow(clippy::too_many_arguments, reason = "what is played, how, and where the ends go")]
fn play(
    policy: &Policy,
    batch: &Batch,
    played: Option<&Played>,
    between: Between,
    threads: usize,
    width: Width,
    answers: Answers,
    cancel: &CancelToken,
) -> Result<(), RunError> {
    let trials = answers.ends.len();
    // No thread without a block of trials; equal chunks, as many for each thread.
    let threads = threads.min(trials.div_ceil(block::BLOCK)).max(1);
    let most = most_trials(policy.game().size());
    let rounds = trials.div_ceil(threads.saturating_mul(most)).max(1);
    let size = trials.div_ceil(threads.saturating_mul(rounds)).max(1);
    let chunks = answers.cut(size);
    let one = |worker: &mut Worker, (c, answers): (usize, Answers)| {
        let mut chunk = Chunk::new(policy, batch, played, c * size, answers.ends.len(), width)?;
        chunk.play(between, answers, worker, cancel)
    };
    if threads == 1 || chunks.len() <= 1 {
        let mut worker = Worker::new(policy);
        chunks.into_iter().enumerate().try_for_each(|chunk| one(&mut worker, chunk))?;
        return Ok(());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|_| RunError::Threads(threads))?;
    pool.install(|| chunks.into_par_iter().enumerate().try_for_each_init(|| Worker::new(policy), one))?;
    Ok(())
}

#[cfg(test)]
mod sweep_tests;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::game::{Interaction, bank};
    use crate::policy::DEFAULT_TABLE_BYTES;

    /// Plain arrays, AVX2 and AVX-512 end every trial alike and ask for the same entries.
    #[test]
    fn widths_agree_to_the_bit() {
        let start = bank::paper_i1_limited();
        let cancel = CancelToken::new();
        for interaction in [Interaction::I1, Interaction::I2] {
            for n in [1, 2, 3, 5] {
                // Short enough for an equilibrium with five defenders in I2, which escapes at 0.31.
                let game = bank::unit_game(interaction, vec![1.0; n], 1.2, 0.8, 1.0, 0.3, 0.001).expect("a valid game");
                let (visibility, capture) = (vec![1.5; game.constrained()], vec![start.capture[0]; n + 1]);
                let positions: Vec<f64> = (0..50 * (n + 2) * 2).map(|i| 3.0 * (1.7 * i as f64).sin()).collect();
                let batch = Batch { dim: 2, positions: &positions, visibility: &visibility, capture: &capture };
                let played = Width::all().into_iter().map(|width| {
                    let policy = Policy::new(game.clone(), DEFAULT_TABLE_BYTES, &cancel).expect("an equilibrium");
                    let mut ends = vec![End::NOT_PLAYED; 50];
                    let answers = Answers { ends: &mut ends, scores: &mut [], course: None };
                    play(&policy, &batch, None, Between::NOTHING, 1, width, answers, &cancel).expect("a batch");
                    (ends, policy.save_transitions(&cancel).expect("memory"))
                });
                let played: Vec<_> = played.collect();
                assert!(played.windows(2).all(|pair| pair[0] == pair[1]), "{interaction:?} {n}");
            }
        }
    }

    /// The same in worlds in which everything happens, or only some of it: failures, links with and without reaches,
    /// disturbances; and every trial ends as its recorded run.
    #[test]
    fn widths_agree_to_the_bit_in_a_world() {
        use crate::network::Frame;
        use crate::random::Begin;
        use crate::simulation::{Communication, Rules, World, simulate_with};
        let cancel = CancelToken::new();
        for (interaction, n, dim) in [
            (Interaction::I1, 2, 2),
            (Interaction::I1, 3, 2),
            (Interaction::I1, 3, 3),
            (Interaction::I2, 1, 3),
            (Interaction::I2, 2, 2),
            (Interaction::I2, 3, 2),
            (Interaction::I1, 9, 2),
            (Interaction::I1, 2, 4),
        ] {
            let trials = if n > 8 { 9 } else { 150 };
            let game = bank::unit_game(interaction, vec![1.0; n], 1.2, 0.8, 1.0, 0.2, 0.005).expect("a valid game");
            let m = game.constrained();
            let never = vec![f64::INFINITY; m];
            let talk = Communication {
                radius: (0..m).map(|i| (i > 0).then_some(1.5 + i as f64)).collect(),
                relays: Some(1),
                frame: Frame::Common,
                mean_time_up: vec![0.2; m],
                mean_time_down: vec![0.1; m],
                begin: Begin::Up,
            };
            let all = World {
                mean_time_to_failure: vec![0.3; m],
                mean_time_to_repair: vec![0.1; m],
                mean_time_detected: vec![0.2; m],
                mean_time_missed: vec![0.02; m],
                begin: vec![Begin::Stationary; m],
                communication: Some(talk.clone()),
                disturbance: (0..n + 2).map(|p| if p == 1 { 0.0 } else { 0.3 }).collect(),
            };
            let failing = World { communication: None, disturbance: vec![0.0; n + 2], ..all.clone() };
            let shaken = World {
                mean_time_to_failure: never.clone(),
                mean_time_detected: never.clone(),
                disturbance: vec![0.3; n + 2],
                ..failing.clone()
            };
            let told = |talk| World { communication: Some(talk), disturbance: vec![0.0; n + 2], ..shaken.clone() };
            let near = told(Communication { mean_time_up: never.clone(), ..talk.clone() });
            let everywhere = told(Communication { radius: vec![Some(f64::INFINITY); m], ..talk });
            for (which, world) in [all, failing, shaken, near, everywhere].iter().enumerate() {
                let chances = Chances { world, seed: 11, trial: (1 << 32) - 20 };
                let conditions = chances.conditions(&game, trials as u64).expect("a valid world");
                let (visibility, capture) = (vec![1.5; m], vec![0.1; n + 1]);
                let positions: Vec<f64> = (0..trials * (n + 2) * dim).map(|i| 3.0 * (1.7 * i as f64).sin()).collect();
                let batch = Batch { dim, positions: &positions, visibility: &visibility, capture: &capture };
                let played = Width::all().into_iter().map(|width| {
                    let policy = Policy::new(game.clone(), DEFAULT_TABLE_BYTES, &cancel).expect("an equilibrium");
                    let mut ends = vec![End::NOT_PLAYED; trials];
                    let played = Some(Played { chances, conditions: &conditions, lineages: None });
                    let answers = Answers { ends: &mut ends, scores: &mut [], course: None };
                    play(&policy, &batch, played.as_ref(), Between::NOTHING, 1, width, answers, &cancel)
                        .expect("a batch");
                    let table = policy.save_transitions(&cancel).expect("memory");
                    let (mut scored, mut scores) = (vec![End::NOT_PLAYED; trials], vec![0.0; trials * columns(n)]);
                    let answers = Answers { ends: &mut scored, scores: &mut scores, course: None };
                    play(&policy, &batch, played.as_ref(), Between::NOTHING, 1, width, answers, &cancel)
                        .expect("scores");
                    assert_eq!(ends, scored, "{interaction:?} {n} {dim} {which}");
                    let scores: Vec<u64> = scores.into_iter().map(f64::to_bits).collect();
                    (ends, table, scores)
                });
                let played: Vec<_> = played.collect();
                assert!(played.windows(2).all(|pair| pair[0] == pair[1]), "{interaction:?} {n} {dim} {which}");
                let policy = Policy::new(game.clone(), DEFAULT_TABLE_BYTES, &cancel).expect("an equilibrium");
                for i in (0..trials).step_by(29) {
                    let of_trial = Chances { trial: chances.trial + i as u64, ..chances };
                    let rules = Rules { chances: Some(of_trial), ..Rules::default() };
                    let record = simulate_with(&policy, &batch.setup(i, n, m), rules, &cancel).expect("a run");
                    assert_eq!(played[0].0[i], End::from(&record), "{interaction:?} {n} {dim} {which} {i}");
                }
            }
        }
    }
}

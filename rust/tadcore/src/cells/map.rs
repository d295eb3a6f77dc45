//! The cells of a map: which are to come, which are settled, and which are cut in four.

use rayon::prelude::*;

use super::cell::{Cell, Fate, Origin};
use super::chunk::Worker;
use super::enclosure::{Enclosure, Half};
use super::guards::Radii;
use super::{Leaf, Region, Verdict};
use crate::cancel::CancelToken;
use crate::error::{GameError, RunError};
use crate::game::validation::{FINEST, rule};
use crate::memory;
use crate::policy::{Policy, step_table};
use crate::simulation::{Setup, relative_state};

/// What asks for memory here.
const WHAT: &str = "the cells of a certified map";
/// Cells of one chunk: enough that they share what they read of a table, few enough for all threads to have some.
const CHUNK: usize = 128;
/// Cells along the longer side of the region at which forks begin: larger ones are cut instead.
const FORKS_FROM: u64 = 32;
/// Levels of cutting, at most.
const MOST_LEVELS: u32 = 30;
/// Cells along the longer side at the beginning, at most: no cell of the first level is longer than it is high.
const MOST_FIRST: f64 = 64.0;

/// A cell to come, and the states that it shares with the other parts of the cell it was cut from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) column: u64,
    pub(super) row: u64,
    pub(super) origin: usize,
}

/// A map in the making.
#[derive(Debug)]
pub struct Map {
    pub(super) player: usize,
    low: [f64; 2],
    high: [f64; 2],
    pub(super) radii: Radii,
    /// Cells of the first level on each axis.
    first: [u64; 2],
    /// The least side of a cell.
    resolution: f64,
    /// Cells that may still be looked at.
    budget: usize,
    pub(super) level: u32,
    /// Cells of this level, and how many of them were looked at.
    places: Vec<Place>,
    begun: usize,
    /// Where they begin, and the middle of the cell that each was noted for.
    origins: Vec<([f64; 2], Origin)>,
    next: Vec<Place>,
    next_origins: Vec<([f64; 2], Origin)>,
    leaves: Vec<Leaf>,
    /// Cells looked at.
    cells: u64,
    /// Steps of their histories.
    steps: u64,
}

impl Map {
    /// The map of a region that has not begun: cells down to a side of `resolution`, `budget` of them at most.
    ///
    /// # Errors
    /// [`RunError`] for a region that cannot be mapped: bad positions or radii, more than the plane, no such player, an
    /// empty range, a resolution that is not positive.
    pub fn new(policy: &Policy, region: &Region, resolution: f64, budget: usize) -> Result<Self, RunError> {
        let game = policy.game();
        let Region { setup, player, low, high } = *region;
        rule("dim", setup.dim as f64, setup.dim == 2, "2: cells are boxes in the plane")?;
        rule("player", player as f64, player < game.n() + 2, "the number of a player")?;
        for (field, x) in [("x", 0), ("y", 1)] {
            rule(field, high[x] - low[x], high[x] > low[x], "a range (low, high) with low < high")?;
        }
        rule("resolution", resolution, resolution > 0.0 && resolution.is_finite(), "a positive finite number")?;
        let far = [low, high].as_flattened().iter().fold(0.0, |far: f64, x| far.max(x.abs()));
        rule("resolution", resolution, resolution >= FINEST * far, "at least 1e-12 of the largest coordinate")?;
        // What a setup must obey are bounds on distances, which are largest at a corner.
        for corner in [low, high, [low[0], high[1]], [high[0], low[1]]] {
            let mut positions = setup.positions.to_vec();
            let Some(place) = positions.get_mut(2 * player..2 * player + 2) else {
                let found = setup.positions.len();
                return Err(GameError::Length { field: "positions", found, expected: 2 * (game.n() + 2) }.into());
            };
            place.copy_from_slice(&corner);
            Setup { positions: &positions, ..setup }.check(game)?;
        }
        let sides = [high[0] - low[0], high[1] - low[1]];
        let short = sides[0].min(sides[1]);
        let first = sides.map(|side| (side / short).round().clamp(1.0, MOST_FIRST) as u64);
        let mut map = Self {
            player,
            low,
            high,
            radii: Radii::new(setup.visibility, setup.capture),
            first,
            resolution,
            budget,
            level: 0,
            places: Vec::new(),
            begun: 0,
            origins: Vec::new(),
            next: Vec::new(),
            next_origins: Vec::new(),
            leaves: Vec::new(),
            cells: 0,
            steps: 0,
        };
        for row in 0..first[1] {
            for column in 0..first[0] {
                let origin = map.origins.len();
                let (low, high) = map.bounds(column, row, 0);
                let (middle, half) = middle(low, high);
                map.origins.push((middle, map.start(&setup, middle, half)));
                map.places.push(Place { column, row, origin });
            }
        }
        map.afford()?;
        Ok(map)
    }

    /// The settled cells so far.
    #[must_use]
    pub fn leaves(&self) -> &[Leaf] {
        &self.leaves
    }

    /// Whether every cell is settled.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.places.is_empty()
    }

    /// Cells looked at so far, and steps of their histories.
    #[must_use]
    pub fn counts(&self) -> (u64, u64) {
        (self.cells, self.steps)
    }

    /// The states of a first cell at the start.
    pub(super) fn start(&self, setup: &Setup, middle: [f64; 2], half: Half) -> Origin {
        let size = setup.positions.len() / 2 - 1;
        let mut positions = setup.positions.to_vec();
        positions[2 * self.player..][..2].copy_from_slice(&middle);
        let mut z = Vec::new();
        relative_state(&positions, 2, &mut z);
        let axis = |x: usize| -> Vec<f64> { z.iter().skip(x).step_by(2).copied().collect() };
        let slope: Vec<f64> =
            (0..size).map(|i| if self.player == size { -1.0 } else { f64::from(u8::from(i == self.player)) }).collect();
        let states = Enclosure::start(size, step_table::padded(size), [&axis(0), &axis(1)], &slope, half);
        Origin { step: 0, limits: (f64::INFINITY, f64::INFINITY), states }
    }

    /// The bounds of a cell: those that two cells share are the same numbers on every level.
    pub(super) fn bounds(&self, column: u64, row: u64, level: u32) -> ([f64; 2], [f64; 2]) {
        let edge = |x: usize, i: u64| {
            let count = self.first[x] << level;
            let (low, high) = (self.low[x], self.high[x]);
            if i == count { high } else { (low + (high - low) * (i as f64 / count as f64)).min(high) }
        };
        ([edge(0, column), edge(1, row)], [edge(0, column + 1), edge(1, row + 1)])
    }

    /// Takes the cells of a level that has begun out of the budget, and settles those that it does not cover: spread
    /// over the region.
    fn afford(&mut self) -> Result<(), RunError> {
        let over = self.places.len().saturating_sub(self.budget);
        if over > 0 {
            let spread = |place: &Place| {
                (place.column << 32 ^ place.row)
                    .wrapping_mul(0x9E37_79B9_7F4A_7C15)
                    .rotate_left(29)
                    .wrapping_mul(0xBF58_476D_1CE4_E5B9)
            };
            self.places.sort_by_key(spread);
            memory::reserve(WHAT, &mut self.leaves, over)?;
            for place in self.places.split_off(self.budget) {
                let (low, high) = self.bounds(place.column, place.row, self.level);
                self.leaves.push(Leaf { low, high, level: self.level, verdict: Verdict::Budget });
            }
        }
        self.budget -= self.places.len();
        Ok(())
    }

    /// Looks at some of the cells to come, at most `cells`; says how many. Cancelled, it is as before.
    ///
    /// # Errors
    /// [`RunError`] when there is no memory or no thread, or `cancel` was raised.
    pub fn advance(
        &mut self,
        policy: &Policy,
        cells: usize,
        threads: Option<usize>,
        cancel: &CancelToken,
    ) -> Result<usize, RunError> {
        let until = self.places.len().min(self.begun.saturating_add(cells.max(1)));
        let some = &self.places[self.begun..until];
        let size = some.len().div_ceil(2 * threads_for(threads)).clamp(1, CHUNK);
        let threads = threads_for(threads).min(some.len().div_ceil(size)).max(1);
        let one = |worker: &mut Worker, places: &[Place]| self.play(policy, places, worker, cancel);
        let played: Vec<Played> = if threads == 1 {
            let mut worker = Worker::new(policy);
            some.chunks(size).map(|places| one(&mut worker, places)).collect::<Result<_, _>>()?
        } else {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.map_err(|_| RunError::Threads(threads))?;
            pool.install(|| {
                some.par_chunks(size).map_init(|| Worker::new(policy), one).collect::<Result<_, RunError>>()
            })?
        };
        let done = some.len();
        memory::reserve(WHAT, &mut self.leaves, played.iter().map(|p| p.leaves.len()).sum())?;
        let parents: usize = played.iter().map(|p| p.parents.len()).sum();
        memory::reserve(WHAT, &mut self.next, 4 * parents)?;
        memory::reserve(WHAT, &mut self.next_origins, parents)?;
        for Played { leaves, parents, steps } in played {
            self.leaves.extend(leaves);
            self.steps += steps;
            for (place, middle, origin) in parents {
                let index = self.next_origins.len();
                self.next_origins.push((middle, origin));
                for (right, up) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let (column, row) = (2 * place.column + right, 2 * place.row + up);
                    self.next.push(Place { column, row, origin: index });
                }
            }
        }
        self.begun = until;
        self.cells += done as u64;
        if self.begun == self.places.len() {
            self.begun = 0;
            self.places = std::mem::take(&mut self.next);
            self.origins = std::mem::take(&mut self.next_origins);
            self.level += 1;
            self.afford()?;
        }
        Ok(done)
    }

    /// Steps some cells to their ends.
    fn play(
        &self,
        policy: &Policy,
        places: &[Place],
        worker: &mut Worker,
        cancel: &CancelToken,
    ) -> Result<Played, RunError> {
        memory::spare(WHAT)?;
        let along = self.first[0].max(self.first[1]) << self.level;
        let (mut cells, mut boxes) = (Vec::new(), Vec::new());
        for place in places {
            let (low, high) = self.bounds(place.column, place.row, self.level);
            let (middle, half) = middle(low, high);
            let (from, origin) = &self.origins[place.origin];
            let offset = [middle[0] - from[0], middle[1] - from[1]];
            cells.push(Cell::new(origin, offset, half, along >= FORKS_FROM));
            boxes.push((low, high, middle));
        }
        let fates = worker.play(policy, &self.radii, &mut cells, cancel)?;
        let mut played = Played { leaves: Vec::new(), parents: Vec::new(), steps: 0 };
        for (((fate, cell), &place), (low, high, middle)) in fates.into_iter().zip(cells).zip(places).zip(boxes) {
            played.steps += cell.steps;
            // A part must be worth looking at, and have a middle of its own.
            let parts = [0, 1].map(|x| 0.5 * (high[x] - low[x]));
            let cut = parts.iter().all(|&part| part >= self.resolution) && self.level + 1 < MOST_LEVELS;
            let verdict = match (fate, cell.origin) {
                (Fate::Proved(outcome), _) => Verdict::Proved(outcome),
                (Fate::Diverges, _) => Verdict::Diverges,
                (Fate::Open, Some(origin)) if cut => {
                    played.parents.push((place, middle, origin));
                    continue;
                }
                (Fate::Open, _) => Verdict::Fine,
            };
            played.leaves.push(Leaf { low, high, level: self.level, verdict });
        }
        Ok(played)
    }
}

/// What came of some cells.
struct Played {
    leaves: Vec<Leaf>,
    /// Cells to cut, their middles, and where their parts begin.
    parents: Vec<(Place, [f64; 2], Origin)>,
    steps: u64,
}

/// The middle of a box, and how far its starts lie from it at most.
pub(super) fn middle(low: [f64; 2], high: [f64; 2]) -> ([f64; 2], Half) {
    let middle = [0, 1].map(|x| 0.5 * (low[x] + high[x]));
    let half = [0, 1].map(|x| (high[x] - middle[x]).max(middle[x] - low[x]).next_up());
    (middle, half)
}

/// Threads to start.
fn threads_for(threads: Option<usize>) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    threads.filter(|&t| t > 0).unwrap_or(cores).min(4 * cores.max(16))
}

//! Lists of descents, what belongs to each, and what it reached.

use super::variables::Variable;
use crate::error::NoMemory;
use crate::memory;

/// How a minimisation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Status {
    /// The relative gradient norm fell below the tolerance.
    Converged,
    /// Rounding stopped the progress above the tolerance.
    #[default]
    Stalled,
    /// The iteration limit was met.
    IterationLimit,
}

impl Status {
    /// A word for each status.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stalled => "stalled",
            Self::IterationLimit => "iteration_limit",
        }
    }
}

/// When to stop, and how far one step may go.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    pub iterations: usize,
    /// Relative gradient norm aimed at.
    pub tolerance: f64,
    /// Relative gradient norm that counts as converged when rounding stops the progress.
    pub acceptable: f64,
    /// Longest step, `f64::INFINITY` for none.
    pub longest: f64,
}

/// What a minimisation reached.
#[derive(Debug, Clone, Copy, Default)]
pub struct Reached {
    pub value: f64,
    pub gradient_norm: f64,
    /// What the gradient's norm is relative to.
    pub scale: f64,
    pub iterations: usize,
    pub status: Status,
}

impl Reached {
    pub fn new(value: f64, slope: f64, scale: f64, iterations: usize, limits: &Limits) -> Self {
        let relative = if slope == 0.0 { 0.0 } else { slope / scale };
        let status = match (relative <= limits.acceptable, iterations >= limits.iterations) {
            (true, _) => Status::Converged,
            (false, true) => Status::IterationLimit,
            (false, false) => Status::Stalled,
        };
        Self { value, gradient_norm: relative, scale, iterations, status }
    }
}

/// The best point known: a descent that only leads back to it, or cannot get below it, need not be finished.
#[derive(Debug, Clone, Copy)]
pub struct Incumbent<'a> {
    pub g: &'a [f64],
    pub value: f64,
    /// Distance at which a descent has come back to it.
    pub near: f64,
}

/// Whom descents belong to: a network with its variables.
#[derive(Debug, Clone, Copy)]
pub struct Owner<'a> {
    pub variables: &'a [Variable],
    pub incumbent: Option<Incumbent<'a>>,
}

/// Descents to be made: where they start and, later, where they ended.
#[derive(Debug, Default)]
pub struct Tasks {
    /// Entries of one network's gains, mN.
    width: usize,
    /// Entries of a point: `width`, or twice as many.
    length: usize,
    points: Vec<f64>,
    /// The owner, and for doubled gains whether they are complex and the scale of their gradient.
    whose: Vec<(usize, bool, f64)>,
    reached: Vec<Reached>,
    certified: Vec<bool>,
    /// Whether a descent ended because it cannot get below its incumbent.
    pruned: Vec<bool>,
}

impl Tasks {
    /// Empties the list for points of `copies` times `width` entries.
    pub fn clear(&mut self, width: usize, copies: usize) {
        (self.width, self.length) = (width, copies * width);
        self.points.clear();
        self.whose.clear();
        self.reached.clear();
        self.certified.clear();
        self.pruned.clear();
    }

    /// Adds a descent of `owner`'s, and gives its start to be written.
    pub fn add(&mut self, owner: usize, complex: bool, scale: f64) -> Result<&mut [f64], NoMemory> {
        let from = self.points.len();
        memory::reserve("the starting points of one search", &mut self.points, self.length)?;
        self.points.resize(from + self.length, 0.0);
        self.whose.push((owner, complex, scale));
        self.reached.push(Reached::default());
        self.certified.push(false);
        self.pruned.push(false);
        Ok(&mut self.points[from..])
    }

    pub fn len(&self) -> usize {
        self.whose.len()
    }

    pub fn width(&self) -> usize {
        self.width
    }

    pub fn owner(&self, task: usize) -> usize {
        self.whose[task].0
    }

    /// Whether the gains are complex, and the scale of their gradient.
    pub fn kind(&self, task: usize) -> (bool, f64) {
        (self.whose[task].1, self.whose[task].2)
    }

    pub fn point(&self, task: usize) -> &[f64] {
        &self.points[task * self.length..][..self.length]
    }

    pub fn point_mut(&mut self, task: usize) -> &mut [f64] {
        &mut self.points[task * self.length..][..self.length]
    }

    pub fn end(&mut self, task: usize, reached: Reached, pruned: bool) {
        (self.reached[task], self.pruned[task]) = (reached, pruned);
    }

    pub fn pruned(&self, task: usize) -> bool {
        self.pruned[task]
    }

    /// Drops the descents that `keep` does not name; none of them has been made.
    pub fn retain(&mut self, keep: &[bool]) {
        let mut kept = 0;
        for task in (0..keep.len()).filter(|&task| keep[task]) {
            self.whose[kept] = self.whose[task];
            self.points.copy_within(task * self.length..(task + 1) * self.length, kept * self.length);
            kept += 1;
        }
        self.points.truncate(kept * self.length);
        self.whose.truncate(kept);
        self.reached.truncate(kept);
        self.certified.truncate(kept);
        self.pruned.truncate(kept);
    }

    pub fn reached(&self, task: usize) -> Reached {
        self.reached[task]
    }

    pub fn certify(&mut self, task: usize) {
        self.certified[task] = true;
    }

    pub fn certified(&self, task: usize) -> bool {
        self.certified[task]
    }
}

//! Whose draws each row of a batch has from which step on: paths that share a past and part.
//!
//! A row with the stretches (0, t₀), (k₁, t₁), … is shaken after the steps from k ≥ k_i on as trial t_i is, up to the next
//! stretch; and what would flip after t_{k_i} flips by the numbers of t_i: whether a chain is up at t_{k_i} stays as it
//! is, and how long it stays so is drawn again, which is its law since holding times are memoryless. So two rows that
//! differ from their second stretch on are bitwise alike up to z(t_{k₁}), and independent after that.

use crate::error::GameError;
use crate::game::validation::rule;
use crate::random::TRIALS;

/// The stretches of all rows, one row after another.
#[derive(Debug, Clone, Copy)]
pub struct Lineages<'a> {
    /// Where the stretches of each row begin, and where those of the last one end: M + 1 numbers.
    pub offsets: &'a [usize],
    /// The steps from which they hold: 0, then no lower than the one before.
    pub steps: &'a [usize],
    /// The trials.
    pub trials: &'a [u64],
}

impl<'a> Lineages<'a> {
    /// Checks that these are the stretches of so many rows on a grid of so many steps.
    ///
    /// # Errors
    /// [`GameError`] naming the first number that cannot be.
    pub fn check(&self, rows: usize, steps: usize) -> Result<(), GameError> {
        for (field, found, expected) in
            [("offsets", self.offsets.len(), rows + 1), ("trials", self.trials.len(), self.steps.len())]
        {
            if found != expected {
                return Err(GameError::Length { field, found, expected });
            }
        }
        let last = self.offsets.last().copied().unwrap_or(0);
        let rising = self.offsets.windows(2).all(|ends| ends[0] < ends[1]) && self.offsets.first() == Some(&0);
        rule("offsets", last as f64, rising && last == self.steps.len(), "rising from 0 to the number of stretches")?;
        for row in 0..rows {
            let own = &self.steps[self.offsets[row]..self.offsets[row + 1]];
            let bad = own[0] != 0 || own.windows(2).any(|pair| pair[1] < pair[0]) || own.iter().any(|&k| k >= steps);
            let words = "0 first, then steps of the grid, none before the one before it";
            rule(&format!("steps of row {row}"), own[own.len() - 1] as f64, !bad, words)?;
        }
        let largest = self.trials.iter().copied().max().unwrap_or(0);
        rule("trials", largest as f64, largest < TRIALS, "below 2^56")
    }

    /// The stretches of one row.
    fn of(&self, row: usize) -> impl Iterator<Item = (usize, u64)> + use<'a> {
        let range = self.offsets[row]..self.offsets[row + 1];
        self.steps[range.clone()].iter().copied().zip(self.trials[range].iter().copied())
    }
}

/// The trial whose draws each row of a chunk has now.
pub(super) struct Numbers {
    /// That of row 0, where every row has the next.
    first: u64,
    /// Of each row, where they part.
    own: Vec<u64>,
    /// Steps at which rows part, the rows and their trials from there on; the next at the end.
    parting: Vec<(usize, usize, u64)>,
}

impl Numbers {
    /// Those of the rows from `first_row` on; the trials from `first` on, where there are no stretches.
    pub(super) fn new(first: u64, lineages: Option<Lineages>, first_row: usize, rows: usize) -> Self {
        let (mut own, mut parting) = (Vec::new(), Vec::new());
        if let Some(lineages) = lineages {
            for row in 0..rows {
                for (i, (k, trial)) in lineages.of(first_row + row).enumerate() {
                    if i == 0 {
                        own.push(trial);
                    } else {
                        parting.push((k, row, trial));
                    }
                }
            }
            // Stable: of two stretches of a row from one step on, the later one holds.
            parting.sort_by_key(|&(k, row, _)| (k, row));
            parting.reverse();
        }
        Self { first, own, parting }
    }

    /// The trial of a row.
    #[inline]
    pub(super) fn of(&self, row: u64) -> u64 {
        if self.own.is_empty() { self.first + row } else { self.own[row as usize] }
    }

    /// Those of many rows.
    pub(super) fn of_all(&self, rows: &[u32], trials: &mut [u64]) {
        for (trial, &row) in trials.iter_mut().zip(rows) {
            *trial = if self.own.is_empty() { self.first + u64::from(row) } else { self.own[row as usize] };
        }
    }

    /// Whether rows may part.
    pub(super) fn part(&self) -> bool {
        !self.own.is_empty()
    }

    /// The rows that have other draws from step k on; takes them over.
    pub(super) fn turn(&mut self, k: usize) -> Vec<usize> {
        let mut rows = Vec::new();
        while let Some(&(_, row, trial)) = self.parting.last().filter(|&&(step, ..)| step <= k) {
            self.own[row] = trial;
            if rows.last() != Some(&row) {
                rows.push(row);
            }
            self.parting.pop();
        }
        rows
    }
}

//! Cells in lockstep: all that are stepped stand at the same grid instant, and share its table.

use super::cell::{Cell, Fate, Scratch};
use super::guards::Radii;
use crate::cancel::CancelToken;
use crate::error::RunError;
use crate::network::Topology;
use crate::policy::Policy;
use crate::policy::filler::Filler;
use crate::policy::step_table::StepTable;

/// The scratch of one worker, reused from chunk to chunk.
pub(super) struct Worker {
    filler: Filler,
    local: StepTable,
    missing: Vec<Topology>,
    waiting: Vec<usize>,
    scratch: Scratch,
}

impl Worker {
    pub(super) fn new(policy: &Policy) -> Self {
        let (rows, size) = (policy.game().constrained(), policy.game().size());
        let (missing, waiting) = (Vec::new(), Vec::new());
        let local = StepTable::new(rows, size);
        Self { filler: Filler::default(), local, missing, waiting, scratch: Scratch::default() }
    }

    /// Steps every cell to its end.
    pub(super) fn play(
        &mut self,
        policy: &Policy,
        radii: &Radii,
        cells: &mut [Cell],
        cancel: &CancelToken,
    ) -> Result<Vec<Fate>, RunError> {
        let last = policy.game().grid().steps();
        let (rows, size) = (policy.game().constrained(), policy.game().size());
        let mut fates = vec![None; cells.len()];
        let first = cells.iter().map(Cell::begin).min().unwrap_or(last);
        for k in first..=last {
            cancel.check()?;
            self.missing.clear();
            self.waiting.clear();
            let mut left = false;
            {
                let table = (k < last).then(|| policy.transitions().step_table(k));
                for (index, (cell, fate)) in cells.iter_mut().zip(&mut fates).enumerate() {
                    if fate.is_some() || cell.begin() > k {
                        left |= fate.is_none();
                        continue;
                    }
                    *fate = cell.look(k, k == last, radii, &mut self.scratch);
                    let (None, Some(table)) = (&*fate, &table) else { continue };
                    left = true;
                    if cell.networks(&mut self.scratch, |words| table.find(words) != 0) {
                        cell.step(k, &mut self.scratch, |words| table.matrix(table.find(words) as usize));
                        continue;
                    }
                    self.waiting.push(index);
                    let missing = &mut self.missing;
                    cell.networks(&mut self.scratch, |words| {
                        if table.find(words) == 0 {
                            missing.push(Topology::from_words(rows, size, words));
                        }
                        true
                    });
                }
            }
            if !self.waiting.is_empty() {
                self.follow(policy, radii, k, cells, cancel)?;
            }
            if !left {
                break;
            }
        }
        Ok(fates.into_iter().map(|fate| fate.unwrap_or(Fate::Open)).collect())
    }

    /// Solves what is missing at t_k, and steps the cells that waited for it.
    fn follow(
        &mut self,
        policy: &Policy,
        radii: &Radii,
        k: usize,
        cells: &mut [Cell],
        cancel: &CancelToken,
    ) -> Result<(), RunError> {
        self.missing.sort_unstable();
        self.missing.dedup();
        self.local.clear();
        let solved = self.filler.fill(policy, k, &self.missing, &mut self.local, cancel)?;
        policy.transitions().count((self.missing.len() as u64).max(solved), solved);
        let table = policy.transitions().step_table(k);
        for &index in &self.waiting {
            let cell = &mut cells[index];
            cell.look(k, false, radii, &mut self.scratch);
            cell.step(k, &mut self.scratch, |words| match (table.find(words), self.local.find(words)) {
                (0, slot) => {
                    // Slot 0 holds no matrix: nothing must be proved with it.
                    assert_ne!(slot, 0, "a cell misses what was just solved");
                    self.local.matrix(slot as usize)
                }
                (slot, _) => table.matrix(slot as usize),
            });
        }
        Ok(())
    }
}

//! Scratch that is reused from solve to solve.

use super::layout::{GROUP, Layout, packed};
use crate::cancel::{CancelToken, raised};
use crate::error::{Cancelled, NoMemory, Stopped};
use crate::memory;
use crate::simd::Number;

/// Numbers that are filled between two looks at the cancel token.
const PIECE: usize = 1 << 22;

/// The memory of descents side by side.
#[derive(Debug)]
pub struct Workspace<T: Number> {
    /// The variables of the lanes.
    pub layout: Layout<T>,
    /// The points.
    pub g: Vec<T>,
    /// The gradients there, with respect to all gains.
    pub slope: Vec<T>,
    /// The points tried.
    pub trial: Vec<T>,
    /// The gradients there.
    pub trial_slope: Vec<T>,
    /// The best points known.
    pub incumbent: Vec<T>,
    /// A row of a form on all gains, the form restricted to the variables, and its factor.
    pub row: Vec<T>,
    pub hessian: Vec<T>,
    pub factor: Vec<T>,
    /// The gradient with respect to the variables, the step, and a vector to spare.
    pub gradient: Vec<T>,
    pub step: Vec<T>,
    pub other: Vec<T>,
}

impl<T: Number> Default for Workspace<T> {
    fn default() -> Self {
        let empty = Vec::new;
        Self {
            layout: Layout::default(),
            g: empty(),
            slope: empty(),
            trial: empty(),
            trial_slope: empty(),
            incumbent: empty(),
            row: empty(),
            hessian: empty(),
            factor: empty(),
            gradient: empty(),
            step: empty(),
            other: empty(),
        }
    }
}

impl<T: Number> Workspace<T> {
    /// Makes room for gains of `width` entries, so many of them unknown.
    #[inline(always)]
    pub fn grow(&mut self, width: usize, unknowns: usize) -> Result<(), NoMemory> {
        let unknowns = unknowns.next_multiple_of(GROUP);
        for vector in
            [&mut self.g, &mut self.slope, &mut self.trial, &mut self.trial_slope, &mut self.incumbent, &mut self.row]
        {
            room(vector, width)?;
        }
        for vector in [&mut self.gradient, &mut self.step, &mut self.other] {
            room(vector, unknowns)?;
        }
        Ok(())
    }

    /// Makes room for a Hessian and its factor.
    #[inline(always)]
    pub fn grow_matrices(&mut self, unknowns: usize, cancel: Option<&CancelToken>) -> Result<(), Stopped> {
        let unknowns = unknowns.next_multiple_of(GROUP);
        by_pieces(&mut self.hessian, packed(unknowns), cancel)?;
        by_pieces(&mut self.factor, unknowns * unknowns, cancel)
    }
}

/// The same of what may take a second to be filled.
fn by_pieces<T: Number>(numbers: &mut Vec<T>, len: usize, cancel: Option<&CancelToken>) -> Result<(), Stopped> {
    let more = len.saturating_sub(numbers.len());
    memory::reserve_exact("the synthesis of one network", numbers, more)?;
    while numbers.len() < len {
        if raised(cancel) {
            return Err(Cancelled.into());
        }
        numbers.resize(len.min(numbers.len() + PIECE), T::splat(0.0));
    }
    Ok(())
}

fn room<T: Number>(numbers: &mut Vec<T>, len: usize) -> Result<(), NoMemory> {
    memory::grow("the synthesis of one network", numbers, len, T::splat(0.0))
}

//! Scratch that is reused from solve to solve.

use super::start::Layout;
use crate::lanes::Number;

/// The memory of descents side by side.
#[derive(Debug)]
pub(super) struct Workspace<T: Number> {
    /// The variables of the lanes.
    pub(super) layout: Layout<T>,
    /// The points.
    pub(super) g: Vec<T>,
    /// The gradients there, with respect to all gains.
    pub(super) slope: Vec<T>,
    /// The points tried.
    pub(super) trial: Vec<T>,
    /// The gradients there.
    pub(super) trial_slope: Vec<T>,
    /// The best points known.
    pub(super) rival: Vec<T>,
    /// A form on all gains, then restricted to the variables, then factorised.
    pub(super) form: Vec<T>,
    pub(super) hessian: Vec<T>,
    pub(super) factor: Vec<T>,
    /// The gradient with respect to the variables, the step, and a vector to spare.
    pub(super) gradient: Vec<T>,
    pub(super) step: Vec<T>,
    pub(super) other: Vec<T>,
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
            rival: empty(),
            form: empty(),
            hessian: empty(),
            factor: empty(),
            gradient: empty(),
            step: empty(),
            other: empty(),
        }
    }
}

impl<T: Number> Workspace<T> {
    /// Makes room for gains of `width` entries.
    #[inline(always)]
    pub(super) fn grow(&mut self, width: usize) {
        let vectors = [
            &mut self.g,
            &mut self.slope,
            &mut self.trial,
            &mut self.trial_slope,
            &mut self.rival,
            &mut self.gradient,
            &mut self.step,
            &mut self.other,
        ];
        for vector in vectors {
            if vector.len() < width {
                vector.resize(width, T::splat(0.0));
            }
        }
        for matrix in [&mut self.form, &mut self.hessian, &mut self.factor] {
            if matrix.len() < width * width {
                matrix.resize(width * width, T::splat(0.0));
            }
        }
    }
}

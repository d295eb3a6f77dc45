//! What is minimised: a function of gains by its value, its gradient and its Hessian.

use super::layout::Form;
use crate::simd::Number;

/// A function of gains laid out as one vector of `width` entries, and the form that its Hessian is.
pub trait Objective<T: Number>: Form<T> {
    fn width(&self) -> usize;
    /// Tells a lane which kind of doubled gains it is to hold, and the scale of their gradient.
    fn set_lane(&mut self, _lane: usize, _complex: bool, _scale: f64) {}
    /// The value at `g`; what it computes on the way serves the next gradient and, once kept, the Hessian.
    fn value(&mut self, g: &[T]) -> T;
    /// The gradient at the point last evaluated.
    fn gradient(&mut self, g: &[T], out: &mut [T]);
    /// Keeps the point last evaluated, in these lanes, for the Hessian.
    fn keep(&mut self, lanes: T::Mask);
    /// Prepares for the rows of the Hessian at `g`, the point kept.
    fn prepare(&mut self, g: &[T]);
    /// Size of the parts that cancel in the gradient at the point last evaluated: what its norm is relative to.
    fn gradient_scale(&self, g: &[T]) -> T;
    /// Size of the parts of the value: what its rounding is relative to.
    fn value_scale(&self) -> f64;
}

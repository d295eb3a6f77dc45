//! Numbers side by side: one, or two to sixteen in each vector register, in double or in single precision.
//!
//! What is written once over [`Number`] runs for one problem or for several at a time. Every operation is the IEEE one on
//! each lane, the fused ones too, so a lane gives the bits that the number alone would give. The methods of registers
//! are inlined into functions that are compiled for their instructions; a closure is a function of its own and is not,
//! so kernels over `Number` are plain loops. Without a fused instruction (an x86-64 processor older than 2013) a fused
//! operation is a slow call of the library.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A precision.
pub trait Scalar: Copy + std::fmt::Debug + Mul<Output = Self> + Neg<Output = Self> {
    /// The number, rounded.
    fn of(x: f64) -> Self;
}

/// One number, or several side by side.
pub trait Number:
    Copy
    + std::fmt::Debug
    + Send
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// How many, at most sixteen.
    const LANES: usize;
    /// Whether in single precision.
    const SINGLE: bool;
    /// The precision.
    type Scalar: Scalar;
    /// A yes or no for each lane.
    type Mask: Copy + std::fmt::Debug + Send + 'static;

    /// The same number in all lanes.
    fn all(x: Self::Scalar) -> Self;
    /// The first numbers of a slice, one for each lane.
    fn load(from: &[Self::Scalar]) -> Self;
    /// Writes the first numbers of a slice.
    fn store(self, to: &mut [Self::Scalar]);
    /// The number in one lane.
    fn lane(&self, lane: usize) -> f64;
    /// self + x·y, rounded once.
    fn plus(self, x: Self, y: Self) -> Self;
    /// self − x·y, rounded once.
    fn minus(self, x: Self, y: Self) -> Self;
    fn sqrt(self) -> Self;
    fn abs(self) -> Self;
    /// Where a < b; no where one is no number.
    fn less(self, other: Self) -> Self::Mask;
    /// Where a ≤ b; no where one is no number.
    fn at_most(self, other: Self) -> Self::Mask;
    /// `yes` where the mask says so, elsewhere `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// A mask from its bits, lane 0 the lowest; those past the last lane are not read.
    fn mask(bits: u16) -> Self::Mask;
    /// A mask as bits.
    fn bits(mask: Self::Mask) -> u16;
    /// The numbers as they are, where there is one lane in double precision.
    fn alone(_numbers: &[Self]) -> Option<&[f64]> {
        None
    }
    /// The same, to be written.
    fn alone_mut(_numbers: &mut [Self]) -> Option<&mut [f64]> {
        None
    }

    /// The same number in all lanes, rounded to their precision.
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self::all(Self::Scalar::of(x))
    }

    /// Replaces the number in one lane.
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, x: f64) {
        *self = Self::select(Self::mask(1 << lane), Self::splat(x), *self);
    }

    /// The distance from 1 to the next number.
    #[inline(always)]
    fn epsilon() -> Self {
        Self::splat(if Self::SINGLE { f32::EPSILON.into() } else { f64::EPSILON })
    }

    /// The smallest positive number of full precision.
    #[inline(always)]
    fn least() -> Self {
        Self::splat(if Self::SINGLE { f32::MIN_POSITIVE.into() } else { f64::MIN_POSITIVE })
    }

    /// The larger one; the first where one is no number.
    #[inline(always)]
    fn or_larger(self, other: Self) -> Self {
        Self::select(self.less(other), other, self)
    }
}

/// √Σx².
#[inline(always)]
pub fn norm<T: Number>(numbers: &[T]) -> T {
    sum_of_squares(numbers).sqrt()
}

/// Σx².
#[inline(always)]
pub fn sum_of_squares<T: Number>(numbers: &[T]) -> T {
    dot(numbers, numbers)
}

/// Σxy, in four sums that do not wait for one another: for lengths that are the same for all lanes and neighbours.
#[inline(always)]
pub fn dot<T: Number>(x: &[T], y: &[T]) -> T {
    let (mut s0, mut s1, mut s2, mut s3) = (T::splat(0.0), T::splat(0.0), T::splat(0.0), T::splat(0.0));
    let len = x.len();
    let y = &y[..len];
    let mut i = 0;
    while i + 4 <= len {
        s0 = s0.plus(x[i], y[i]);
        s1 = s1.plus(x[i + 1], y[i + 1]);
        s2 = s2.plus(x[i + 2], y[i + 2]);
        s3 = s3.plus(x[i + 3], y[i + 3]);
        i += 4;
    }
    while i < len {
        s0 = s0.plus(x[i], y[i]);
        i += 1;
    }
    (s0 + s1) + (s2 + s3)
}

/// Σxy, one after another: zeros between the terms change nothing.
#[inline(always)]
pub fn dot_in_order<T: Number>(x: &[T], y: &[T]) -> T {
    let mut sum = T::splat(0.0);
    for (&x, &y) in x.iter().zip(y) {
        sum = sum.plus(x, y);
    }
    sum
}

/// to := from, in the lanes of a mask.
#[inline(always)]
pub fn take<T: Number>(lanes: T::Mask, from: &[T], to: &mut [T]) {
    for (to, &x) in to.iter_mut().zip(from) {
        *to = T::select(lanes, x, *to);
    }
}

//! Several numbers as one, where a register holds fewer than a loop wants.

use std::ops::{Add, Div, Mul, Sub};

use super::Number;

/// `N` numbers, one after the other; each operation is done on every one of them.
#[derive(Debug, Clone, Copy)]
pub struct Group<T, const N: usize>(pub [T; N]);

/// Number by number, in a plain loop: the wide instructions would not be inlined into a closure.
macro_rules! each {
    ($like:ident; $part:ident => $value:expr) => {{
        let mut out = $like;
        for $part in 0..N {
            out.0[$part] = $value;
        }
        out
    }};
}

macro_rules! operators {
    ($($trait:ident $name:ident $operator:tt;)*) => {$(
        impl<T: Number, const N: usize> $trait for Group<T, N> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                each!(self; i => self.0[i] $operator other.0[i])
            }
        }
    )*};
}
operators!(Add add +; Sub sub -; Mul mul *; Div div /;);

impl<T: Number, const N: usize> Number for Group<T, N> {
    const LANES: usize = N * T::LANES;
    const SINGLE: bool = T::SINGLE;
    type Scalar = T::Scalar;
    type Mask = [T::Mask; N];

    #[inline(always)]
    fn all(x: T::Scalar) -> Self {
        Self([T::all(x); N])
    }
    #[inline(always)]
    fn load(from: &[T::Scalar]) -> Self {
        let mut out = Self([T::load(from); N]);
        for i in 1..N {
            out.0[i] = T::load(&from[i * T::LANES..]);
        }
        out
    }
    #[inline(always)]
    fn store(self, to: &mut [T::Scalar]) {
        for i in 0..N {
            self.0[i].store(&mut to[i * T::LANES..]);
        }
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self.0[lane / T::LANES].lane(lane % T::LANES)
    }
    #[inline(always)]
    fn plus(self, x: Self, y: Self) -> Self {
        each!(self; i => self.0[i].plus(x.0[i], y.0[i]))
    }
    #[inline(always)]
    fn minus(self, x: Self, y: Self) -> Self {
        each!(self; i => self.0[i].minus(x.0[i], y.0[i]))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        each!(self; i => self.0[i].sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        each!(self; i => self.0[i].abs())
    }
    #[inline(always)]
    fn or_larger(self, other: Self) -> Self {
        each!(self; i => self.0[i].or_larger(other.0[i]))
    }
    #[inline(always)]
    fn less(self, other: Self) -> Self::Mask {
        let mut mask = [self.0[0].less(other.0[0]); N];
        for i in 1..N {
            mask[i] = self.0[i].less(other.0[i]);
        }
        mask
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> Self::Mask {
        let mut mask = [self.0[0].at_most(other.0[0]); N];
        for i in 1..N {
            mask[i] = self.0[i].at_most(other.0[i]);
        }
        mask
    }
    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        each!(yes; i => T::select(mask[i], yes.0[i], no.0[i]))
    }
    #[inline(always)]
    fn mask(bits: u16) -> Self::Mask {
        let mut mask = [T::mask(bits); N];
        for i in 1..N {
            mask[i] = T::mask(bits >> (i * T::LANES));
        }
        mask
    }
    #[inline(always)]
    fn bits(mask: Self::Mask) -> u16 {
        let mut bits = 0;
        for i in 0..N {
            bits |= T::bits(mask[i]) << (i * T::LANES);
        }
        bits
    }
}

//! One number by itself, for every processor.

use super::{Number, Scalar};

impl Scalar for f64 {
    #[inline(always)]
    fn of(x: f64) -> f64 {
        x
    }
}

impl Scalar for f32 {
    #[inline(always)]
    fn of(x: f64) -> f32 {
        x as f32
    }
}

macro_rules! alone {
    ($type:ident, $single:literal, $alone:expr, $alone_mut:expr) => {
        impl Number for $type {
            const LANES: usize = 1;
            const SINGLE: bool = $single;
            type Scalar = $type;
            type Mask = bool;

            #[inline(always)]
            fn all(x: $type) -> $type {
                x
            }
            #[inline(always)]
            fn load(from: &[$type]) -> $type {
                from[0]
            }
            #[inline(always)]
            fn store(self, to: &mut [$type]) {
                to[0] = self;
            }
            #[inline(always)]
            fn lane(&self, _lane: usize) -> f64 {
                f64::from(*self)
            }
            #[inline(always)]
            fn plus(self, x: $type, y: $type) -> $type {
                x.mul_add(y, self)
            }
            #[inline(always)]
            fn minus(self, x: $type, y: $type) -> $type {
                (-x).mul_add(y, self)
            }
            #[inline(always)]
            fn sqrt(self) -> $type {
                $type::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> $type {
                $type::abs(self)
            }
            #[inline(always)]
            fn less(self, other: $type) -> bool {
                self < other
            }
            #[inline(always)]
            fn at_most(self, other: $type) -> bool {
                self <= other
            }
            #[inline(always)]
            fn select(mask: bool, yes: $type, no: $type) -> $type {
                if mask { yes } else { no }
            }
            #[inline(always)]
            fn mask(bits: u16) -> bool {
                bits & 1 == 1
            }
            #[inline(always)]
            fn bits(mask: bool) -> u16 {
                u16::from(mask)
            }
            #[inline(always)]
            fn alone(numbers: &[$type]) -> Option<&[f64]> {
                $alone(numbers)
            }
            #[inline(always)]
            fn alone_mut(numbers: &mut [$type]) -> Option<&mut [f64]> {
                $alone_mut(numbers)
            }
        }
    };
}

alone!(f64, false, Some, Some);
alone!(f32, true, |_| None, |_| None);

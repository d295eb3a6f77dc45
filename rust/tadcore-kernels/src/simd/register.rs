//! A register as a [`Number`](super::Number), from the names of its instructions.
//!
//! The methods are called only from functions compiled for the instructions they use, which run only where the processor
//! has them; memory is read and written through slices that were cut to the length of the register.

/// Defines a register of numbers, and the masks that its comparisons give.
macro_rules! register {
    ($(#[$doc:meta])* $type:ident $register:ident $scalar:ident $mask:ident $lanes:literal $single:literal:
     $add:ident $sub:ident $mul:ident $div:ident $plus:ident $minus:ident $sqrt:ident $abs:ident $set:ident $load:ident
     $store:ident $select:ident $from_bits:ident $to_bits:ident $larger:ident, $less:path, $at_most:path) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        pub struct $type(pub $register);

        register!(@operators $type: Add add $add, Sub sub $sub, Mul mul $mul, Div div $div);

        impl Number for $type {
            const LANES: usize = $lanes;
            const SINGLE: bool = $single;
            type Scalar = $scalar;
            type Mask = $mask;

            #[inline(always)]
            fn all(x: $scalar) -> Self {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { Self($set(x)) }
            }
            #[inline(always)]
            fn load(from: &[$scalar]) -> Self {
                let from = &from[..$lanes];
                // SAFETY: the caller is compiled for these instructions; reads the numbers of the slice.
                unsafe { Self($load(from.as_ptr())) }
            }
            #[inline(always)]
            fn store(self, to: &mut [$scalar]) {
                let to = &mut to[..$lanes];
                // SAFETY: the caller is compiled for these instructions; writes the numbers of the slice.
                unsafe { $store(to.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn lane(&self, lane: usize) -> f64 {
                let mut out = [0.0; $lanes];
                self.store(&mut out);
                f64::from(out[lane])
            }
            #[inline(always)]
            fn plus(self, x: Self, y: Self) -> Self {
                // SAFETY: the caller is compiled for these instructions, FMA too; registers alone.
                unsafe { Self($plus(x.0, y.0, self.0)) }
            }
            #[inline(always)]
            fn minus(self, x: Self, y: Self) -> Self {
                // SAFETY: the caller is compiled for these instructions, FMA too; registers alone.
                unsafe { Self($minus(x.0, y.0, self.0)) }
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { Self($sqrt(self.0)) }
            }
            #[inline(always)]
            fn abs(self) -> Self {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { Self($abs(self.0)) }
            }
            #[inline(always)]
            fn less(self, other: Self) -> $mask {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { $less(self.0, other.0) }
            }
            #[inline(always)]
            fn at_most(self, other: Self) -> $mask {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { $at_most(self.0, other.0) }
            }
            #[inline(always)]
            fn or_larger(self, other: Self) -> Self {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { Self($larger(other.0, self.0)) } // the second where one is no number
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { Self($select(mask, no.0, yes.0)) }
            }
            #[inline(always)]
            fn mask(bits: u16) -> $mask {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { $from_bits(bits) }
            }
            #[inline(always)]
            fn bits(mask: $mask) -> u16 {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { $to_bits(mask) }
            }
        }
    };
    (@operators $type:ident: $($trait:ident $name:ident $of:ident),*) => {$(
        impl std::ops::$trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { Self($of(self.0, other.0)) }
            }
        }
    )*};
}
pub(crate) use register;

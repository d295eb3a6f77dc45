//! The registers of x86-64 processors.
//!
//! The methods are called only from functions compiled for the instructions they use, which run only where the processor
//! has them; memory is written through references to arrays whose type says how long they are.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use super::Number;

/// A register of numbers, and the masks that its comparisons give.
macro_rules! register {
    ($(#[$doc:meta])* $type:ident $register:ident $scalar:ident $mask:ident $lanes:literal $single:literal:
     $add:ident $sub:ident $mul:ident $div:ident $plus:ident $minus:ident $sqrt:ident $abs:ident $set:ident $store:ident
     $compare:ident $select:ident $from_bits:ident $to_bits:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        pub(crate) struct $type($register);

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
            fn lane(&self, lane: usize) -> f64 {
                let mut out = [0.0; $lanes];
                // SAFETY: the caller is compiled for these instructions; writes all numbers of `out`.
                unsafe { $store(out.as_mut_ptr(), self.0) };
                f64::from(out[lane])
            }
            #[inline(always)]
            fn set_lane(&mut self, lane: usize, x: f64) {
                *self = Self::select(Self::mask(1 << lane), Self::splat(x), *self);
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
                unsafe { $compare::<_CMP_LT_OQ>(self.0, other.0) }
            }
            #[inline(always)]
            fn at_most(self, other: Self) -> $mask {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { $compare::<_CMP_LE_OQ>(self.0, other.0) }
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
        impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: the caller is compiled for these instructions; registers alone.
                unsafe { Self($of(self.0, other.0)) }
            }
        }
    )*};
}

register!(
    /// AVX2: four numbers in a register.
    Wide __m256d f64 __m256d 4 false: _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd
    _mm256_fmadd_pd _mm256_fnmadd_pd _mm256_sqrt_pd absolute_pd _mm256_set1_pd _mm256_storeu_pd
    _mm256_cmp_pd select_pd mask_pd bits_pd
);

register!(
    /// AVX2: eight numbers in single precision.
    Wide32 __m256 f32 __m256 8 true: _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps
    _mm256_fmadd_ps _mm256_fnmadd_ps _mm256_sqrt_ps absolute_ps _mm256_set1_ps _mm256_storeu_ps
    _mm256_cmp_ps select_ps mask_ps bits_ps
);

register!(
    /// AVX-512: eight numbers in a register.
    Eight __m512d f64 __mmask8 8 false: _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd
    _mm512_fmadd_pd _mm512_fnmadd_pd _mm512_sqrt_pd _mm512_abs_pd _mm512_set1_pd _mm512_storeu_pd
    _mm512_cmp_pd_mask _mm512_mask_blend_pd mask_8 bits_of
);

register!(
    /// AVX-512: sixteen numbers in single precision.
    Sixteen32 __m512 f32 __mmask16 16 true: _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps
    _mm512_fmadd_ps _mm512_fnmadd_ps _mm512_sqrt_ps _mm512_abs_ps _mm512_set1_ps _mm512_storeu_ps
    _mm512_cmp_ps_mask _mm512_mask_blend_ps mask_16 bits_of
);

register!(
    /// AVX-512VL: eight numbers in single precision, in half a register.
    Eight32 __m256 f32 __mmask8 8 true: _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps
    _mm256_fmadd_ps _mm256_fnmadd_ps _mm256_sqrt_ps absolute_ps _mm256_set1_ps _mm256_storeu_ps
    _mm256_cmp_ps_mask _mm256_mask_blend_ps mask_8 bits_of
);

/// What AVX2 has no single instruction for: |x|, a choice, a mask from its bits and back.
macro_rules! by_avx2 {
    ($register:ident: $absolute:ident $andnot:ident $set:ident, $select:ident $blend:ident,
     $mask:ident $own:expr, $every:ident $equal:ident $cast:ident, $bits:ident $movemask:ident) => {
        #[inline(always)]
        unsafe fn $absolute(x: $register) -> $register {
            // SAFETY: the caller is compiled for AVX2; registers alone.
            unsafe { $andnot($set(-0.0), x) }
        }
        #[inline(always)]
        unsafe fn $select(mask: $register, no: $register, yes: $register) -> $register {
            // SAFETY: the caller is compiled for AVX2; registers alone.
            unsafe { $blend(no, yes, mask) }
        }
        #[inline(always)]
        unsafe fn $mask(bits: u16) -> $register {
            // SAFETY: the caller is compiled for AVX2; registers alone.
            unsafe {
                let (own, bits) = ($own, $every(bits.into()));
                $cast($equal(_mm256_and_si256(bits, own), own))
            }
        }
        #[inline(always)]
        unsafe fn $bits(mask: $register) -> u16 {
            // SAFETY: the caller is compiled for AVX2; registers alone.
            unsafe { $movemask(mask) as u16 }
        }
    };
}

by_avx2!(__m256d: absolute_pd _mm256_andnot_pd _mm256_set1_pd, select_pd _mm256_blendv_pd,
    mask_pd _mm256_setr_epi64x(1, 2, 4, 8), _mm256_set1_epi64x _mm256_cmpeq_epi64 _mm256_castsi256_pd,
    bits_pd _mm256_movemask_pd);
by_avx2!(__m256: absolute_ps _mm256_andnot_ps _mm256_set1_ps, select_ps _mm256_blendv_ps,
    mask_ps _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128), _mm256_set1_epi32 _mm256_cmpeq_epi32 _mm256_castsi256_ps,
    bits_ps _mm256_movemask_ps);

/// Masks of AVX-512 are their bits.
#[inline(always)]
unsafe fn mask_8(bits: u16) -> __mmask8 {
    bits as u8
}
#[inline(always)]
unsafe fn mask_16(bits: u16) -> __mmask16 {
    bits
}
#[inline(always)]
unsafe fn bits_of(mask: impl Into<u16>) -> u16 {
    mask.into()
}

/// Rows as columns.
#[inline(always)]
pub(crate) fn transpose([a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
    // SAFETY: the caller is compiled for AVX2; registers alone.
    unsafe {
        let (ab0, ab1) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
        let (cd0, cd1) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
        [
            _mm256_permute2f128_pd::<0x20>(ab0, cd0),
            _mm256_permute2f128_pd::<0x20>(ab1, cd1),
            _mm256_permute2f128_pd::<0x31>(ab0, cd0),
            _mm256_permute2f128_pd::<0x31>(ab1, cd1),
        ]
    }
}

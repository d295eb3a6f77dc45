//! The registers of x86-64 processors.
//!
//! The methods are called only from functions compiled for the instructions they use, which run only where the processor
//! has them; memory is written through references to arrays whose type says how long they are.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use super::Number;

/// AVX2: four numbers in a register.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wide(__m256d);

macro_rules! operators {
    ($($trait:ident $name:ident $of:ident),*) => {$(
        impl $trait for Wide {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: the caller is compiled for AVX2; registers alone.
                unsafe { Self($of(self.0, other.0)) }
            }
        }
    )*};
}

operators!(Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

impl Number for Wide {
    const LANES: usize = 4;
    type Mask = __m256d;

    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { Self(_mm256_set1_pd(x)) }
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        let mut out = [0.0; 4];
        // SAFETY: the caller is compiled for AVX2; writes the 4 numbers of `out`.
        unsafe { _mm256_storeu_pd(out.as_mut_ptr(), self.0) };
        out[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, x: f64) {
        *self = Self::select(Self::mask(1 << lane), Self::splat(x), *self);
    }
    #[inline(always)]
    fn plus(self, x: Self, y: Self) -> Self {
        // SAFETY: the caller is compiled for AVX2 and FMA; registers alone.
        unsafe { Self(_mm256_fmadd_pd(x.0, y.0, self.0)) }
    }
    #[inline(always)]
    fn minus(self, x: Self, y: Self) -> Self {
        // SAFETY: the caller is compiled for AVX2 and FMA; registers alone.
        unsafe { Self(_mm256_fnmadd_pd(x.0, y.0, self.0)) }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { Self(_mm256_sqrt_pd(self.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { Self(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)) }
    }
    #[inline(always)]
    fn less(self, other: Self) -> __m256d {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn at_most(self, other: Self) -> __m256d {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { _mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn select(mask: __m256d, yes: Self, no: Self) -> Self {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { Self(_mm256_blendv_pd(no.0, yes.0, mask)) }
    }
    #[inline(always)]
    fn mask(bits: u8) -> __m256d {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe {
            let (own, bits) = (_mm256_setr_epi64x(1, 2, 4, 8), _mm256_set1_epi64x(i64::from(bits)));
            _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(bits, own), own))
        }
    }
    #[inline(always)]
    fn bits(mask: __m256d) -> u8 {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { _mm256_movemask_pd(mask) as u8 }
    }
}

/// AVX-512: one register and its masks.
macro_rules! masked {
    ($(#[$doc:meta])* $type:ident $register:ident $lanes:literal: $add:ident $sub:ident $mul:ident $div:ident
     $plus:ident $minus:ident $sqrt:ident $abs:ident $set:ident $store:ident $compare:ident $blend:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        pub(crate) struct $type($register);

        masked!(@operators $type: Add add $add, Sub sub $sub, Mul mul $mul, Div div $div);

        impl Number for $type {
            const LANES: usize = $lanes;
            type Mask = __mmask8;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { Self($set(x)) }
            }
            #[inline(always)]
            fn lane(&self, lane: usize) -> f64 {
                let mut out = [0.0; $lanes];
                // SAFETY: the caller is compiled for AVX-512; writes all numbers of `out`.
                unsafe { $store(out.as_mut_ptr(), self.0) };
                out[lane]
            }
            #[inline(always)]
            fn set_lane(&mut self, lane: usize, x: f64) {
                *self = Self::select(1 << lane, Self::splat(x), *self);
            }
            #[inline(always)]
            fn plus(self, x: Self, y: Self) -> Self {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { Self($plus(x.0, y.0, self.0)) }
            }
            #[inline(always)]
            fn minus(self, x: Self, y: Self) -> Self {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { Self($minus(x.0, y.0, self.0)) }
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { Self($sqrt(self.0)) }
            }
            #[inline(always)]
            fn abs(self) -> Self {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { Self($abs(self.0)) }
            }
            #[inline(always)]
            fn less(self, other: Self) -> __mmask8 {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { $compare::<_CMP_LT_OQ>(self.0, other.0) }
            }
            #[inline(always)]
            fn at_most(self, other: Self) -> __mmask8 {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { $compare::<_CMP_LE_OQ>(self.0, other.0) }
            }
            #[inline(always)]
            fn select(mask: __mmask8, yes: Self, no: Self) -> Self {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { Self($blend(mask, no.0, yes.0)) }
            }
            #[inline(always)]
            fn mask(bits: u8) -> __mmask8 {
                bits
            }
            #[inline(always)]
            fn bits(mask: __mmask8) -> u8 {
                mask
            }
        }
    };
    (@operators $type:ident: $($trait:ident $name:ident $of:ident),*) => {$(
        impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: the caller is compiled for AVX-512; registers alone.
                unsafe { Self($of(self.0, other.0)) }
            }
        }
    )*};
}

masked!(
    /// AVX-512: eight numbers in a register.
    Eight __m512d 8: _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd
    _mm512_fmadd_pd _mm512_fnmadd_pd _mm512_sqrt_pd _mm512_abs_pd _mm512_set1_pd _mm512_storeu_pd _mm512_cmp_pd_mask _mm512_mask_blend_pd
);

masked!(
    /// AVX-512VL: four numbers in half a register.
    Four __m256d 4: _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd
    _mm256_fmadd_pd _mm256_fnmadd_pd _mm256_sqrt_pd absolute _mm256_set1_pd _mm256_storeu_pd _mm256_cmp_pd_mask _mm256_mask_blend_pd
);

#[inline(always)]
unsafe fn absolute(x: __m256d) -> __m256d {
    // SAFETY: the caller is compiled for AVX-512VL; registers alone.
    unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), x) }
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

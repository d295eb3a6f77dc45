//! Numbers side by side: one, or four in each vector register.
//!
//! What is written once over [`Number`] runs for one problem or for several at a time. Every operation is the IEEE one on
//! each lane, the fused ones too, so a lane gives the bits that the number alone would give. The methods of the wide types are inlined into functions that are compiled for their instructions; a closure
//! is a function of its own and is not, so kernels over `Number` are plain loops.

use std::ops::{Add, Div, Mul, Sub};

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::{Eight, Four, Wide};

/// One number, or several side by side.
pub(crate) trait Number:
    Copy + std::fmt::Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// How many, at most eight.
    const LANES: usize;
    /// A yes or no for each lane.
    type Mask: Copy + std::fmt::Debug;

    /// The same number in all lanes.
    fn splat(x: f64) -> Self;
    /// The number in one lane.
    fn lane(&self, lane: usize) -> f64;
    /// Replaces the number in one lane.
    fn set_lane(&mut self, lane: usize, x: f64);
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
    /// A mask from its bits, lane 0 the lowest.
    fn mask(bits: u8) -> Self::Mask;
    /// A mask as bits.
    fn bits(mask: Self::Mask) -> u8;
    /// The numbers as they are, where there is one lane.
    fn alone(_numbers: &mut [Self]) -> Option<&mut [f64]> {
        None
    }

    /// The larger one; the first where one is no number.
    #[inline(always)]
    fn or_larger(self, other: Self) -> Self {
        Self::select(self.less(other), other, self)
    }
}

/// √Σx².
#[inline(always)]
pub(crate) fn norm<T: Number>(numbers: &[T]) -> T {
    sum_of_squares(numbers).sqrt()
}

/// Σx².
#[inline(always)]
pub(crate) fn sum_of_squares<T: Number>(numbers: &[T]) -> T {
    dot(numbers, numbers)
}

/// Σxy, in four sums that do not wait for one another: for lengths that are the same for all lanes and neighbours.
#[inline(always)]
pub(crate) fn dot<T: Number>(x: &[T], y: &[T]) -> T {
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
pub(crate) fn dot_in_order<T: Number>(x: &[T], y: &[T]) -> T {
    let mut sum = T::splat(0.0);
    for (&x, &y) in x.iter().zip(y) {
        sum = sum.plus(x, y);
    }
    sum
}

impl Number for f64 {
    const LANES: usize = 1;
    type Mask = bool;

    #[inline(always)]
    fn splat(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn lane(&self, _lane: usize) -> f64 {
        *self
    }
    #[inline(always)]
    fn set_lane(&mut self, _lane: usize, x: f64) {
        *self = x;
    }
    #[inline(always)]
    fn plus(self, x: f64, y: f64) -> f64 {
        x.mul_add(y, self)
    }
    #[inline(always)]
    fn minus(self, x: f64, y: f64) -> f64 {
        (-x).mul_add(y, self)
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }
    #[inline(always)]
    fn less(self, other: f64) -> bool {
        self < other
    }
    #[inline(always)]
    fn at_most(self, other: f64) -> bool {
        self <= other
    }
    #[inline(always)]
    fn select(mask: bool, yes: f64, no: f64) -> f64 {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn mask(bits: u8) -> bool {
        bits & 1 == 1
    }
    #[inline(always)]
    fn bits(mask: bool) -> u8 {
        u8::from(mask)
    }
    #[inline(always)]
    fn alone(numbers: &mut [f64]) -> Option<&mut [f64]> {
        Some(numbers)
    }
}

/// The registers of x86-64 processors.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;
    use std::ops::{Add, Div, Mul, Sub};

    use super::Number;

    /// AVX2: four numbers in each of `R` registers.
    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Wide<const R: usize>([__m256d; R]);

    macro_rules! operators {
        ($($trait:ident $name:ident $of:ident),*) => {$(
            impl<const R: usize> $trait for Wide<R> {
                type Output = Self;
                #[inline(always)]
                fn $name(mut self, other: Self) -> Self {
                    for r in 0..R {
                        // SAFETY: the caller is compiled for AVX2; registers alone.
                        self.0[r] = unsafe { $of(self.0[r], other.0[r]) };
                    }
                    self
                }
            }
        )*};
    }

    operators!(Add add _mm256_add_pd, Sub sub _mm256_sub_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

    impl<const R: usize> Number for Wide<R> {
        const LANES: usize = 4 * R;
        type Mask = [__m256d; R];

        #[inline(always)]
        fn splat(x: f64) -> Self {
            // SAFETY: the caller is compiled for AVX2; registers alone.
            unsafe { Self([_mm256_set1_pd(x); R]) }
        }
        #[inline(always)]
        fn lane(&self, lane: usize) -> f64 {
            let mut out = [0.0; 4];
            // SAFETY: the caller is compiled for AVX2; writes the 4 numbers of `out`.
            unsafe { _mm256_storeu_pd(out.as_mut_ptr(), self.0[lane / 4]) };
            out[lane % 4]
        }
        #[inline(always)]
        fn set_lane(&mut self, lane: usize, x: f64) {
            *self = Self::select(Self::mask(1 << lane), Self::splat(x), *self);
        }
        #[inline(always)]
        fn plus(mut self, x: Self, y: Self) -> Self {
            for r in 0..R {
                // SAFETY: the caller is compiled for AVX2 and FMA; registers alone.
                self.0[r] = unsafe { _mm256_fmadd_pd(x.0[r], y.0[r], self.0[r]) };
            }
            self
        }
        #[inline(always)]
        fn minus(mut self, x: Self, y: Self) -> Self {
            for r in 0..R {
                // SAFETY: the caller is compiled for AVX2 and FMA; registers alone.
                self.0[r] = unsafe { _mm256_fnmadd_pd(x.0[r], y.0[r], self.0[r]) };
            }
            self
        }
        #[inline(always)]
        fn sqrt(mut self) -> Self {
            for r in 0..R {
                // SAFETY: the caller is compiled for AVX2; registers alone.
                self.0[r] = unsafe { _mm256_sqrt_pd(self.0[r]) };
            }
            self
        }
        #[inline(always)]
        fn abs(mut self) -> Self {
            for r in 0..R {
                // SAFETY: the caller is compiled for AVX2; registers alone.
                self.0[r] = unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0[r]) };
            }
            self
        }
        #[inline(always)]
        fn less(mut self, other: Self) -> [__m256d; R] {
            for r in 0..R {
                // SAFETY: the caller is compiled for AVX2; registers alone.
                self.0[r] = unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0[r], other.0[r]) };
            }
            self.0
        }
        #[inline(always)]
        fn at_most(mut self, other: Self) -> [__m256d; R] {
            for r in 0..R {
                // SAFETY: the caller is compiled for AVX2; registers alone.
                self.0[r] = unsafe { _mm256_cmp_pd::<_CMP_LE_OQ>(self.0[r], other.0[r]) };
            }
            self.0
        }
        #[inline(always)]
        fn select(mask: [__m256d; R], mut yes: Self, no: Self) -> Self {
            for r in 0..R {
                // SAFETY: the caller is compiled for AVX2; registers alone.
                yes.0[r] = unsafe { _mm256_blendv_pd(no.0[r], yes.0[r], mask[r]) };
            }
            yes
        }
        #[inline(always)]
        fn mask(bits: u8) -> [__m256d; R] {
            // SAFETY: the caller is compiled for AVX2; registers alone.
            unsafe {
                let mut mask = [_mm256_setzero_pd(); R];
                for r in 0..R {
                    let (own, bits) = (_mm256_setr_epi64x(1, 2, 4, 8), _mm256_set1_epi64x(i64::from(bits >> (4 * r))));
                    mask[r] = _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(bits, own), own));
                }
                mask
            }
        }
        #[inline(always)]
        fn bits(mask: [__m256d; R]) -> u8 {
            let mut bits = 0;
            for r in 0..R {
                // SAFETY: the caller is compiled for AVX2; registers alone.
                bits |= unsafe { _mm256_movemask_pd(mask[r]) } << (4 * r);
            }
            bits as u8
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
}

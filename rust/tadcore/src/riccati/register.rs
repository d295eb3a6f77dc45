//! Four numbers, and eight, as the registers of a [`Width`](crate::width::Width) hold them, with a product and the sum it
//! goes into as one operation.
//!
//! Every operation is rounded correctly, the fused one once, so all implementations give the same bits. Without an
//! instruction for it (an x86-64 processor older than 2013) the fused one is a slow call of the library. The methods of
//! the wide registers are inlined into functions that are compiled for their instructions and reached only through a
//! `Width` that the processor confirmed.

/// W numbers.
pub(super) trait Pack<const W: usize>: Copy {
    fn splat(x: f64) -> Self;
    fn load(from: &[f64; W]) -> Self;
    fn store(self, to: &mut [f64; W]);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    /// self · by + to, rounded once.
    fn mul_add(self, by: Self, to: Self) -> Self;
}

/// A width's registers.
pub(super) trait Registers {
    type Four: Pack<4>;
    type Eight: Pack<8>;
    /// How many sums of eight numbers fit beside what goes into them: rows of a tile.
    const ROWS: usize;
    /// Rows as columns.
    fn transpose(rows: [Self::Four; 4]) -> [Self::Four; 4];
    /// The first four of eight, and the others.
    fn halves(eight: Self::Eight) -> [Self::Four; 2];
}

/// Arrays, for every processor.
pub(super) struct Plain;

impl<const W: usize> Pack<W> for [f64; W] {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        [x; W]
    }
    #[inline(always)]
    fn load(from: &[f64; W]) -> Self {
        *from
    }
    #[inline(always)]
    fn store(self, to: &mut [f64; W]) {
        *to = self;
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        std::array::from_fn(|c| self[c] + other[c])
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        std::array::from_fn(|c| self[c] - other[c])
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        std::array::from_fn(|c| self[c] * other[c])
    }
    #[inline(always)]
    fn mul_add(self, by: Self, to: Self) -> Self {
        std::array::from_fn(|c| self[c].mul_add(by[c], to[c]))
    }
}

impl Registers for Plain {
    type Four = [f64; 4];
    type Eight = [f64; 8];
    const ROWS: usize = 4;
    #[inline(always)]
    fn transpose(rows: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
        std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c]))
    }
    #[inline(always)]
    fn halves(eight: [f64; 8]) -> [[f64; 4]; 2] {
        std::array::from_fn(|h| std::array::from_fn(|c| eight[4 * h + c]))
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Wide256, Wide512};

/// The registers of x86-64 processors.
///
/// The methods are called only from functions compiled for the instructions they use, which run only where the processor
/// has them; memory is read and written through references to arrays whose type says how long they are.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{Pack, Registers};
    use crate::lanes::transpose;

    /// 256 bits.
    pub(in super::super) struct Wide256;
    /// 512 bits.
    pub(in super::super) struct Wide512;

    macro_rules! pack {
        ($register:ty, $w:literal, $splat:ident, $load:ident, $store:ident, $add:ident, $sub:ident, $mul:ident, $fused:ident) => {
            impl Pack<$w> for $register {
                #[inline(always)]
                fn splat(x: f64) -> Self {
                    // SAFETY: the caller is compiled for this width; registers alone.
                    unsafe { $splat(x) }
                }
                #[inline(always)]
                fn load(from: &[f64; $w]) -> Self {
                    // SAFETY: the caller is compiled for this width; reads the numbers of the array.
                    unsafe { $load(from.as_ptr()) }
                }
                #[inline(always)]
                fn store(self, to: &mut [f64; $w]) {
                    // SAFETY: the caller is compiled for this width; writes the numbers of the array.
                    unsafe { $store(to.as_mut_ptr(), self) }
                }
                #[inline(always)]
                fn add(self, other: Self) -> Self {
                    // SAFETY: the caller is compiled for this width; registers alone.
                    unsafe { $add(self, other) }
                }
                #[inline(always)]
                fn sub(self, other: Self) -> Self {
                    // SAFETY: the caller is compiled for this width; registers alone.
                    unsafe { $sub(self, other) }
                }
                #[inline(always)]
                fn mul(self, other: Self) -> Self {
                    // SAFETY: the caller is compiled for this width; registers alone.
                    unsafe { $mul(self, other) }
                }
                #[inline(always)]
                fn mul_add(self, by: Self, to: Self) -> Self {
                    // SAFETY: the caller is compiled for this width; registers alone.
                    unsafe { $fused(self, by, to) }
                }
            }
        };
    }
    pack!(
        __m256d,
        4,
        _mm256_set1_pd,
        _mm256_loadu_pd,
        _mm256_storeu_pd,
        _mm256_add_pd,
        _mm256_sub_pd,
        _mm256_mul_pd,
        _mm256_fmadd_pd
    );
    pack!(
        __m512d,
        8,
        _mm512_set1_pd,
        _mm512_loadu_pd,
        _mm512_storeu_pd,
        _mm512_add_pd,
        _mm512_sub_pd,
        _mm512_mul_pd,
        _mm512_fmadd_pd
    );

    /// Eight numbers in two registers of four.
    impl Pack<8> for [__m256d; 2] {
        #[inline(always)]
        fn splat(x: f64) -> Self {
            [Pack::splat(x); 2]
        }
        #[inline(always)]
        fn load(from: &[f64; 8]) -> Self {
            let [low, high] = *from.as_chunks::<4>().0 else { unreachable!("eight are two fours") };
            [Pack::load(&low), Pack::load(&high)]
        }
        #[inline(always)]
        fn store(self, to: &mut [f64; 8]) {
            for (half, to) in self.into_iter().zip(to.as_chunks_mut::<4>().0) {
                half.store(to);
            }
        }
        #[inline(always)]
        fn add(self, other: Self) -> Self {
            [self[0].add(other[0]), self[1].add(other[1])]
        }
        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            [self[0].sub(other[0]), self[1].sub(other[1])]
        }
        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            [self[0].mul(other[0]), self[1].mul(other[1])]
        }
        #[inline(always)]
        fn mul_add(self, by: Self, to: Self) -> Self {
            [self[0].mul_add(by[0], to[0]), self[1].mul_add(by[1], to[1])]
        }
    }

    impl Registers for Wide256 {
        type Four = __m256d;
        type Eight = [__m256d; 2];
        const ROWS: usize = 4;
        #[inline(always)]
        fn transpose(rows: [__m256d; 4]) -> [__m256d; 4] {
            transpose(rows)
        }
        #[inline(always)]
        fn halves(eight: [__m256d; 2]) -> [__m256d; 2] {
            eight
        }
    }

    impl Registers for Wide512 {
        type Four = __m256d;
        type Eight = __m512d;
        const ROWS: usize = 8;
        #[inline(always)]
        fn transpose(rows: [__m256d; 4]) -> [__m256d; 4] {
            transpose(rows)
        }
        #[inline(always)]
        fn halves(eight: __m512d) -> [__m256d; 2] {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { [_mm512_castpd512_pd256(eight), _mm512_extractf64x4_pd::<1>(eight)] }
        }
    }
}

/// Defines a function by a body that is generic in the [`Registers`] `V`, compiled for every width.
macro_rules! fused {
    ($(#[$doc:meta])* $vis:vis fn $name:ident<$v:ident $(, const $g:ident: usize)*>($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block) => {
        $(#[$doc])*
        $vis fn $name<$(const $g: usize),*>(width: $crate::width::Width, $($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn body<$v: $crate::riccati::register::Registers $(, const $g: usize)*>($($arg: $ty),*) $(-> $ret)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            fn avx2<$(const $g: usize),*>($($arg: $ty),*) $(-> $ret)? {
                body::<$crate::riccati::register::Wide256 $(, $g)*>($($arg),*)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx2,fma")]
            fn avx512<$(const $g: usize),*>($($arg: $ty),*) $(-> $ret)? {
                body::<$crate::riccati::register::Wide512 $(, $g)*>($($arg),*)
            }
            match width {
                $crate::width::Width::Baseline => body::<$crate::riccati::register::Plain $(, $g)*>($($arg),*),
                #[cfg(target_arch = "x86_64")]
                // SAFETY: this variant exists only where the processor said that it has AVX2 and FMA.
                $crate::width::Width::Avx2 => unsafe { avx2::<$($g),*>($($arg),*) },
                #[cfg(target_arch = "x86_64")]
                // SAFETY: this variant exists only where the processor said that it has AVX-512F, AVX2 and FMA.
                $crate::width::Width::Avx512 => unsafe { avx512::<$($g),*>($($arg),*) },
            }
        }
    };
}
pub(super) use fused;

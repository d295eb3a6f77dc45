//! Eight numbers, and four, as the registers of a [`Width`](crate::width::Width) hold them.
//!
//! Every operation is the plain IEEE one on each lane and none is fused with another, so all implementations give the
//! same bits. The methods of the wide ones are inlined into functions that are compiled for their instructions and
//! reached only through a `Width` that the processor confirmed.

/// A width's registers.
pub(super) trait Vector: Copy {
    /// Eight numbers.
    type Eight: Copy;
    /// Eight keys of 64 bits.
    type Keys: Copy;
    /// Four numbers.
    type Four: Copy;

    fn load(from: &[f64; 8]) -> Self::Eight;
    fn add(a: Self::Eight, b: Self::Eight) -> Self::Eight;
    fn sub(a: Self::Eight, b: Self::Eight) -> Self::Eight;
    fn mul(a: Self::Eight, b: Self::Eight) -> Self::Eight;
    /// A bit for each lane in which a ≤ b.
    fn within(a: Self::Eight, b: Self::Eight) -> u8;
    fn no_keys() -> Self::Keys;
    /// The keys with `bit` set in the lanes in which a ≤ b.
    fn see(keys: Self::Keys, bit: u64, a: Self::Eight, b: Self::Eight) -> Self::Keys;
    fn keys(keys: Self::Keys) -> [u64; 8];
    /// The low 16 bits of each key, four in a word.
    fn low(keys: Self::Keys) -> [u64; 2];

    fn load4(from: &[f64; 4]) -> Self::Four;
    /// Column · number.
    fn scale4(column: Self::Four, by: f64) -> Self::Four;
    /// sum + column · number, rounded twice.
    fn add_scaled4(sum: Self::Four, column: Self::Four, by: f64) -> Self::Four;
    /// Rows as columns.
    fn transpose4(rows: [Self::Four; 4]) -> [Self::Four; 4];
    fn store4(x: Self::Four, to: &mut [f64; 4]);
}

/// Arrays, for every processor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plain;

impl Vector for Plain {
    type Eight = [f64; 8];
    type Keys = [u64; 8];
    type Four = [f64; 4];

    #[inline(always)]
    fn load(from: &[f64; 8]) -> [f64; 8] {
        *from
    }
    #[inline(always)]
    fn add(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        std::array::from_fn(|l| a[l] + b[l])
    }
    #[inline(always)]
    fn sub(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        std::array::from_fn(|l| a[l] - b[l])
    }
    #[inline(always)]
    fn mul(a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        std::array::from_fn(|l| a[l] * b[l])
    }
    #[inline(always)]
    fn within(a: [f64; 8], b: [f64; 8]) -> u8 {
        (0..8).fold(0, |mask, l| mask | u8::from(a[l] <= b[l]) << l)
    }
    #[inline(always)]
    fn no_keys() -> [u64; 8] {
        [0; 8]
    }
    #[inline(always)]
    fn see(keys: [u64; 8], bit: u64, a: [f64; 8], b: [f64; 8]) -> [u64; 8] {
        std::array::from_fn(|l| keys[l] | if a[l] <= b[l] { bit } else { 0 })
    }
    #[inline(always)]
    fn keys(keys: [u64; 8]) -> [u64; 8] {
        keys
    }
    #[inline(always)]
    fn low(keys: [u64; 8]) -> [u64; 2] {
        [0, 4].map(|first| (0..4).fold(0, |word, l| word | (keys[first + l] & 0xFFFF) << (16 * l)))
    }
    #[inline(always)]
    fn load4(from: &[f64; 4]) -> [f64; 4] {
        *from
    }
    #[inline(always)]
    fn scale4(column: [f64; 4], by: f64) -> [f64; 4] {
        std::array::from_fn(|a| column[a] * by)
    }
    #[inline(always)]
    fn add_scaled4(sum: [f64; 4], column: [f64; 4], by: f64) -> [f64; 4] {
        std::array::from_fn(|a| sum[a] + column[a] * by)
    }
    #[inline(always)]
    fn transpose4(rows: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
        std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c]))
    }
    #[inline(always)]
    fn store4(x: [f64; 4], to: &mut [f64; 4]) {
        *to = x;
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Wide256, Wide512};

/// The registers of x86-64 processors.
///
/// The methods are called only from functions compiled for the instructions they use, which run only where the processor
/// has them (asserted there in debug builds); memory is read and written through references to arrays whose type says
/// how long they are.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::*;

    use super::Vector;
    use crate::lanes::transpose;

    /// The four-number operations, the same for both widths.
    macro_rules! fours {
        () => {
            #[inline(always)]
            fn load4(from: &[f64; 4]) -> __m256d {
                // SAFETY: the caller is compiled for this width; reads the 4 numbers of the array.
                unsafe { _mm256_loadu_pd(from.as_ptr()) }
            }
            #[inline(always)]
            fn scale4(column: __m256d, by: f64) -> __m256d {
                // SAFETY: the caller is compiled for this width; registers alone.
                unsafe { _mm256_mul_pd(column, _mm256_set1_pd(by)) }
            }
            #[inline(always)]
            fn add_scaled4(sum: __m256d, column: __m256d, by: f64) -> __m256d {
                // SAFETY: the caller is compiled for this width; registers alone.
                unsafe { _mm256_add_pd(sum, _mm256_mul_pd(column, _mm256_set1_pd(by))) }
            }
            #[inline(always)]
            fn transpose4(rows: [__m256d; 4]) -> [__m256d; 4] {
                transpose(rows)
            }
            #[inline(always)]
            fn store4(x: __m256d, to: &mut [f64; 4]) {
                // SAFETY: the caller is compiled for this width; writes the 4 numbers of the array.
                unsafe { _mm256_storeu_pd(to.as_mut_ptr(), x) }
            }
        };
    }

    /// AVX2: two registers for eight numbers.
    #[derive(Debug, Clone, Copy)]
    pub(in crate::ensemble) struct Wide256;

    impl Vector for Wide256 {
        type Eight = [__m256d; 2];
        type Keys = [__m256i; 2];
        type Four = __m256d;

        #[inline(always)]
        fn load(from: &[f64; 8]) -> Self::Eight {
            // SAFETY: the caller is compiled for this width; reads the 8 numbers of the array.
            unsafe { [_mm256_loadu_pd(from.as_ptr()), _mm256_loadu_pd(from.as_ptr().add(4))] }
        }
        #[inline(always)]
        fn add(a: Self::Eight, b: Self::Eight) -> Self::Eight {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { [_mm256_add_pd(a[0], b[0]), _mm256_add_pd(a[1], b[1])] }
        }
        #[inline(always)]
        fn sub(a: Self::Eight, b: Self::Eight) -> Self::Eight {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { [_mm256_sub_pd(a[0], b[0]), _mm256_sub_pd(a[1], b[1])] }
        }
        #[inline(always)]
        fn mul(a: Self::Eight, b: Self::Eight) -> Self::Eight {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { [_mm256_mul_pd(a[0], b[0]), _mm256_mul_pd(a[1], b[1])] }
        }
        #[inline(always)]
        fn within(a: Self::Eight, b: Self::Eight) -> u8 {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe {
                let low = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(a[0], b[0]));
                let high = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(a[1], b[1]));
                (low | high << 4) as u8
            }
        }
        #[inline(always)]
        fn no_keys() -> Self::Keys {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { [_mm256_setzero_si256(); 2] }
        }
        #[inline(always)]
        fn see(keys: Self::Keys, bit: u64, a: Self::Eight, b: Self::Eight) -> Self::Keys {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe {
                let bit = _mm256_set1_epi64x(bit as i64);
                let low = _mm256_castpd_si256(_mm256_cmp_pd::<_CMP_LE_OQ>(a[0], b[0]));
                let high = _mm256_castpd_si256(_mm256_cmp_pd::<_CMP_LE_OQ>(a[1], b[1]));
                [
                    _mm256_or_si256(keys[0], _mm256_and_si256(low, bit)),
                    _mm256_or_si256(keys[1], _mm256_and_si256(high, bit)),
                ]
            }
        }
        #[inline(always)]
        fn keys(keys: Self::Keys) -> [u64; 8] {
            let mut out = [0; 8];
            // SAFETY: the caller is compiled for this width; writes the 8 words of `out`.
            unsafe {
                _mm256_storeu_si256(out.as_mut_ptr().cast(), keys[0]);
                _mm256_storeu_si256(out.as_mut_ptr().add(4).cast(), keys[1]);
            }
            out
        }
        #[inline(always)]
        fn low(keys: Self::Keys) -> [u64; 2] {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe {
                // Words whose upper halves are zero: packed twice, within 128 bits.
                let both = _mm256_packus_epi32(keys[0], keys[1]);
                let both = _mm256_packus_epi32(both, both);
                let (low, high) = (_mm256_castsi256_si128(both), _mm256_extracti128_si256::<1>(both));
                let mixed = _mm_unpacklo_epi32(low, high);
                [_mm_cvtsi128_si64(mixed) as u64, _mm_extract_epi64::<1>(mixed) as u64]
            }
        }
        fours!();
    }

    /// AVX-512F: one register for eight numbers, and compares that set bits of keys under a mask.
    #[derive(Debug, Clone, Copy)]
    pub(in crate::ensemble) struct Wide512;

    impl Vector for Wide512 {
        type Eight = __m512d;
        type Keys = __m512i;
        type Four = __m256d;

        #[inline(always)]
        fn load(from: &[f64; 8]) -> __m512d {
            // SAFETY: the caller is compiled for this width; reads the 8 numbers of the array.
            unsafe { _mm512_loadu_pd(from.as_ptr()) }
        }
        #[inline(always)]
        fn add(a: __m512d, b: __m512d) -> __m512d {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { _mm512_add_pd(a, b) }
        }
        #[inline(always)]
        fn sub(a: __m512d, b: __m512d) -> __m512d {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { _mm512_sub_pd(a, b) }
        }
        #[inline(always)]
        fn mul(a: __m512d, b: __m512d) -> __m512d {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { _mm512_mul_pd(a, b) }
        }
        #[inline(always)]
        fn within(a: __m512d, b: __m512d) -> u8 {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { _mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b) }
        }
        #[inline(always)]
        fn no_keys() -> __m512i {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe { _mm512_setzero_si512() }
        }
        #[inline(always)]
        fn see(keys: __m512i, bit: u64, a: __m512d, b: __m512d) -> __m512i {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe {
                let seen = _mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b);
                _mm512_mask_or_epi64(keys, seen, keys, _mm512_set1_epi64(bit as i64))
            }
        }
        #[inline(always)]
        fn keys(keys: __m512i) -> [u64; 8] {
            let mut out = [0; 8];
            // SAFETY: the caller is compiled for this width; writes the 8 words of `out`.
            unsafe { _mm512_storeu_si512(out.as_mut_ptr().cast(), keys) };
            out
        }
        #[inline(always)]
        fn low(keys: __m512i) -> [u64; 2] {
            // SAFETY: the caller is compiled for this width; registers alone.
            unsafe {
                let words = _mm512_cvtepi64_epi16(keys);
                [_mm_cvtsi128_si64(words) as u64, _mm_extract_epi64::<1>(words) as u64]
            }
        }
        fours!();
    }
}

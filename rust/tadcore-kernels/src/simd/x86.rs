//! The registers and instructions of x86-64 processors: AVX2 with FMA, AVX-512 with VL.
//!
//! All is called only from functions compiled for the instructions, which run only where the processor has them.

use std::arch::x86_64::*;

use super::group::Group;
use super::number::Number;
use super::register::register;
use super::{Entries, Simd};

register!(
    /// AVX2: four numbers in a register.
    F64x4 __m256d f64 __m256d 4 false: _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd
    _mm256_fmadd_pd _mm256_fnmadd_pd _mm256_sqrt_pd absolute_pd _mm256_set1_pd _mm256_loadu_pd
    _mm256_storeu_pd select_pd mask_pd bits_pd _mm256_max_pd, _mm256_cmp_pd::<_CMP_LT_OQ>, _mm256_cmp_pd::<_CMP_LE_OQ>
);

register!(
    /// AVX2: eight numbers in single precision.
    F32x8 __m256 f32 __m256 8 true: _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps
    _mm256_fmadd_ps _mm256_fnmadd_ps _mm256_sqrt_ps absolute_ps _mm256_set1_ps _mm256_loadu_ps
    _mm256_storeu_ps select_ps mask_ps bits_ps _mm256_max_ps, _mm256_cmp_ps::<_CMP_LT_OQ>, _mm256_cmp_ps::<_CMP_LE_OQ>
);

register!(
    /// AVX-512: eight numbers in a register.
    F64x8 __m512d f64 __mmask8 8 false: _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd
    _mm512_fmadd_pd _mm512_fnmadd_pd _mm512_sqrt_pd _mm512_abs_pd _mm512_set1_pd _mm512_loadu_pd
    _mm512_storeu_pd _mm512_mask_blend_pd mask_8 bits_of _mm512_max_pd,
    _mm512_cmp_pd_mask::<_CMP_LT_OQ>, _mm512_cmp_pd_mask::<_CMP_LE_OQ>
);

register!(
    /// AVX-512: sixteen numbers in single precision.
    F32x16 __m512 f32 __mmask16 16 true: _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps
    _mm512_fmadd_ps _mm512_fnmadd_ps _mm512_sqrt_ps _mm512_abs_ps _mm512_set1_ps _mm512_loadu_ps
    _mm512_storeu_ps _mm512_mask_blend_ps mask_16 bits_of _mm512_max_ps,
    _mm512_cmp_ps_mask::<_CMP_LT_OQ>, _mm512_cmp_ps_mask::<_CMP_LE_OQ>
);

register!(
    /// AVX-512VL: eight numbers in single precision, in half a register.
    F32x8Masked __m256 f32 __mmask8 8 true: _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps
    _mm256_fmadd_ps _mm256_fnmadd_ps _mm256_sqrt_ps absolute_ps _mm256_set1_ps _mm256_loadu_ps
    _mm256_storeu_ps _mm256_mask_blend_ps mask_8 bits_of _mm256_max_ps,
    _mm256_cmp_ps_mask::<_CMP_LT_OQ>, _mm256_cmp_ps_mask::<_CMP_LE_OQ>
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
fn transpose([F64x4(a), F64x4(b), F64x4(c), F64x4(d)]: [F64x4; 4]) -> [F64x4; 4] {
    // SAFETY: the caller is compiled for AVX2; registers alone.
    unsafe {
        let (ab0, ab1) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
        let (cd0, cd1) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
        [
            F64x4(_mm256_permute2f128_pd::<0x20>(ab0, cd0)),
            F64x4(_mm256_permute2f128_pd::<0x20>(ab1, cd1)),
            F64x4(_mm256_permute2f128_pd::<0x31>(ab0, cd0)),
            F64x4(_mm256_permute2f128_pd::<0x31>(ab1, cd1)),
        ]
    }
}

/// AVX2 and FMA: two registers for eight numbers.
#[derive(Debug, Clone, Copy)]
pub struct Avx2;

impl Simd for Avx2 {
    type Four = F64x4;
    type Eight = Group<F64x4, 2>;
    type Keys = [__m256i; 2];
    type Double = F64x4;
    type Single = F32x8;
    type Half = F32x8;
    const ROWS: usize = 4;
    const SIZED: bool = true;
    const PRODUCTS: bool = true;

    #[inline(always)]
    fn transpose(rows: [F64x4; 4]) -> [F64x4; 4] {
        transpose(rows)
    }
    #[inline(always)]
    fn halves(eight: Group<F64x4, 2>) -> [F64x4; 2] {
        eight.0
    }
    #[inline(always)]
    fn no_keys() -> Self::Keys {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { [_mm256_setzero_si256(); 2] }
    }
    #[inline(always)]
    fn set(keys: Self::Keys, bit: u64, [low, high]: [__m256d; 2]) -> Self::Keys {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe {
            let bit = _mm256_set1_epi64x(bit as i64);
            let (low, high) = (_mm256_castpd_si256(low), _mm256_castpd_si256(high));
            [
                _mm256_or_si256(keys[0], _mm256_and_si256(low, bit)),
                _mm256_or_si256(keys[1], _mm256_and_si256(high, bit)),
            ]
        }
    }
    #[inline(always)]
    fn keys(keys: Self::Keys) -> [u64; 8] {
        let mut out = [0; 8];
        // SAFETY: the caller is compiled for AVX2; writes the 8 words of `out`.
        unsafe {
            _mm256_storeu_si256(out.as_mut_ptr().cast(), keys[0]);
            _mm256_storeu_si256(out.as_mut_ptr().add(4).cast(), keys[1]);
        }
        out
    }
    #[inline(always)]
    fn load_keys(keys: &[u64; 8]) -> Self::Keys {
        let (low, high) = keys.split_at(4);
        // SAFETY: the caller is compiled for AVX2; reads the 8 words of `keys`.
        unsafe { [_mm256_loadu_si256(low.as_ptr().cast()), _mm256_loadu_si256(high.as_ptr().cast())] }
    }
    #[inline(always)]
    fn low(keys: Self::Keys) -> [u64; 2] {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe {
            // Words whose upper halves are zero: packed twice, within 128 bits.
            let both = _mm256_packus_epi32(keys[0], keys[1]);
            let both = _mm256_packus_epi32(both, both);
            let (low, high) = (_mm256_castsi256_si128(both), _mm256_extracti128_si256::<1>(both));
            let mixed = _mm_unpacklo_epi32(low, high);
            [_mm_cvtsi128_si64(mixed) as u64, _mm_extract_epi64::<1>(mixed) as u64]
        }
    }
    #[inline(always)]
    fn both(keys: Self::Keys, others: Self::Keys) -> Self::Keys {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { [_mm256_and_si256(keys[0], others[0]), _mm256_and_si256(keys[1], others[1])] }
    }
    #[inline(always)]
    fn all_keys(key: u64) -> Self::Keys {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { [_mm256_set1_epi64x(key as i64); 2] }
    }
    #[inline(always)]
    fn differ(keys: Self::Keys, others: Self::Keys) -> Self::Keys {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { [_mm256_xor_si256(keys[0], others[0]), _mm256_xor_si256(keys[1], others[1])] }
    }
    #[inline(always)]
    fn down<const BITS: u32>(keys: Self::Keys) -> Self::Keys {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe {
            [
                _mm256_srl_epi64(keys[0], _mm_cvtsi32_si128(BITS as i32)),
                _mm256_srl_epi64(keys[1], _mm_cvtsi32_si128(BITS as i32)),
            ]
        }
    }
    #[inline(always)]
    fn swap(keys: Self::Keys) -> Self::Keys {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { [_mm256_shuffle_epi32::<0xB1>(keys[0]), _mm256_shuffle_epi32::<0xB1>(keys[1])] }
    }
    #[inline(always)]
    fn product(keys: Self::Keys, others: Self::Keys) -> Self::Keys {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { [_mm256_mul_epu32(keys[0], others[0]), _mm256_mul_epu32(keys[1], others[1])] }
    }
    #[inline(always)]
    fn numbers(keys: Self::Keys) -> Self::Eight {
        // SAFETY: the caller is compiled for AVX2; registers alone.
        unsafe { Group([F64x4(_mm256_castsi256_pd(keys[0])), F64x4(_mm256_castsi256_pd(keys[1]))]) }
    }
    #[inline(always)]
    fn entries(table: &Entries, keys: Self::Keys) -> Self::Keys {
        let words: *const i32 = table.words().as_ptr().cast();
        // SAFETY: the caller is compiled for AVX2; the mask keeps indices within the table's keys, after which there is a
        // word more, so the 32 bits that are read from each lie in the table.
        unsafe {
            let (last, low) = (_mm256_set1_epi64x(table.last() as i64), _mm_set1_epi32(0xFFFF));
            let first = _mm256_i64gather_epi32::<2>(words, _mm256_and_si256(keys[0], last));
            let second = _mm256_i64gather_epi32::<2>(words, _mm256_and_si256(keys[1], last));
            [_mm256_cvtepu32_epi64(_mm_and_si128(first, low)), _mm256_cvtepu32_epi64(_mm_and_si128(second, low))]
        }
    }
}

/// AVX-512F and VL: one register for eight numbers, and compares that set bits of keys under a mask.
#[derive(Debug, Clone, Copy)]
pub struct Avx512;

impl Simd for Avx512 {
    type Four = F64x4;
    type Eight = F64x8;
    type Keys = __m512i;
    type Double = F64x8;
    type Single = F32x16;
    type Half = F32x8Masked;
    const ROWS: usize = 8;
    const SIZED: bool = true;
    const PRODUCTS: bool = true;

    #[inline(always)]
    fn transpose(rows: [F64x4; 4]) -> [F64x4; 4] {
        transpose(rows)
    }
    #[inline(always)]
    fn halves(F64x8(eight): F64x8) -> [F64x4; 2] {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { [F64x4(_mm512_castpd512_pd256(eight)), F64x4(_mm512_extractf64x4_pd::<1>(eight))] }
    }
    #[inline(always)]
    fn no_keys() -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { _mm512_setzero_si512() }
    }
    #[inline(always)]
    fn set(keys: __m512i, bit: u64, lanes: __mmask8) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { _mm512_mask_or_epi64(keys, lanes, keys, _mm512_set1_epi64(bit as i64)) }
    }
    #[inline(always)]
    fn keys(keys: __m512i) -> [u64; 8] {
        let mut out = [0; 8];
        // SAFETY: the caller is compiled for AVX-512F; writes the 8 words of `out`.
        unsafe { _mm512_storeu_si512(out.as_mut_ptr().cast(), keys) };
        out
    }
    #[inline(always)]
    fn load_keys(keys: &[u64; 8]) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; reads the 8 words of `keys`.
        unsafe { _mm512_loadu_si512(keys.as_ptr().cast()) }
    }
    #[inline(always)]
    fn low(keys: __m512i) -> [u64; 2] {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe {
            let words = _mm512_cvtepi64_epi16(keys);
            [_mm_cvtsi128_si64(words) as u64, _mm_extract_epi64::<1>(words) as u64]
        }
    }
    #[inline(always)]
    fn both(keys: __m512i, others: __m512i) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { _mm512_and_si512(keys, others) }
    }
    #[inline(always)]
    fn all_keys(key: u64) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { _mm512_set1_epi64(key as i64) }
    }
    #[inline(always)]
    fn differ(keys: __m512i, others: __m512i) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { _mm512_xor_si512(keys, others) }
    }
    #[inline(always)]
    fn down<const BITS: u32>(keys: __m512i) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { _mm512_srli_epi64::<BITS>(keys) }
    }
    #[inline(always)]
    fn swap(keys: __m512i) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { _mm512_rol_epi64::<32>(keys) }
    }
    #[inline(always)]
    fn product(keys: __m512i, others: __m512i) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { _mm512_mul_epu32(keys, others) }
    }
    #[inline(always)]
    fn numbers(keys: __m512i) -> F64x8 {
        // SAFETY: the caller is compiled for AVX-512F; registers alone.
        unsafe { F64x8(_mm512_castsi512_pd(keys)) }
    }
    #[inline(always)]
    fn entries(table: &Entries, keys: __m512i) -> __m512i {
        // SAFETY: the caller is compiled for AVX-512F; the mask keeps indices within the table's keys, after which there is
        // a word more, so the 32 bits that are read from each lie in the table.
        unsafe {
            let keys = _mm512_and_si512(keys, _mm512_set1_epi64(table.last() as i64));
            let found = _mm512_i64gather_epi32::<2>(keys, table.words().as_ptr().cast());
            _mm512_cvtepu32_epi64(_mm256_and_si256(found, _mm256_set1_epi32(0xFFFF)))
        }
    }
}

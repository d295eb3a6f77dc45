//! The registers and instructions of aarch64 processors: NEON, which every one of them has.
//!
//! The target guarantees the instructions, so all of this may be called anywhere.
#![allow(
    unused_unsafe,
    reason = "what the target guarantees is safe to call, but the macro is written for all targets"
)]

use std::arch::aarch64::*;

use super::group::Group;
use super::instructions::{Baseline, Simd, low};
use super::number::Number;
use super::register::register;

register!(
    /// Two numbers in a register.
    F64x2 float64x2_t f64 uint64x2_t 2 false: vaddq_f64 vsubq_f64 vmulq_f64 vdivq_f64
    plus_f64 minus_f64 vsqrtq_f64 vabsq_f64 vdupq_n_f64 vld1q_f64
    vst1q_f64 select_f64 mask_64 bits_64 larger_f64, vcltq_f64, vcleq_f64
);

register!(
    /// Four numbers in single precision.
    F32x4 float32x4_t f32 uint32x4_t 4 true: vaddq_f32 vsubq_f32 vmulq_f32 vdivq_f32
    plus_f32 minus_f32 vsqrtq_f32 vabsq_f32 vdupq_n_f32 vld1q_f32
    vst1q_f32 select_f32 mask_32 bits_32 larger_f32, vcltq_f32, vcleq_f32
);

/// x·y + to, to − x·y, rounded once, and a choice: the same instructions with their operands in another order. The
/// larger of two, the second where one is no number.
macro_rules! ordered {
    ($register:ident $mask:ident: $plus:ident $fma:ident, $minus:ident $fms:ident, $select:ident $bsl:ident,
     $larger:ident $above:ident) => {
        #[inline(always)]
        fn $plus(x: $register, y: $register, to: $register) -> $register {
            // SAFETY: the target has NEON; registers alone.
            unsafe { $fma(to, x, y) }
        }
        #[inline(always)]
        fn $minus(x: $register, y: $register, to: $register) -> $register {
            // SAFETY: the target has NEON; registers alone.
            unsafe { $fms(to, x, y) }
        }
        #[inline(always)]
        fn $select(mask: $mask, no: $register, yes: $register) -> $register {
            // SAFETY: the target has NEON; registers alone.
            unsafe { $bsl(mask, yes, no) }
        }
        #[inline(always)]
        fn $larger(a: $register, b: $register) -> $register {
            // SAFETY: the target has NEON; registers alone.
            unsafe { $bsl($above(a, b), a, b) }
        }
    };
}
ordered!(float64x2_t uint64x2_t: plus_f64 vfmaq_f64, minus_f64 vfmsq_f64, select_f64 vbslq_f64,
    larger_f64 vcgtq_f64);
ordered!(float32x4_t uint32x4_t: plus_f32 vfmaq_f32, minus_f32 vfmsq_f32, select_f32 vbslq_f32,
    larger_f32 vcgtq_f32);

/// A mask from its bits, and back.
#[inline(always)]
fn mask_64(bits: u16) -> uint64x2_t {
    let own = [1_u64, 2];
    // SAFETY: the target has NEON; reads the 2 words of `own`.
    unsafe { vtstq_u64(vdupq_n_u64(bits.into()), vld1q_u64(own.as_ptr())) }
}
#[inline(always)]
fn bits_64(mask: uint64x2_t) -> u16 {
    let own = [1_u64, 2];
    // SAFETY: the target has NEON; reads the 2 words of `own`.
    unsafe { vaddvq_u64(vandq_u64(mask, vld1q_u64(own.as_ptr()))) as u16 }
}
#[inline(always)]
fn mask_32(bits: u16) -> uint32x4_t {
    let own = [1_u32, 2, 4, 8];
    // SAFETY: the target has NEON; reads the 4 words of `own`.
    unsafe { vtstq_u32(vdupq_n_u32(bits.into()), vld1q_u32(own.as_ptr())) }
}
#[inline(always)]
fn bits_32(mask: uint32x4_t) -> u16 {
    let own = [1_u32, 2, 4, 8];
    // SAFETY: the target has NEON; reads the 4 words of `own`.
    unsafe { vaddvq_u32(vandq_u32(mask, vld1q_u32(own.as_ptr()))) as u16 }
}

impl Simd for Baseline {
    type Four = Group<F64x2, 2>;
    type Eight = Group<F64x2, 4>;
    type Keys = [uint64x2_t; 4];
    type Double = F64x2;
    type Single = F32x4;
    type Half = F32x4;
    const ROWS: usize = 4;
    const SIZED: bool = true;

    #[inline(always)]
    fn transpose([a, b, c, d]: [Self::Four; 4]) -> [Self::Four; 4] {
        // SAFETY: the target has NEON; registers alone.
        let pair = |x: F64x2, y: F64x2| unsafe { [F64x2(vzip1q_f64(x.0, y.0)), F64x2(vzip2q_f64(x.0, y.0))] };
        let [ab0, ab1] = pair(a.0[0], b.0[0]);
        let [ab2, ab3] = pair(a.0[1], b.0[1]);
        let [cd0, cd1] = pair(c.0[0], d.0[0]);
        let [cd2, cd3] = pair(c.0[1], d.0[1]);
        [Group([ab0, cd0]), Group([ab1, cd1]), Group([ab2, cd2]), Group([ab3, cd3])]
    }
    #[inline(always)]
    fn halves(Group([a, b, c, d]): Self::Eight) -> [Self::Four; 2] {
        [Group([a, b]), Group([c, d])]
    }
    #[inline(always)]
    fn no_keys() -> Self::Keys {
        // SAFETY: the target has NEON; registers alone.
        unsafe { [vdupq_n_u64(0); 4] }
    }
    #[inline(always)]
    fn set(mut keys: Self::Keys, bit: u64, lanes: [uint64x2_t; 4]) -> Self::Keys {
        for i in 0..4 {
            // SAFETY: the target has NEON; registers alone.
            keys[i] = unsafe { vorrq_u64(keys[i], vandq_u64(lanes[i], vdupq_n_u64(bit))) };
        }
        keys
    }
    #[inline(always)]
    fn keys(keys: Self::Keys) -> [u64; 8] {
        let mut out = [0; 8];
        for (pair, key) in out.as_chunks_mut::<2>().0.iter_mut().zip(keys) {
            // SAFETY: the target has NEON; writes the 2 words of the pair.
            unsafe { vst1q_u64(pair.as_mut_ptr(), key) };
        }
        out
    }
    #[inline(always)]
    fn load_keys(keys: &[u64; 8]) -> Self::Keys {
        // SAFETY: the target has NEON; reads the 2 words of each pair.
        std::array::from_fn(|i| unsafe { vld1q_u64(keys[2 * i..2 * i + 2].as_ptr()) })
    }
    #[inline(always)]
    fn low(keys: Self::Keys) -> [u64; 2] {
        low(Self::keys(keys))
    }
}

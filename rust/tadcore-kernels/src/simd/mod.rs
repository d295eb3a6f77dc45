//! Vector instructions: the only module with any, and the only one with unsafe code.
//!
//! A hot loop is written once over `Simd`, the instructions of a width, and its `Number`s, which are one number or
//! several side by side. `dispatch!` compiles it for every `Width`, and the processor decides at run time which runs.
//! Every operation is the IEEE one on each lane and none is fused with another but by name (`Number::plus`), so every
//! width is bitwise the same.
//!
//! | here | what it is |
//! |---|---|
//! | [`in_use`], `Width` | what the processor has, and what `TADCORE_SIMD` chose of it |
//! | `Number` | the arithmetic of one `f64` or `f32`, or of a register of them |
//! | `Simd`, `Baseline` | the registers of a width, and the few operations that are not lane by lane |
//! | `x86`, `neon` | the instructions, in registers made by one macro |
//! | `group` | several numbers as one, where a register holds fewer |
//! | `dispatch!`, `widened!` | functions compiled for each width |
//! | `Aligned`, `prefetch` | memory in cache lines |
//!
//! Why these are written by hand: `docs/decisions/0010-vector-registers.md`.

mod aligned;
mod dispatch;
mod group;
mod instructions;
#[cfg(target_arch = "aarch64")]
mod neon;
mod number;
mod one;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
mod register;
mod width;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use aligned::{Aligned, prefetch};
pub use dispatch::{dispatch, widened};
pub use instructions::{Baseline, Entries, Simd};
pub use number::{Number, Scalar, dot, dot_in_order, norm, sum_of_squares, take};
pub use width::Width;
pub use width::in_use;
#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

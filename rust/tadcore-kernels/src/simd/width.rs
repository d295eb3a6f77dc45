//! How wide the processor's vectors are.
//!
//! The environment variable `TADCORE_SIMD` (`baseline`, `avx2` or `avx512`) chooses a width below the widest, for tests
//! and benches. It is read once; what is no width, or none of this processor, is refused when a game is made.

use std::env;
use std::sync::OnceLock;

use crate::error::SimdError;

/// The variable that chooses.
const VARIABLE: &str = "TADCORE_SIMD";

/// The name of the width in use: the widest that this processor has, or the one that `TADCORE_SIMD` chose.
///
/// # Errors
/// [`SimdError`] when `TADCORE_SIMD` names no width, or one that this processor does not have.
pub fn in_use() -> Result<&'static str, SimdError> {
    Width::chosen().map(Width::name)
}

/// Which instructions the processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// Whatever the target guarantees.
    Baseline,
    /// 256 bits and fused operations; only made by [`Width::all`] after asking the processor.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 512 bits (AVX-512F and VL), and all of the above; only made by [`Width::all`].
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Width {
    /// What the environment variable may say, the narrowest first.
    pub const NAMES: [&str; 3] = ["baseline", "avx2", "avx512"];

    /// The width in use.
    pub fn chosen() -> Result<Self, SimdError> {
        static CHOSEN: OnceLock<Result<Width, SimdError>> = OnceLock::new();
        CHOSEN.get_or_init(|| Self::choose(env::var_os(VARIABLE).map(|v| v.to_string_lossy().into_owned()))).clone()
    }

    /// The width in use, where a game has been made already: it has checked that there is one.
    ///
    /// # Panics
    /// When `TADCORE_SIMD` cannot be followed and there is no game.
    pub fn in_use() -> Self {
        #[expect(clippy::panic, reason = "without a game nothing else can refuse, and nothing may ignore it")]
        Self::chosen().unwrap_or_else(|error| panic!("{error}"))
    }

    /// What the variable asks for; the widest if it asks for nothing.
    ///
    /// # Errors
    /// [`SimdError`] when it is no width, or one that this processor does not have.
    pub fn choose(wanted: Option<String>) -> Result<Self, SimdError> {
        let all = Self::all();
        let Some(value) = wanted.filter(|value| !value.is_empty()) else {
            return Ok(all.last().copied().unwrap_or(Self::Baseline));
        };
        let found = all.iter().copied().find(|width| width.name() == value);
        found.ok_or_else(|| {
            let available = all.into_iter().map(Self::name).collect();
            if Self::NAMES.contains(&value.as_str()) {
                SimdError::Absent { value, available }
            } else {
                SimdError::Unknown { value, allowed: &Self::NAMES, available }
            }
        })
    }

    /// Its name in the environment variable.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline => Self::NAMES[0],
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => Self::NAMES[1],
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => Self::NAMES[2],
        }
    }

    /// Every width that this processor has, the narrowest first.
    pub fn all() -> Vec<Self> {
        let known = [
            Self::Baseline,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512,
        ];
        known.into_iter().filter(|width| width.is_there()).collect()
    }

    /// Whether this processor has it.
    pub fn is_there(self) -> bool {
        match self {
            Self::Baseline => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_there()
                    && std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512vl")
            }
        }
    }
}

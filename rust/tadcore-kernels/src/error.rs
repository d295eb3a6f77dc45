//! What can go wrong with the processor.

use thiserror::Error;

/// `TADCORE_SIMD` asks for vectors that cannot be had.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SimdError {
    /// No width has this name.
    #[error(
        "TADCORE_SIMD is {value:?}, but it must be {} (or empty: the widest); this processor has {}",
        alternatives(allowed),
        available.join(", ")
    )]
    Unknown {
        /// What the variable says.
        value: String,
        /// What it may say.
        allowed: &'static [&'static str],
        /// The widths of this processor.
        available: Vec<&'static str>,
    },
    /// The processor does not have this width.
    #[error("TADCORE_SIMD is {value:?}, but this processor has only {}", available.join(", "))]
    Absent {
        /// What the variable says.
        value: String,
        /// The widths of this processor.
        available: Vec<&'static str>,
    },
}

/// a, b or c.
fn alternatives(words: &[&str]) -> String {
    match words {
        [first @ .., before, last] => {
            first.iter().map(|word| format!("{word}, ")).collect::<String>() + before + " or " + last
        }
        few => few.concat(),
    }
}

//! What can go wrong with the machine, and the caller's wish to stop.

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

/// The caller asked to stop, by the cancel token it passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("cancelled by the caller")]
pub struct Cancelled;

/// Memory that the system would not give, or that nothing may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{}", self.sentence())]
pub struct NoMemory {
    /// What asked for it.
    pub what: &'static str,
    /// Bytes asked for.
    pub bytes: u64,
    /// The limit that they exceed; `None` where the system refused.
    pub limit: Option<u64>,
}

impl NoMemory {
    fn sentence(&self) -> String {
        let Self { what, bytes, limit } = *self;
        let gib = |bytes: u64| bytes as f64 / (1u64 << 30) as f64;
        match limit {
            Some(limit) => {
                let (size, most) = (gib(bytes), gib(limit));
                format!("{what} would take {bytes} bytes ({size:.1} GiB), more than the limit of {most:.1} GiB")
            }
            None => format!("the system gave no {bytes} bytes for {what}"),
        }
    }
}

/// Why a computation ended before its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Stopped {
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// There was no memory.
    #[error(transparent)]
    Memory(#[from] NoMemory),
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

//! What can go wrong, one enum per layer, each variant with the numbers a reader needs.
//!
//! A *programming or input* error is an `Err`; the *outcome of a solve* (converged, iteration limit, …) is a
//! status inside an `Ok`. There is no catch-all variant.

pub use tadcore_kernels::error::{Cancelled, NoMemory, SimdError, Stopped};
use thiserror::Error;

/// A game, a position or a radius that cannot be accepted.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GameError {
    /// A number that breaks its rule.
    #[error("{field} is {value}, but it must be {rule}")]
    Value {
        /// The field, in the words of the scenario.
        field: String,
        /// The number found.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// An array of the wrong length.
    #[error("{field} has {found} entries, but it must have {expected}")]
    Length {
        /// The field, in the words of the scenario.
        field: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        expected: usize,
    },
    /// P on the grid would not fit into memory.
    #[error("P of {players} players at {steps} steps needs {gib} GiB, more than the limit of 16 GiB")]
    Size {
        /// N.
        players: usize,
        /// K.
        steps: usize,
        /// Whole gibibytes needed.
        gib: u64,
    },
    /// The step does not divide the horizon.
    #[error("step is {step}, but it must divide the horizon {horizon} into a whole number of steps")]
    Grid {
        /// T.
        horizon: f64,
        /// δ.
        step: f64,
    },
    /// The environment asks for vectors that cannot be had, so no game can be computed.
    #[error(transparent)]
    Simd(#[from] SimdError),
}

/// The Riccati equations could not give an equilibrium.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EquilibriumError {
    /// The solution escapes to infinity inside the horizon: the game has no feedback Nash equilibrium on [0, T].
    #[error(
        "no feedback Nash equilibrium on [0, {horizon}]: the Riccati solution escapes {escape_time} before the horizon; \
         an equilibrium exists for every horizon shorter than that"
    )]
    FiniteEscape {
        /// Time before the horizon at which the solution escapes (backward time): the supremum of the horizons for
        /// which an equilibrium exists.
        escape_time: f64,
        /// T.
        horizon: f64,
    },
    /// The integrator used up its budget of steps.
    #[error("the Riccati integrator took {steps} steps and came only {reached:?} of {horizon:?} back from the horizon")]
    StepBudget {
        /// Steps taken.
        steps: usize,
        /// Backward time reached.
        reached: f64,
        /// T.
        horizon: f64,
    },
    /// Rounding decides the solution.
    #[error(
        "the weights lie too far apart for double precision: the Riccati solution changes by {change:.0e} of itself when \
         the weights change by {nudge:.0e} of themselves"
    )]
    Undetermined {
        /// The largest relative change of a matrix or of the escape time, infinite where only one of two solutions escapes.
        change: f64,
        /// The relative change of the weights.
        nudge: f64,
    },
    /// The solution left the range of double precision.
    #[error("the Riccati solution leaves the range of double precision: the weights lie too far apart")]
    Range,
    /// There was no memory.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Bytes that are not a table of this game.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum TableError {
    /// Not a table at all.
    #[error("the bytes are not a saved table")]
    Foreign,
    /// Written in another format.
    #[error("the table has format {found}, but this version reads format {expected}")]
    Format {
        /// The format found.
        found: u32,
        /// The format that this version reads.
        expected: u32,
    },
    /// A table of other weights, another grid or another version.
    #[error("the table belongs to another game, or to another version of tadcore")]
    OtherGame,
    /// More than a table may hold.
    #[error("the table says that it has {found} entries, and a table of this game has at most {most}")]
    TooMany {
        /// The entries that it says it has.
        found: u64,
        /// Entries that fit into the bytes of a table.
        most: usize,
    },
    /// Cut short or changed.
    #[error("the table is damaged: its length or its checksum is wrong")]
    Damaged,
    /// There was no memory.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// A run or a batch could not be done.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RunError {
    /// Bad positions or radii.
    #[error(transparent)]
    Game(#[from] GameError),
    /// No equilibrium.
    #[error(transparent)]
    Equilibrium(#[from] EquilibriumError),
    /// A state left the range of double precision.
    #[error(
        "the game leaves the range of double precision by t = {time}: its feedback drives a player beyond all bounds"
    )]
    Range {
        /// The instant at which it was noticed.
        time: f64,
    },
    /// A cost left the range of double precision.
    #[error("a cost of the run up to t = {time} lies beyond the range of double precision")]
    Cost {
        /// The time of the end.
        time: f64,
    },
    /// A motion turns too often within one step for the crossings of a radius to be found.
    #[error(
        "within the step after t = {time} the players turn too often for crossings of a capture radius to be found: the \
         step is too long for these weights"
    )]
    Turns {
        /// The instant before the step.
        time: f64,
    },
    /// A network from outside could not be given.
    #[error("the network of the run could not be given at t = {time}")]
    Network {
        /// The instant at which it was asked for.
        time: f64,
    },
    /// The system gave no threads.
    #[error("threads is {0}, but the system would not start that many")]
    Threads(usize),
    /// There was no memory.
    #[error(transparent)]
    Memory(#[from] NoMemory),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<Stopped> for EquilibriumError {
    fn from(stopped: Stopped) -> Self {
        match stopped {
            Stopped::Cancelled(cancelled) => cancelled.into(),
            Stopped::Memory(none) => none.into(),
        }
    }
}

impl From<Stopped> for RunError {
    fn from(stopped: Stopped) -> Self {
        match stopped {
            Stopped::Cancelled(cancelled) => cancelled.into(),
            Stopped::Memory(none) => none.into(),
        }
    }
}

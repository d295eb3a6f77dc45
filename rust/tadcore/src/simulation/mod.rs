//! One run of a game: at t_k termination, then the network, then the gains, then one exact step (spec order).
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | z | rows of state relative to the attacker | d₁…d_n, target |
//! | σ | [`Reach`] | capture radii |
//! | ζ | [`Setup::visibility`] | visibility radii |
//!
//! A game that [diverges](divergence) is played on, and says so.
//!
//! The sampled-data reading of the paper: feedback and network are held between grid instants
//! (zero-order hold), the motion is exact.

pub(crate) mod crossing;
pub mod divergence;
mod outcome;
pub(crate) mod passes;
mod record;
mod setup;
mod state;

pub use divergence::DIVERGED;
pub use outcome::{Outcome, Reach};
pub use passes::{Pass, Termination};
pub use record::{Divergence, Record, simulate, simulate_with};
pub use setup::Setup;
pub(crate) use state::apply;
pub use state::relative_state;

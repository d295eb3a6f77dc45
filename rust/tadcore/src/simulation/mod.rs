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

mod course;
pub(crate) mod crossing;
mod disturbance;
pub mod divergence;
mod motion;
mod near;
mod outcome;
pub(crate) mod passes;
mod play;
mod record;
mod setup;
mod state;
mod world;

pub use course::{Course, Moment, Outside, State};
pub use divergence::{DIVERGED, Divergence};
pub use outcome::{Outcome, Reach};
pub use passes::{Pass, Termination};
pub use play::{Rules, simulate, simulate_with};
pub use record::Record;
pub use setup::Setup;
pub use state::relative_state;
pub(crate) use state::{acted_on, apply};
pub use world::{Chances, Communication, Conditions, World};

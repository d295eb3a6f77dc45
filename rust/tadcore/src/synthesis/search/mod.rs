//! From the canonical start to the global minimum: which descents are made, and when no more are needed.
//!
//! 0. Where every constrained player sees everyone nothing: the canonical start is the equilibrium, with Θ = 0.
//! 1. Newton from the canonical start. Most networks end here: the certificate of `theta` proves the minimum global (of
//!    random networks, about four in five at n = 3 and three in five at n = 5).
//! 2. Otherwise two restarts: a descent in complex gains and one in stacked gains, both from the canonical start with a
//!    fixed pattern of a second part B as large as the gains. Each descends without long jumps between basins and comes
//!    back to the real gains A, A + B and A − B, from where Newton finishes.
//! 3. Further restarts: Newton from the best point with rows and gains reversed, and rows exchanged, again while that goes
//!    lower: GᵀRG sees neither the sign of a row of √R·G nor whose it is, so minima come in families (`moves`).
//! 4. Where the parts of Θ differ by decades from player to player, Newton to the end for each of them (`refine`).
//! 5. With next to no weight on S, or none, the stages above are those of two other Θ, from whose minima the weight is
//!    lowered to γ's own: without any, which of equal minima is taken (`settle`).
//! 6. Where γ₁ dominates, for what is not certified: a second search with heavier other weights, which are then lowered to
//!    γ's own (`heavier`), and starts that fit GᵀRG to M player by player (`fits`).
//!
//! Games of N > 8 have a search of their own with the same stages, whose restarts a model of Θ chooses (`large`).
//!
//! Most restarts lead back to the best point or to a higher one. Where descents go side by side they are made in single
//! precision first, twice as many to a register, and what that leaves undecided goes on in double from there; doubled
//! gains stay in single precision. No gain, no Θ and no certificate comes from single precision.
//!
//! The lowest Θ is kept; a restart must win by more than rounding, so ties go to the earliest. The networks of one
//! instant go through these stages together, their descents side by side; the incumbent that lets a descent end early
//! is the best point before its stage, so no network's answer depends on which others were asked for. Everything here
//! is a function of (t_k, topology) alone. How often each stage is needed: `docs/decisions/0003-synthesis.md`
//! and `0016-exchanged-rows.md`.
//!
//! In this order, each file using those above it:
//!
//! | module | what it knows |
//! |---|---|
//! | `start` | the canonical start and the variables that a network leaves free |
//! | `blocks` | whether a certificate covers the paper's gains in blocks |
//! | `candidate` | a network that is being solved, and the best gains found so far |
//! | `dispatch` | a list of descents made as wide as the processor allows |
//! | `gradient` | the paper's gradient descent, as a second method |
//! | `moves` | restarts from the best point: rows and gains reversed, rows exchanged |
//! | `stages` | the stages above |
//! | `continued` | Newton's method from near a minimum of another instant |
//! | `large` | the same for large games |
//! | `refine` | the end of the search where players differ by decades |
//! | `fits` | starts that fit GᵀRG to M player by player |
//! | `heavier` | a second search where γ₁ dominates |
//! | `turning` | the search in gains that turn |
//! | `settle` | the search where S has next to no weight, and which of equal minima is taken where it has none |

mod blocks;
mod candidate;
mod continued;
mod fits;
mod gradient;
mod heavier;
mod large;
mod moves;
mod refine;
mod settle;
mod stages;
mod start;
mod turning;

pub(crate) use blocks::covers_blocks;
pub use candidate::Start;
pub(crate) use candidate::{Candidate, admit};
#[cfg(test)]
pub(crate) use dispatch::Kind;
pub(crate) use dispatch::{Dispatcher, SIDE_BY_SIDE_UP_TO};
#[cfg(test)]
pub(crate) use fits::fits;
pub(crate) use gradient::descend;
#[cfg(test)]
pub(crate) use moves::Moves;
pub(crate) use stages::Search;
#[cfg(test)]
pub(crate) use stages::{BASIN, DOUBLED_ITERATIONS, LONGEST_STEP, far_start};
pub(crate) use start::{canonical, paper_variables, variables};
pub(crate) use tadcore_kernels::synthesis::search::dispatch;

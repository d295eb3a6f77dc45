//! Many small descents side by side: Newton's method on functions of gains that are given by their derivatives.
//!
//! Nothing here knows of games, networks or Θ. In this order, each file using those above it:
//!
//! | module | what it knows |
//! |---|---|
//! | `variables` | directions in the space of the gains |
//! | `layout` | the unknowns of several descents side by side; forms restricted to them |
//! | `tile`, `factor`, `factor_one` | factorisation of small symmetric matrices, and the solves that go with it |
//! | `tasks` | lists of descents: where they start, what they reached |
//! | `workspace` | scratch memory |
//! | `objective` | what a function to be minimised must give |
//! | `minimise` | the descents |

mod factor;
mod factor_one;
mod layout;
mod minimise;
mod objective;
mod tasks;
mod tile;
mod variables;
mod workspace;

pub use factor::{BLOCK, BLOCKED_SIZE, Backend, LIBRARY_SIZE, back, factorise, forward};
pub use layout::packed;
pub use layout::{Form, GROUP, Layout, Slot};
pub use minimise::{minimise, unknowns};
pub use objective::Objective;
pub use tasks::Status;
pub use tasks::{Incumbent, Limits, Owner, Reached, Tasks};
pub use variables::{Variable, advance, balance};
pub use workspace::Workspace;

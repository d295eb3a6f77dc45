//! What the synthesis minimises: Θ of one instant as a function of the gains, with its gradient and its exact Hessian.
//!
//! Nothing here knows which entries a network leaves free. In this order, each file using those above it:
//!
//! | module | what it knows |
//! |---|---|
//! | `coefficients` | the numbers of one instant, in double or in single precision |
//! | `problem` | the same from a game and its Riccati matrices |
//! | `real` | Θ over the gains, and the certificate of a global minimum |
//! | `doubled` | Θ over twice as many gains, complex or stacked |

mod coefficients;
mod doubled;
mod problem;
mod real;

pub(crate) use coefficients::{Parts, Precisions};
pub(crate) use doubled::Doubled;
pub use problem::Problem;
pub(crate) use real::{Certificate, RealGains};

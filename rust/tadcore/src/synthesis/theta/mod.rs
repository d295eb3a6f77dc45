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
//! | `terms` | its terms one by one |
//! | `tabled` | Θ over the gains of one network of a large game |

mod problem;
mod tabled;
mod terms;

pub use problem::Problem;
pub(crate) use tabled::{Scratch, Tabled, TabledCertificate, TabledParts};
#[cfg(test)]
pub(crate) use tadcore_kernels::synthesis::theta::Doubled;
pub(crate) use tadcore_kernels::synthesis::theta::{Coefficients, Precisions, RealGains, Scale, TABULATED_UP_TO};

//! Θ over the gains.

mod coefficients;
mod doubled;
mod real;

pub use coefficients::{Coefficients, Precisions, Scale};
pub use doubled::Doubled;
pub use real::{Certificate, RealGains};

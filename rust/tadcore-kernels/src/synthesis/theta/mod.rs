//! Θ over the gains.

mod coefficients;
mod doubled;
mod real;

pub use coefficients::{Coefficients, Precisions, Scale, TABULATED_UP_TO};
pub use doubled::Doubled;
pub use real::{Certificate, Parts, RealGains};

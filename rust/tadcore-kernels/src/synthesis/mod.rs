//! Descents on Θ.

pub mod newton;
pub mod search;
pub mod theta;

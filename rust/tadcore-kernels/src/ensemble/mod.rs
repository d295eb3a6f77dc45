//! Steps of eight trials at a time.

pub mod anysize;
pub mod strip;
pub mod sweep;

//! Steps of eight trials at a time.

pub mod anysize;
pub mod block;
pub mod eight;
pub mod network;
pub mod sweep;

//! Lists of descents, made as wide as the processor allows.

pub mod dispatch;

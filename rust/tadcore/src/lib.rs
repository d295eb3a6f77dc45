//! tadcore: target-attacker-defender differential games with limited observations.
pub mod cancel;
pub mod error;
pub mod game;
pub mod network;
pub mod riccati;
pub mod synthesis;

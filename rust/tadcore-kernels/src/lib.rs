//! The loops of tadcore that are compiled for many sizes and widths: they take minutes to compile and seldom change.
//!
//! No interface of its own: [`tadcore`](../tadcore/index.html) is, and its modules of the same names tell what these are
//! for. Two crates, because a crate is what is compiled anew when a line of it changes, and one crate is compiled while
//! another waits for nothing but what it declares. Whatever is generic here and hot is called through a function that is
//! not, so that it is compiled here; nothing here knows a game or a network.

#![allow(
    missing_docs,
    clippy::len_without_is_empty,
    reason = "not an interface: nothing is said or made that no one needs"
)]

pub mod cancel;
pub mod ensemble;
pub mod error;
pub mod memory;
pub mod policy;
pub mod simd;
pub mod synthesis;

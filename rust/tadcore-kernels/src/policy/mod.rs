//! The transitions of one instant, by the words of a topology.

mod hash_table;
pub mod index;
pub mod step_table;

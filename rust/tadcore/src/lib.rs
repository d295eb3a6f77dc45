//! # tadcore
//!
//! Target–attacker–defender differential games with limited observations, after Singh and Reddy, *Dynamic network
//! analysis of a target defense differential game with limited observations*.
//!
//! A target flees an attacker; defenders try to intercept the attacker first. Defenders (and in interaction I2 the
//! target) see only what lies within their visibility radius. This crate computes the feedback Nash equilibrium, the
//! network-adapted gains of the players that see too little, single recorded runs and large ensembles of runs. It knows
//! nothing of Python; the bindings live in a crate of their own.
//!
//! ## One run
//!
//! ```
//! use tadcore::cancel::CancelToken;
//! use tadcore::game::{Interaction, bank};
//! use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
//! use tadcore::simulation::{Outcome, Setup, simulate};
//!
//! let game = bank::paper_game(Interaction::I1, 1.0)?; // or Game::new with weights and a grid of your own
//! let start = bank::paper_i1_limited();
//! let positions = start.positions.concat();
//! let setup = Setup { dim: 2, positions: &positions, visibility: &start.visibility, capture: &start.capture };
//!
//! let cancel = CancelToken::new();
//! let policy = Policy::new(game, DEFAULT_TABLE_BYTES, &cancel)?; // solves the equilibrium; shared by all runs
//! let run = simulate(&policy, &setup, &cancel)?;
//! assert_eq!(run.outcome, Outcome::Intercepted(0)); // d1, at t = 279 · 0.005 = 1.395 as printed in the paper
//! assert_eq!(run.steps, 279);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `cargo run --release --example run` tells this run as it happens, `--example ensemble` plays many games at once.
//!
//! ## Layers
//!
//! Each layer uses only layers above it in this table (asserted by a test).
//!
//! | layer | what it knows |
//! |---|---|
//! | [`error`], [`cancel`], [`memory`] | failures with their numbers; the flag that stops a computation; memory asked for |
//! | [`simd`] | vector instructions; loops compiled for each width of the registers |
//! | [`random`] | numbers as a function of seed, trial, purpose, entity and index |
//! | [`game`] | weights, horizon and grid, checked; reference games |
//! | [`riccati`] | P on the grid, escape times, equilibrium feedback |
//! | [`network`] | who sees whom, what fails, who is told; what each player may use |
//! | [`synthesis`] | the gains at one (instant, topology) |
//! | [`policy`] | closed loop, one-step transition, the shared (step, topology) table |
//! | [`simulation`] | one recorded run |
//! | [`cost`] | J of every player along a run |
//! | [`ensemble`] | many runs, outcomes only |
//! | [`cells`] | boxes of starts from which every game ends alike, with proof |
//!
//! What is compiled for many sizes and widths, and therefore takes long, is a crate of its own, `tadcore-kernels`, with
//! modules of the same names: `cancel`, `memory`, `simd`, and of `synthesis`, `policy` and `ensemble` what knows no game and no network.
//!
//! ## Reduced matrices
//!
//! Every weight of the paper is a scalar times **I**₂, so every matrix is a small factor ⊗ **I**₂ and only the factor is
//! computed with: N × N instead of 2N × 2N, N = n + 1. The number of axes never enters a solve; the plane and space use
//! the same game.
//!
//! ## Small and large games
//!
//! Up to N = 8 kernels are compiled for their size and live on the stack (nalgebra where a matrix type helps); larger
//! games use faer's blocked kernels, single-threaded. Each module that switches says why, by measurement.

pub mod cells;
pub mod cost;
pub mod ensemble;
pub mod error;
pub mod game;
pub mod network;
pub mod policy;
pub mod random;
pub mod riccati;
pub mod simulation;
pub mod synthesis;

pub use tadcore_kernels::{cancel, memory, simd};

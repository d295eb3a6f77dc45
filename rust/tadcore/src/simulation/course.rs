//! What happens to sight along one run: what fails, who is told, and a network that comes from outside.

use super::disturbance;
use super::world::{Chances, Conditions};
use crate::error::{NoMemory, RunError};
use crate::game::Game;
use crate::memory::{append, reserve};
use crate::network::{Kind, Topology};
use crate::random::{Draws, Walk};

/// What asks for memory here.
pub(super) const WHAT: &str = "the record of one run";

/// An instant, as a network from outside is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// k.
    pub step: usize,
    /// t_k.
    pub time: f64,
    /// Positions, (n + 2) × dim.
    pub positions: &'a [f64],
    /// Who sees whom: what is left of the sight where something fails.
    pub seen: &'a Topology,
}

/// A network from outside, in the place of what is seen; none where it could not be given, which ends the run.
pub type Outside<'a> = dyn FnMut(&Moment) -> Option<Topology> + 'a;

/// What a run in a world records beside its network, row by row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Course {
    /// Who saw whom: m × N. The network in force is what became of it by links, or from outside.
    pub seen: Vec<Topology>,
    /// What was up, and who was heard; empty without a world.
    pub states: Vec<State>,
    /// Displacements after the step from each row, (L + 1) × (n + 2) × dim, the last row 0; empty without a world.
    pub displacement: Vec<f64>,
}

/// What was up at one instant, and who was heard.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Sensors that worked, in a row.
    pub sensors: Topology,
    /// Edges that were detected where they were within sight, m × N.
    pub edges: Topology,
    /// Who heard whom, m × m, the diagonal empty.
    pub heard: Topology,
}

impl Course {
    /// Bytes of one row at most.
    pub(super) fn bytes(game: &Game, dim: usize) -> u128 {
        let (n, m) = (game.size() as u128, game.constrained() as u128);
        8 * (n + 1) * dim as u128 + 4 * size_of::<Topology>() as u128 + (2 * m * n + m * m) / 8
    }

    /// Adds a row.
    pub(super) fn push(&mut self, seen: &Topology, present: Option<&Present>) -> Result<(), NoMemory> {
        reserve(WHAT, &mut self.seen, 1)?;
        self.seen.push(seen.clone());
        if let Some(present) = present {
            reserve(WHAT, &mut self.states, 1)?;
            self.states.push(present.state.clone());
            append(WHAT, &mut self.displacement, &vec![0.0; present.added.len()])?;
        }
        Ok(())
    }

    /// Notes what is added to the positions after the step from the last row.
    pub(super) fn note(&mut self, added: &[f64]) {
        let last = self.displacement.len() - added.len();
        self.displacement[last..].copy_from_slice(added);
    }

    /// Takes the last row back.
    pub(super) fn pop(&mut self, row: usize) {
        self.seen.pop();
        self.states.pop();
        self.displacement.truncate(self.displacement.len().saturating_sub(row));
    }
}

/// A world as one run meets it.
pub(super) struct Present {
    conditions: Conditions,
    draws: Draws,
    walks: Vec<Walk>,
    due: i32,
    /// Edges and links that are up.
    up: (Topology, Topology),
    state: State,
    added: Vec<f64>,
    dim: usize,
}

impl Present {
    pub(super) fn new(chances: &Chances, game: &Game, dim: usize) -> Result<Self, RunError> {
        let conditions = chances.conditions(game, 1)?;
        let (m, n) = (game.constrained(), game.size());
        let draws = chances.draws(0);
        let mut walks = vec![Walk::default(); conditions.failures.len()];
        conditions.failures.begin(&draws, &mut walks);
        let (edges, links) = (Topology::complete(m, n), Topology::complete(m, m));
        let state = State { sensors: Topology::complete(1, m), edges: edges.clone(), heard: Topology::empty(m, m) };
        let added = vec![0.0; (n + 1) * dim];
        Ok(Self { conditions, draws, walks, due: 0, up: (edges, links), state, added, dim })
    }

    /// Moves what fails on to step k: leaves of the sight what is seen, and gives the network that comes of it.
    pub(super) fn network(&mut self, k: usize, z: &[f64], seen: &mut Topology) -> Topology {
        let (failures, k) = (&self.conditions.failures, k as i32);
        if self.due <= k {
            self.due = failures.advance(&self.draws, k, &mut self.walks);
            let (m, n) = (seen.rows(), seen.size());
            self.up = (Topology::complete(m, n), Topology::complete(m, m));
            failures.mask(&self.walks, &mut self.up.0, &mut self.up.1);
            (self.state.sensors, self.state.edges) = (Topology::complete(1, m), Topology::complete(m, n));
            for kind in failures.down(&self.walks) {
                match kind {
                    Kind::Sensor(i) => self.state.sensors.unset(0, i),
                    Kind::Edge(i, j) => self.state.edges.unset(i, j),
                    Kind::Link(..) => {}
                }
            }
        }
        seen.keep(&self.up.0);
        let Some(links) = &self.conditions.links else { return seen.clone() };
        links.heard(z, self.dim, &mut self.state.heard);
        self.state.heard.keep(&self.up.1);
        links.told(seen, &self.state.heard)
    }

    /// Whether anybody is disturbed.
    pub(super) fn shakes(&self) -> bool {
        self.conditions.spread.is_some()
    }

    /// Shakes the state after the step from t_k; what was added.
    pub(super) fn shake(&mut self, k: usize, z: &mut [f64], attacker: &mut [f64]) -> &[f64] {
        if let Some(spread) = &self.conditions.spread {
            disturbance::draw(spread, &self.draws, k, self.dim, &mut self.added);
            disturbance::shake(&self.added, self.dim, z, attacker);
        }
        &self.added
    }
}

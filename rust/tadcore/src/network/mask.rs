//! What fails: sensors, edges and links that are up or down, each a chain of its own.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | sensor_i | [`Kind::Sensor`] | whether player i sees anything at all |
//! | edge_ij | [`Kind::Edge`] | whether player i detects j (j = i: the attacker), where it is within sight |
//! | i ← j | [`Kind::Link`] | whether i hears j, where it is within reach |
//! | mask_ij = sensor_i ∧ edge_ij | [`Failures::mask`] | what of the sight is left |
//! | U, D | [`Failures::new`] | mean times up and down |
//!
//! Only chains that can change are kept: without failures there are none, and nothing is drawn.

use super::Topology;
use crate::random::{Chain, Draws, NEVER, Purpose, Walk};

/// What a chain belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The sensor of a player.
    Sensor(usize),
    /// The edge from a player to another one, or to the attacker where both are the same.
    Edge(usize, usize),
    /// What a player hears of another one.
    Link(usize, usize),
}

/// All chains of a world that can change, in the game of one team.
#[derive(Debug, Clone, PartialEq)]
pub struct Failures {
    /// m.
    rows: usize,
    /// N.
    size: usize,
    chains: Vec<(Kind, Chain)>,
}

impl Failures {
    /// The chains of m players among N: `sensor` and `edge` one for each player, `link` one for each speaker, if any are
    /// there.
    #[must_use]
    pub fn new(size: usize, sensor: &[Chain], edge: &[Chain], link: Option<&[Chain]>) -> Self {
        let rows = sensor.len();
        let mut chains: Vec<(Kind, Chain)> =
            sensor.iter().enumerate().map(|(i, &chain)| (Kind::Sensor(i), chain)).collect();
        let pairs = |i: usize, width: usize| (0..width).map(move |j| (i, j));
        let edges = edge.iter().enumerate().filter(|(_, chain)| !chain.is_always_up());
        chains.extend(edges.flat_map(|(i, &chain)| pairs(i, size).map(move |(i, j)| (Kind::Edge(i, j), chain))));
        if let Some(link) = link {
            let heard = (0..rows).flat_map(|i| pairs(i, rows)).filter(|(i, j)| i != j);
            chains.extend(heard.map(|(i, j)| (Kind::Link(i, j), link[j])));
        }
        chains.retain(|(_, chain)| !chain.is_always_up());
        Self { rows, size, chains }
    }

    /// Chains that can change.
    #[must_use]
    pub fn len(&self) -> usize {
        self.chains.len()
    }

    /// Whether nothing can fail.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.chains.is_empty()
    }

    /// Whether sight can fail: a sensor or an edge.
    #[must_use]
    pub fn blind(&self) -> bool {
        self.chains.iter().any(|(kind, _)| !matches!(kind, Kind::Link(..)))
    }

    /// Whether a link can fail.
    #[must_use]
    pub fn silence(&self) -> bool {
        self.chains.iter().any(|(kind, _)| matches!(kind, Kind::Link(..)))
    }

    /// The purpose and the entity of a chain's numbers.
    fn place(&self, kind: Kind) -> (Purpose, u32) {
        let (purpose, entity) = match kind {
            Kind::Sensor(i) => (Purpose::Sensor, i),
            Kind::Edge(i, j) => (Purpose::Edge, i * self.size + j),
            Kind::Link(i, j) => (Purpose::Link, i * self.rows + j),
        };
        (purpose, entity as u32)
    }

    /// The numbers of a chain in one trial, by index.
    fn uniform(&self, kind: Kind, draws: &Draws) -> impl Fn(u32) -> f64 + use<> {
        let ((purpose, entity), draws) = (self.place(kind), *draws);
        move |index| draws.uniforms(purpose, entity, index)[0]
    }

    /// What each chain belongs to.
    pub(crate) fn kinds(&self) -> impl Iterator<Item = Kind> + '_ {
        self.chains.iter().map(|&(kind, _)| kind)
    }

    /// The law of each chain, with the entity of its numbers and the bits of their purpose.
    pub(crate) fn laws(&self) -> impl Iterator<Item = (Chain, (u32, u32))> + '_ {
        self.chains.iter().map(|&(kind, chain)| {
            let (purpose, entity) = self.place(kind);
            (chain, (entity, purpose.bits()))
        })
    }

    /// Writes the chains of a trial at step 0; the step at which one changes next.
    pub fn begin(&self, draws: &Draws, walks: &mut [Walk]) -> i32 {
        let mut next = NEVER;
        for (walk, (kind, chain)) in walks.iter_mut().zip(&self.chains) {
            *walk = Walk::new(chain, self.uniform(*kind, draws));
            next = next.min(walk.next());
        }
        next
    }

    /// Moves the chains of a trial on to step k; the step at which one changes next.
    pub fn advance(&self, draws: &Draws, k: i32, walks: &mut [Walk]) -> i32 {
        let mut next = NEVER;
        for (walk, (kind, chain)) in walks.iter_mut().zip(&self.chains) {
            if walk.next() <= k {
                walk.advance(chain, k, self.uniform(*kind, draws));
            }
            next = next.min(walk.next());
        }
        next
    }

    /// Clears what is down in `seen` (m × N) and in `heard` (m × m).
    pub fn mask(&self, walks: &[Walk], seen: &mut Topology, heard: &mut Topology) {
        for (walk, &(kind, _)) in walks.iter().zip(&self.chains) {
            if walk.is_up() {
                continue;
            }
            match kind {
                Kind::Sensor(i) => (0..self.size).for_each(|j| seen.unset(i, j)),
                Kind::Edge(i, j) => seen.unset(i, j),
                Kind::Link(i, j) => heard.unset(i, j),
            }
        }
    }

    /// What is down, chain by chain.
    pub fn down<'a>(&'a self, walks: &'a [Walk]) -> impl Iterator<Item = Kind> + 'a {
        walks.iter().zip(&self.chains).filter(|(walk, _)| !walk.is_up()).map(|(_, &(kind, _))| kind)
    }
}

//! Who is told: players that hear one another share what their sensors measure.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | ρ_j | `radius` of [`Links::new`] | how far player j is heard; infinite, or none where it sends nothing |
//! | L_ij | [`Links::heard`] | whether i hears j: ‖z_i − z_j‖ ≤ ρ_j (a closed ball), and the link is up |
//! | H_i | [`Links::told`] | whose reports reach i, over at most so many relays; itself included |
//! | E_i | [`Links::told`] | undirected edges {m q}: m ∈ H_i sees q, a player or the attacker |
//! | 𝒜_i | [`Links::told`] | the component of i in E_i, as a row |
//!
//! Who is told z_j − z_i by a chain of differences may use it as if it saw j: the row space of 𝓘_i is spanned by the
//! component. Where members know their own places in a common frame, E_i also joins i to every m ∈ H_i. There is no delay.

use super::Topology;
use super::sight::{squared_distance, squared_reach};

/// What players know of their own places.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Frame {
    /// Nothing but what sensors measure.
    #[default]
    Relative,
    /// Each its own, in a frame that all share, and they report it.
    Common,
}

/// How a team talks.
#[derive(Debug, Clone, PartialEq)]
pub struct Links {
    /// Squared reaches.
    reach: Vec<f64>,
    /// Most players between.
    relays: usize,
    frame: Frame,
}

impl Links {
    /// Links of m players with radii ρ, none where a player sends nothing; with at most `relays` players between, or any
    /// number.
    #[must_use]
    pub fn new(radius: &[Option<f64>], relays: Option<usize>, frame: Frame) -> Self {
        let reach: Vec<f64> = radius.iter().map(|rho| rho.map_or(-1.0, squared_reach)).collect();
        Self { relays: relays.unwrap_or(usize::MAX).min(reach.len()), reach, frame }
    }

    /// Squared reaches, m: −1 where a player sends nothing.
    #[must_use]
    pub fn reach(&self) -> &[f64] {
        &self.reach
    }

    /// Writes who hears whom at the state `z` into `heard` (m × m, the diagonal empty), links all up.
    pub fn heard(&self, z: &[f64], dim: usize, heard: &mut Topology) {
        heard.clear();
        let m = self.reach.len();
        for i in 0..m {
            for j in (0..m).filter(|&j| j != i) {
                let d2 = squared_distance(&z[i * dim..(i + 1) * dim], &z[j * dim..(j + 1) * dim]);
                if d2 <= self.reach[j] {
                    heard.set(i, j);
                }
            }
        }
    }

    /// 𝒜 from what is seen (m × N) and who hears whom (m × m).
    #[must_use]
    pub fn told(&self, seen: &Topology, heard: &Topology) -> Topology {
        // A node more than players, for the attacker.
        if seen.size() < 64 {
            self.told_by(seen, heard, &mut [[0_u64; 64]; 2].each_mut().map(|list| &mut list[..]))
        } else {
            let mut lists = [vec![Vec::new(); seen.rows()], vec![Vec::new(); seen.rows()]];
            self.told_by(seen, heard, &mut lists.each_mut().map(|list| &mut list[..]))
        }
    }

    /// The same by sets of one kind; room for two of each player.
    fn told_by<S: Set>(&self, seen: &Topology, heard: &Topology, [stars, direct]: &mut [&mut [S]; 2]) -> Topology {
        let (m, n) = (seen.rows(), seen.size());
        for i in 0..m {
            // What a player sees, and itself; the attacker is node N.
            stars[i] = S::row(seen, i, n + 1);
            if stars[i].has(i) {
                stars[i].add(n);
            }
            stars[i].add(i);
            direct[i] = S::row(heard, i, m);
        }
        let mut told = Topology::empty(m, n);
        for i in 0..m {
            let mut speakers = direct[i].clone();
            speakers.add(i);
            for _ in 0..self.relays {
                let mut further = speakers.clone();
                (0..m).filter(|&j| speakers.has(j)).for_each(|j| further.join(&direct[j]));
                if further == speakers {
                    break;
                }
                speakers = further;
            }
            let mut component = stars[i].clone();
            if self.frame == Frame::Common {
                (0..m).filter(|&j| speakers.has(j)).for_each(|j| component.add(j));
            }
            loop {
                let before = component.clone();
                for j in (0..m).filter(|&j| speakers.has(j)) {
                    if stars[j].meets(&component) {
                        component.join(&stars[j]);
                    }
                }
                if component == before {
                    break;
                }
            }
            for j in 0..n {
                if component.has(if j == i { n } else { j }) {
                    told.set(i, j);
                }
            }
        }
        told
    }
}

/// A set of nodes: a word, or as many as it takes.
trait Set: Clone + PartialEq {
    /// Row i of a network, with room for `nodes`.
    fn row(topology: &Topology, i: usize, nodes: usize) -> Self;
    fn add(&mut self, node: usize);
    fn has(&self, node: usize) -> bool;
    fn join(&mut self, other: &Self);
    fn meets(&self, other: &Self) -> bool;
}

impl Set for u64 {
    #[inline]
    fn row(topology: &Topology, i: usize, _: usize) -> Self {
        topology.row(i)
    }
    #[inline]
    fn add(&mut self, node: usize) {
        *self |= 1 << node;
    }
    #[inline]
    fn has(&self, node: usize) -> bool {
        self >> node & 1 == 1
    }
    #[inline]
    fn join(&mut self, other: &Self) {
        *self |= other;
    }
    #[inline]
    fn meets(&self, other: &Self) -> bool {
        self & other != 0
    }
}

impl Set for Vec<u64> {
    fn row(topology: &Topology, i: usize, nodes: usize) -> Self {
        let mut set = vec![0; nodes.div_ceil(64)];
        (0..topology.size()).filter(|&j| topology.sees(i, j)).for_each(|j| set.add(j));
        set
    }
    fn add(&mut self, node: usize) {
        self[node / 64] |= 1 << (node % 64);
    }
    fn has(&self, node: usize) -> bool {
        self[node / 64] >> (node % 64) & 1 == 1
    }
    fn join(&mut self, other: &Self) {
        self.iter_mut().zip(other).for_each(|(a, b)| *a |= b);
    }
    fn meets(&self, other: &Self) -> bool {
        self.iter().zip(other).any(|(a, b)| a & b != 0)
    }
}

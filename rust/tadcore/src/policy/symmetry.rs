//! Symmetry classes of players: topologies that differ by a relabelling of equal players share one answer.
//!
//! Defenders with the same weights may change places. A relabelling of them carries the gains of one topology into
//! those of another, and the transition with them, so one synthesis serves all. Which one is solved, the *canonical
//! form*, is a function of the topology alone, whoever asks: defenders of a class in the order of whom they see, then
//! of colours. Between a topology and its canonical form nothing is computed, numbers only change their places, so the
//! answer has the same bits on every way there.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | π | an order | player i of the relabelled game is player π(i) of the other |
//!
//! Colour refinement (Weisfeiler and Leman): a colour is a number that a player keeps under every relabelling, made of
//! whom it sees, by whom it is seen, and the colours of those. Players that differ and have one colour all the same
//! keep their order: the topology then shares with fewer others, and is none the worse for it.

use crate::error::NoMemory;
use crate::game::Game;
use crate::memory::zeros;
use crate::network::Topology;

/// Rounds of refinement.
const ROUNDS: usize = 2;

/// Which defenders are alike.
#[derive(Debug)]
pub(super) struct SymmetryClasses {
    /// The first defender of the same class, for every defender; the target is like nobody.
    first: Vec<usize>,
    /// Whether any two are alike.
    any: bool,
}

/// A player's marks under one topology.
struct Player {
    /// Twice whom it sees, and one more if the attacker is among them.
    sight: usize,
    colour: u64,
    /// The colour of the next round.
    next: u64,
}

/// Spreads the bits of a colour (the finisher of SplitMix64).
fn mix(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

impl SymmetryClasses {
    pub(super) fn of(game: &Game) -> Self {
        let w = game.weights();
        let same = |i: usize, j: usize| {
            [&w.r_d, &w.q_da, &w.f_da, &w.q_ad, &w.f_ad]
                .into_iter()
                .all(|weights| weights.get(i).map(|x| x.to_bits()) == weights.get(j).map(|x| x.to_bits()))
        };
        let first = |i: usize| if i == game.n() { i } else { (0..i).find(|&j| same(i, j)).unwrap_or(i) };
        let first: Vec<usize> = (0..game.size()).map(first).collect();
        let any = first.iter().enumerate().any(|(i, &first)| first != i);
        Self { first, any }
    }

    /// Whether any two defenders are alike.
    pub(super) fn any(&self) -> bool {
        self.any
    }

    /// The canonical form of a topology, and the order that leads to it.
    pub(super) fn canonical(&self, topology: &Topology) -> (Topology, Vec<usize>) {
        let mut order: Vec<usize> = (0..topology.size()).collect();
        if !self.any {
            return (topology.clone(), order);
        }
        // The places of a class go to its players, who sees most first: canonical forms that are alike are solved side
        // by side, and lanes with the same unknowns waste none. By insertion: there are few, and equal ones are to keep
        // their order.
        let players = self.players(topology);
        let key = |i: usize| (std::cmp::Reverse(players[i].sight), players[i].colour);
        for i in 1..topology.rows() {
            let mut at = i;
            while let Some(before) = (0..at).rev().find(|&j| self.first[j] == self.first[i]) {
                if key(order[before]) <= key(i) {
                    break;
                }
                order[at] = order[before];
                at = before;
            }
            order[at] = i;
        }
        (topology.relabelled(&order), order)
    }

    /// What each player keeps under every relabelling.
    fn players(&self, topology: &Topology) -> Vec<Player> {
        let (rows, size) = (topology.rows(), topology.size());
        let player = |i: usize| {
            let seen = (0..size).filter(|&j| i < rows && topology.sees(i, j)).count();
            let sight = 2 * seen + usize::from(i < rows && topology.sees_attacker(i));
            let colour = mix(mix(self.first[i] as u64 + 1) ^ (sight & 1) as u64);
            Player { sight, colour, next: colour }
        };
        let mut players: Vec<Player> = (0..size).map(player).collect();
        for _ in 0..ROUNDS {
            // Sums do not depend on the order in which neighbours come.
            for i in 0..rows {
                for j in (0..size).filter(|&j| j != i && topology.sees(i, j)) {
                    players[i].next = players[i].next.wrapping_add(mix(players[j].colour));
                    players[j].next = players[j].next.wrapping_add(mix(!players[i].colour));
                }
            }
            for player in &mut players {
                player.colour = mix(player.next);
                player.next = player.colour;
            }
        }
        players
    }
}

/// The rows of a canonical form, each as wide as `order` is long, under their own names.
pub(super) fn back(order: &[usize], rows: &[f64]) -> Result<Vec<f64>, NoMemory> {
    let n = order.len();
    let mut out = zeros("the answer at one instant", rows.len())?;
    for (i, row) in rows.chunks_exact(n).enumerate() {
        for (j, &x) in row.iter().enumerate() {
            out[order[i] * n + order[j]] = x;
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::game::{Interaction, bank};

    fn classes(r_d: &[f64], q_ad: &[f64]) -> Vec<usize> {
        let base = bank::paper_game(Interaction::I2, 1.0).expect("the paper's game");
        let mut weights = base.weights().clone();
        weights.r_d = r_d.to_vec();
        weights.q_ad = q_ad.to_vec();
        weights.f_ad = vec![1.0; r_d.len()];
        SymmetryClasses::of(&Game::new(Interaction::I2, weights, *base.grid()).expect("a valid game")).first
    }

    #[test]
    fn defenders_of_equal_weights_are_alike() {
        assert_eq!(classes(&[1.0], &[1.0]), [0, 1]);
        assert_eq!(classes(&[1.0; 3], &[1.0; 3]), [0, 0, 0, 3]);
        assert_eq!(classes(&[1.0, 2.0, 1.0, 2.0], &[1.0; 4]), [0, 1, 0, 1, 4]);
        assert_eq!(classes(&[1.0, 2.0, 1.0, 2.0], &[1.0, 1.0, 1.0, 3.0]), [0, 1, 0, 3, 4]);
    }

    /// How many canonical forms the networks have whose keys are multiples of `stride`, and how many classes under the
    /// relabellings `orders`.
    fn count<const N: usize>(first: [usize; N], rows: usize, stride: usize, orders: &[[usize; N]]) -> [usize; 2] {
        let classes = SymmetryClasses { first: first.to_vec(), any: true };
        let (mut canonical_forms, mut orbits) = (BTreeSet::new(), BTreeSet::new());
        for key in (0..1u64 << (rows * N)).step_by(stride) {
            let topology = Topology::from_key(rows, N, key);
            let (canonical, order) = classes.canonical(&topology);
            assert_eq!(topology.relabelled(&order), canonical);
            assert!(orders.iter().any(|other| other[..] == order));
            canonical_forms.insert(canonical);
            orbits.insert(orders.iter().map(|order| topology.relabelled(order)).min());
        }
        [canonical_forms.len(), orbits.len()]
    }

    /// All networks of three defenders, and many of four of two classes. Where three see each other in a circle they
    /// have one colour, and its two directions stay apart: with the attacker seen or not, the target seen or not, four
    /// classes have two canonical forms.
    #[test]
    fn relabelled_networks_have_one_canonical_form() {
        let orders = [[0, 1, 2, 3], [0, 2, 1, 3], [1, 0, 2, 3], [1, 2, 0, 3], [2, 0, 1, 3], [2, 1, 0, 3]];
        assert_eq!(count([0, 0, 0, 3], 3, 1, &orders), [756, 752]);
        let orders = [[0, 1, 2, 3, 4], [2, 1, 0, 3, 4], [0, 3, 2, 1, 4], [2, 3, 0, 1, 4]];
        let [canonical_forms, classes] = count([0, 1, 0, 1, 4], 5, 1471, &orders);
        assert_eq!(canonical_forms, classes);
    }
}

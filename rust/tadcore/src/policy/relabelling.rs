//! Players of one kind: topologies that differ by their names alone share one answer.
//!
//! Defenders with the same weights may change places. A relabelling of them carries the gains of one topology into those of
//! another, and the transition with them, so one synthesis serves all. Which one is solved is a function of the topology
//! alone, whoever asks: the *first* of its relabellings as numbers. Between them nothing is computed, numbers only change
//! their places, so the answer has the same bits on every way there.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | π | an order | player i of the relabelled game is player π(i) of the other |

use crate::game::Game;
use crate::network::Topology;

/// Relabellings up to which the first one is looked for: six equal defenders. Beyond, the search takes as long as it saves,
/// and in so large a network two trials hardly meet.
const MOST: usize = 720;

/// The relabellings that leave a game as it is, first the one that changes nothing.
#[derive(Debug)]
pub(super) struct Relabellings {
    orders: Vec<Vec<usize>>,
}

impl Relabellings {
    pub(super) fn of(game: &Game) -> Self {
        let w = game.weights();
        let same = |i: usize, j: usize| {
            [&w.r_d, &w.q_da, &w.f_da, &w.q_ad, &w.f_ad]
                .into_iter()
                .all(|weights| weights.get(i).map(|x| x.to_bits()) == weights.get(j).map(|x| x.to_bits()))
        };
        let n = game.n();
        // Each player picks its equals among those before it: the product of all choices is the number of relabellings.
        let count = (0..n).try_fold(1usize, |count, i| {
            let count = count * (1 + (0..i).filter(|&j| same(i, j)).count());
            (count <= MOST).then_some(count)
        });
        let mut orders = vec![Vec::new()];
        for i in 0..game.size() {
            let alone = i == n || count.is_none();
            let choices = |taken: &Vec<usize>| -> Vec<Vec<usize>> {
                (0..game.size())
                    .filter(|&j| j == i || !alone && j < n && same(i, j))
                    .filter(|j| !taken.contains(j))
                    .map(|j| taken.iter().copied().chain([j]).collect())
                    .collect()
            };
            orders = orders.iter().flat_map(choices).collect();
        }
        Self { orders }
    }

    /// The one that changes nothing.
    pub(super) fn none(&self) -> &[usize] {
        &self.orders[0]
    }

    /// All relabellings but the one that changes nothing.
    pub(super) fn others(&self) -> impl Iterator<Item = &[usize]> {
        self.orders.iter().skip(1).map(Vec::as_slice)
    }

    /// The first topology among the relabelled ones, and the order that leads to it.
    pub(super) fn first(&self, topology: &Topology) -> (Topology, &[usize]) {
        let mut best = (topology.clone(), self.none());
        for order in self.others() {
            let other = topology.relabelled(order);
            if other < best.0 {
                best = (other, order);
            }
        }
        best
    }
}

/// The rows of a relabelled game, each as wide as `order` is long, under their own names.
pub(super) fn back(order: &[usize], rows: &[f64]) -> Vec<f64> {
    let n = order.len();
    let mut out = vec![0.0; rows.len()];
    for (i, row) in rows.chunks_exact(n).enumerate() {
        for (j, &x) in row.iter().enumerate() {
            out[order[i] * n + order[j]] = x;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::game::{Interaction, bank};

    fn orders(r_d: &[f64], q_ad: &[f64]) -> usize {
        let base = bank::paper_game(Interaction::I2, 1.0).unwrap();
        let mut weights = base.weights().clone();
        weights.r_d = r_d.to_vec();
        weights.q_ad = q_ad.to_vec();
        weights.f_ad = vec![1.0; r_d.len()];
        Relabellings::of(&Game::new(Interaction::I2, weights, *base.grid()).unwrap()).orders.len()
    }

    #[test]
    fn only_equal_defenders_change_places() {
        assert_eq!(orders(&[1.0], &[1.0]), 1);
        assert_eq!(orders(&[1.0; 3], &[1.0; 3]), 6);
        assert_eq!(orders(&[1.0, 2.0, 1.0, 2.0], &[1.0; 4]), 4);
        assert_eq!(orders(&[1.0, 2.0, 1.0, 2.0], &[1.0, 1.0, 1.0, 3.0]), 2);
        assert_eq!(orders(&[1.0; 6], &[1.0; 6]), 720);
        assert_eq!(orders(&[1.0; 7], &[1.0; 7]), 1);
    }

    #[test]
    fn all_relabelled_networks_have_the_same_first() {
        let all = Relabellings::of(&bank::paper_game(Interaction::I2, 1.0).unwrap());
        for key in (0..1u64 << 16).step_by(37) {
            let topology = Topology::from_key(4, 4, key);
            let (first, order) = all.first(&topology);
            assert_eq!(topology.relabelled(order), first);
            for other in all.others() {
                assert_eq!(all.first(&topology.relabelled(other)).0, first);
            }
        }
    }
}

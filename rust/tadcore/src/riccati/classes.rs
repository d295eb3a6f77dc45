//! Large teams in which defenders have equal weights: P of a smaller game in which each class of them is one or two.
//!
//! Exchanging two defenders with equal weights exchanges their rows and columns of P and changes nothing else. So within a
//! class of c members P_ii is one number and P_ij, i ≠ j, another, and so is P_ij for i in one class and j in another.
//! Let one member i of a class stand for itself and the mean of the others, ȳ, for these: if they move alike, Σ‖y‖² is
//! (c − 1)‖ȳ‖², so the mean is a defender whose weights, on its control and on its state, are c − 1 times theirs. In this
//! game, P̂, with rows i and ī for a class,
//!
//! P_ii = P̂_ii, P_ij = P̂_iī / (c − 1) within a class, P_ij = P̂_ij between two, and with the target.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | c | the second of `Classes::classes` | members of a class |
//! | P̂, its N | `Classes::game`, `size` | the smaller game |
//! | i, ī | `Classes::row`, the next | the member that stands for itself; the mean of the others |
//!
//! It has an equilibrium exactly if the large one has: a solution of either makes one of the other.
//!
//! Source: ours; the equations are eq:Riccati and eq:RDE of the paper.

use std::collections::HashMap;

use crate::cancel::CancelToken;
use crate::error::{EquilibriumError, NoMemory};
use crate::game::{Game, Weights};
use crate::memory::zeros;

/// N beyond which classes are looked for: up to here P takes less than 20 ms.
const FEW: usize = 32;

/// The classes of a team's defenders.
pub(super) struct Classes {
    /// The row of each defender's class in P̂: that of the member that stands for itself.
    row: Vec<usize>,
    /// The first member of each class, and how many it has, in the order of their rows.
    classes: Vec<(usize, usize)>,
    /// N of the smaller game.
    size: usize,
}

impl Classes {
    /// Those of a game that is large and becomes half as large or less.
    pub fn of(game: &Game) -> Option<Self> {
        if game.size() <= FEW {
            return None;
        }
        let w = game.weights();
        let lists = [&w.r_d, &w.q_da, &w.f_da, &w.q_ad, &w.f_ad];
        let mut known: HashMap<Vec<u64>, usize> = HashMap::new();
        let mut classes: Vec<(usize, usize)> = Vec::new();
        let mut own = Vec::with_capacity(game.n());
        for i in 0..game.n() {
            // The lists of the weights that only I1 has are empty in I2.
            let weights = lists.iter().filter_map(|list| list.get(i)).map(|x| x.to_bits()).collect();
            let class = *known.entry(weights).or_insert(classes.len());
            if class == classes.len() {
                classes.push((i, 0));
            }
            classes[class].1 += 1;
            own.push(class);
        }
        let mut first = Vec::with_capacity(classes.len());
        let size = 1 + classes.iter().fold(0, |row, &(_, members)| {
            first.push(row);
            row + members.min(2)
        });
        let row = own.into_iter().map(|class| first[class]).collect();
        (2 * size <= game.size()).then_some(Self { row, classes, size })
    }

    /// The smaller game; none where a weight leaves the range of weights.
    pub fn game(&self, game: &Game) -> Option<Game> {
        let w = game.weights();
        let list = |of: &[f64]| -> Vec<f64> {
            let rows = self.classes.iter().filter(|_| !of.is_empty()).flat_map(|&(first, members)| {
                let others = (members > 1).then(|| (members - 1) as f64 * of[first]);
                std::iter::once(of[first]).chain(others)
            });
            rows.collect()
        };
        let weights = Weights {
            r_d: list(&w.r_d),
            q_da: list(&w.q_da),
            f_da: list(&w.f_da),
            q_ad: list(&w.q_ad),
            f_ad: list(&w.f_ad),
            ..w.clone()
        };
        Game::new(game.interaction(), weights, *game.grid()).ok()
    }

    /// Room for P̂, node by node as P.
    pub fn room(&self, nodes: &[f64], n: usize) -> Result<Vec<f64>, NoMemory> {
        zeros("P of a game with equal defenders", nodes.len() / (n * n) * self.size * self.size)
    }

    /// Writes the matrices P from the matrices P̂.
    pub fn expand(&self, small: &[f64], nodes: &mut [f64], cancel: &CancelToken) -> Result<(), EquilibriumError> {
        let (n, size) = (self.row.len() + 1, self.size);
        // Of each row of P̂ the factor by which it is read at another member.
        let mut share = vec![0.0; size];
        for &(first, members) in &self.classes {
            share[self.row[first]] = if members > 1 { 1.0 / (members - 1) as f64 } else { 0.0 };
        }
        for (large, small) in nodes.chunks_exact_mut(n * n).zip(small.chunks_exact(size * size)) {
            cancel.check()?;
            let place = |i: usize| self.row.get(i).copied().unwrap_or(size - 1);
            for (i, out) in large.chunks_exact_mut(n).enumerate() {
                let (row, p) = (place(i), &small[place(i) * size..][..size]);
                for (j, x) in out.iter_mut().enumerate() {
                    *x = match place(j) {
                        _ if i == j => p[row],
                        own if own == row => p[row + 1] * share[row],
                        other => p[other],
                    };
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::game::{Interaction, bank};
    use crate::riccati::{coupled, groups, hamiltonian};

    /// The solution by classes is that of the whole game, entry by entry beside its row and column.
    #[test]
    fn a_game_of_classes_is_solved_as_a_whole_one() {
        let cancel = CancelToken::new();
        for (interaction, n, horizon) in [
            (Interaction::I1, 40, 1.0),
            (Interaction::I1, 70, 0.02),
            (Interaction::I2, 40, 0.02),
            (Interaction::I2, 61, 0.01),
        ] {
            let game = bank::varied_game(interaction, n, horizon, horizon / 4.0).expect("a game");
            // One that is alone in its class, and lies among the others.
            let mut weights = game.weights().clone();
            weights.f_ad[n / 2] = 0.7;
            let game = Game::new(interaction, weights, *game.grid()).expect("a game");
            let classes = Classes::of(&game).expect("equal defenders");
            assert_eq!(classes.size, 8);
            let small = classes.game(&game).expect("weights in range");
            let mut whole = vec![0.0; 5 * groups(interaction) * (n + 1) * (n + 1)];
            let mut found = whole.clone();
            let mut reduced = classes.room(&whole, n + 1).expect("memory");
            match interaction {
                Interaction::I1 => {
                    coupled::solve(&game, &cancel, &mut whole).expect("an equilibrium");
                    coupled::solve(&small, &cancel, &mut reduced).expect("an equilibrium");
                }
                Interaction::I2 => {
                    hamiltonian::solve(&game, &cancel, &mut whole).expect("an equilibrium");
                    hamiltonian::solve(&small, &cancel, &mut reduced).expect("an equilibrium");
                }
            }
            classes.expand(&reduced, &mut found, &cancel).expect("not cancelled");
            for (a, b) in found.chunks_exact((n + 1) * (n + 1)).zip(whole.chunks_exact((n + 1) * (n + 1))) {
                let norm = |m: &mut dyn Iterator<Item = f64>| m.map(|x| x * x).sum::<f64>().sqrt();
                let off = norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied()).max(1e-300);
                assert!(off < 1e-10, "{interaction:?} {n}: {off:e}");
            }
        }
    }

    #[test]
    fn small_teams_and_teams_without_classes_are_solved_as_they_are() {
        assert!(Classes::of(&bank::varied_game(Interaction::I1, 31, 1.0, 0.1).expect("a game")).is_none());
        assert!(Classes::of(&bank::varied_game(Interaction::I2, 32, 1.0, 0.1).expect("a game")).is_some());
        let r = (0..200).map(|i| 1.0 + 0.01 * f64::from(i % 101)).collect();
        let game = bank::unit_game(Interaction::I1, r, 1.2, 0.8, 1.0, 1.0, 0.1).expect("a game");
        assert!(Classes::of(&game).is_none());
    }
}

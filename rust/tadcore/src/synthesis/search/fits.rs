//! Starts that fit GᵀRG to M player by player: where γ₁ dominates, Θ is little else than ‖GᵀRG − M‖².
//!
//! With H = √R·G it is ‖M − Σ_i h_iᵀh_i‖², and of one row, the others given, the best is known: √λ v, the largest
//! eigenvalue and its vector of what the others leave of M, restricted to what the player may use. Who comes first decides
//! who plays what. Each player is once the first, and each pair once the first two; of the rest the one comes next whose
//! eigenvalue is the largest. Two rounds, in which every row is fitted anew, follow.
//!
//! Source: ours.

use faer::{Mat, Side};

use super::candidate::Candidate;
use super::moves::Moves;
use crate::simd::norm;
use crate::synthesis::theta::Problem;

/// Rounds after the first.
const ROUNDS: usize = 2;
/// Θ at a start relative to the best point up to which it is worth a descent, and how far from another one it must be.
const WORTH: f64 = 3.0;
const APART: f64 = 1e-3;

/// The rows of H, what they leave of M, and what each player may use.
struct Fit<'a> {
    candidate: &'a Candidate,
    n: usize,
    h: Vec<f64>,
    left: Vec<f64>,
    root: &'a [f64],
    fne: &'a [f64],
}

/// The starts that are worth a descent.
pub(crate) fn fits(problem: &Problem, candidate: &Candidate) -> Vec<Vec<f64>> {
    let (n, of) = (problem.size, &problem.theta.double);
    let best = Moves::new(problem, candidate);
    let mut players: Vec<usize> = candidate.variables.iter().map(|v| v.own / n).collect();
    players.dedup();
    let mut found: Vec<Vec<f64>> = Vec::new();
    let mut scratch = Vec::new();
    for &first in &players {
        for &second in &players {
            let mut fit = Fit::new(candidate, n, &best.root, &of.fne, &of.target, &players);
            let mut rest = players.clone();
            for player in if first == second { vec![first] } else { vec![first, second] } {
                fit.fit(player);
                rest.retain(|&other| other != player);
            }
            while let Some(next) = rest.iter().copied().max_by(|&a, &b| fit.largest(a).0.total_cmp(&fit.largest(b).0)) {
                fit.fit(next);
                rest.retain(|&other| other != next);
            }
            for &player in players.iter().cycle().take(ROUNDS * players.len()) {
                fit.fit(player);
            }
            let limit = WORTH * candidate.reached.value;
            let change: Vec<(usize, &[f64], f64)> = players.iter().map(|&i| (i, &fit.h[i * n..][..n], 1.0)).collect();
            let start: Vec<f64> = fit.h.iter().enumerate().map(|(e, h)| h / best.root[e / n]).collect();
            let apart = |other: &Vec<f64>| -> bool {
                let distance: f64 = other.iter().zip(&start).map(|(x, y)| (x - y) * (x - y)).sum();
                distance.sqrt() > APART * norm(&start)
            };
            if best.theta(&change, limit, &mut scratch) < limit && found.iter().all(apart) && apart(&candidate.g) {
                found.push(start);
            }
        }
    }
    found
}

impl<'a> Fit<'a> {
    /// Nobody of `players` plays; who has nothing to choose plays what the canonical start says.
    fn new(
        candidate: &'a Candidate,
        n: usize,
        root: &'a [f64],
        fne: &'a [f64],
        target: &[f64],
        players: &[usize],
    ) -> Self {
        let h = candidate.initial.iter().enumerate().map(|(e, g)| root[e / n] * g).collect();
        let mut fit = Self { candidate, n, h, left: target.to_vec(), root, fne };
        for i in 0..root.len() {
            if players.contains(&i) {
                fit.h[i * n..(i + 1) * n].fill(0.0);
            }
            fit.add(i, -1.0);
        }
        fit
    }

    /// What is left, with h_iᵀh_i added so many times.
    fn add(&mut self, i: usize, times: f64) {
        let row = &self.h[i * self.n..][..self.n];
        for (left, &a) in self.left.chunks_exact_mut(self.n).zip(row) {
            left.iter_mut().zip(row).for_each(|(x, b)| *x += times * a * b);
        }
    }

    /// The largest eigenvalue of what is left where player i may use it, and its vector.
    fn largest(&self, i: usize) -> (f64, Vec<f64>) {
        let n = self.n;
        let own: Vec<_> = self.candidate.variables.iter().filter(|v| v.own / n == i).collect();
        let relative = own.iter().any(|v| v.relative);
        let mut used: Vec<usize> = own.iter().map(|v| v.entry % n).collect();
        if relative {
            used.push(i);
        }
        let d = used.len();
        let part = Mat::from_fn(d, d, |a, b| self.left[used[a] * n + used[b]]);
        // Rows that know differences only sum to zero.
        let mean = if relative { 1.0 / d as f64 } else { 0.0 };
        let centre = Mat::from_fn(d, d, |a, b| f64::from(u8::from(a == b)) - mean);
        let part = &centre * &part * &centre;
        let mut row = vec![0.0; n];
        let Ok(eigen) = part.self_adjoint_eigen(Side::Lower) else { return (0.0, row) };
        for (a, &j) in used.iter().enumerate() {
            row[j] = eigen.U()[(a, d - 1)];
        }
        (eigen.S()[d - 1], row)
    }

    /// Fits the row of one player, with the sign that is nearer to the equilibrium.
    fn fit(&mut self, i: usize) {
        let n = self.n;
        self.add(i, 1.0);
        let (value, vector) = self.largest(i);
        let along: f64 = vector.iter().zip(&self.fne[i * n..]).map(|(v, f)| v * self.root[i] * f).sum();
        let size = value.max(0.0).sqrt().copysign(along);
        self.h[i * n..(i + 1) * n].iter_mut().zip(&vector).for_each(|(h, v)| *h = size * v);
        self.add(i, -1.0);
    }
}

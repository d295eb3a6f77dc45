//! Starts that fit GᵀRG to M player by player: Θ's first term is ‖GᵀRG − M‖², and little else where γ₁ dominates.
//!
//! With H = √R·G it is ‖M − Σ_i h_iᵀh_i‖², and of one row, the others given, the best is known: √λ v, the largest
//! eigenvalue and its vector of what the others leave of M, restricted to what the player may use. Who comes first decides
//! who plays what. Each player is once the first, and each pair once the first two; of the rest the one comes next whose
//! eigenvalue is the largest. A round in which every row is fitted anew follows.
//!
//! Source: ours.

use super::candidate::{Candidate, Start};
use super::moves::Moves;
use super::stages::Search;
use crate::error::Stopped;
use crate::simd::norm;
use crate::synthesis::theta::{Problem, TABULATED_UP_TO};

/// The most players that one player may see, itself included: large games are not searched so.
const MOST: usize = TABULATED_UP_TO;
/// Sweeps of Jacobi's method; four are enough for eight rows.
const SWEEPS: usize = 8;
/// What may be left beside the diagonal: for a start ten digits of a vector will do.
const ENOUGH: f64 = 1e-20;
/// Rounds after the first.
const ROUNDS: usize = 1;
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
        // Whom the largest eigenvalue takes after the first.
        let mut next = None;
        for second in std::iter::once(first).chain(players.iter().copied().filter(|&second| second != first)) {
            if next == Some(second) {
                continue;
            }
            let mut fit = Fit::new(candidate, n, &best.root, &of.fne, &of.target, &players);
            let mut rest = players.clone();
            let mut play = |fit: &mut Fit, player: usize| {
                fit.fit(player);
                rest.retain(|&other| other != player);
                fit.next(&rest)
            };
            let mut then = play(&mut fit, first);
            if second == first {
                next = then;
            } else {
                then = play(&mut fit, second);
            }
            while let Some(player) = then {
                then = play(&mut fit, player);
            }
            for _ in 0..ROUNDS {
                players.iter().for_each(|&player| fit.fit(player));
            }
            let limit = WORTH * candidate.reached.value;
            let change: Vec<(usize, &[f64], f64)> = players.iter().map(|&i| (i, &fit.h[i * n..][..n], 1.0)).collect();
            let mut start: Vec<f64> = fit.h.iter().enumerate().map(|(e, h)| h / best.root[e / n]).collect();
            candidate.in_double(&mut start);
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

impl Search<'_> {
    /// Descents from the fits of the candidates `open`; which they lead lower.
    pub(super) fn search_fits(&mut self, candidates: &mut [Candidate], open: &[usize]) -> Result<Vec<usize>, Stopped> {
        self.begin(1);
        for &e in open {
            for start in fits(self.problem, &candidates[e]) {
                self.tasks.add(e, false, 0.0)?.copy_from_slice(&start);
            }
        }
        let starts = vec![Start::Reversed; self.tasks.len()];
        let lower = self.finish(candidates, starts)?;
        self.certify(candidates, &lower)?;
        Ok(lower)
    }
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
        let mut part = [0.0; MOST * MOST];
        for (a, row) in part.chunks_exact_mut(MOST).enumerate().take(d) {
            (0..d).for_each(|b| row[b] = self.left[used[a] * n + used[b]]);
        }
        if relative {
            centre(&mut part, d);
        }
        let (value, vector) = largest_pair(&mut part, d);
        let mut row = vec![0.0; n];
        used.iter().zip(vector).for_each(|(&j, x)| row[j] = x);
        (value, row)
    }

    /// Whose eigenvalue is the largest.
    fn next(&self, rest: &[usize]) -> Option<usize> {
        if let [only] = rest {
            return Some(*only);
        }
        let values = rest.iter().map(|&player| (self.largest(player).0, player));
        values.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, player)| player)
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

/// A := (**I** − 11ᵀ/d) A (**I** − 11ᵀ/d): rows that know differences only sum to zero.
fn centre(a: &mut [f64; MOST * MOST], d: usize) {
    for along in [1, MOST] {
        for line in 0..d {
            let at = |k: usize| line * (MOST + 1 - along) + k * along;
            let mean = (0..d).map(|k| a[at(k)]).sum::<f64>() / d as f64;
            (0..d).for_each(|k| a[at(k)] -= mean);
        }
    }
}

/// The largest eigenvalue of a symmetric matrix of d rows, and its vector, by Jacobi's method.
fn largest_pair(a: &mut [f64; MOST * MOST], d: usize) -> (f64, [f64; MOST]) {
    let mut v = [0.0; MOST * MOST];
    (0..d).for_each(|i| v[i * MOST + i] = 1.0);
    for _ in 0..SWEEPS {
        let (mut off, mut all) = (0.0, 0.0);
        for (i, row) in a.chunks_exact(MOST).enumerate().take(d) {
            row[..d].iter().enumerate().for_each(|(j, x)| {
                all += x * x;
                off += if i == j { 0.0 } else { x * x };
            });
        }
        if off <= ENOUGH * all {
            break;
        }
        for p in 0..d {
            for q in p + 1..d {
                let (app, aqq, apq) = (a[p * MOST + p], a[q * MOST + q], a[p * MOST + q]);
                if apq == 0.0 {
                    continue;
                }
                let theta = (aqq - app) / (2.0 * apq);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..d {
                    let (x, y) = (a[k * MOST + p], a[k * MOST + q]);
                    (a[k * MOST + p], a[k * MOST + q]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..d {
                    let (x, y) = (a[p * MOST + k], a[q * MOST + k]);
                    (a[p * MOST + k], a[q * MOST + k]) = (c * x - s * y, s * x + c * y);
                    let (x, y) = (v[p * MOST + k], v[q * MOST + k]);
                    (v[p * MOST + k], v[q * MOST + k]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    let best = (0..d).max_by(|&i, &j| a[i * MOST + i].total_cmp(&a[j * MOST + j])).unwrap_or(0);
    let mut vector = [0.0; MOST];
    vector[..d].copy_from_slice(&v[best * MOST..][..d]);
    (a[best * MOST + best], vector)
}

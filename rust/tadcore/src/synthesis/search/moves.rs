//! Restarts from the best point, by what leaves GᵀRG as it is: with H = √R·G it is HᵀH, which sees neither the sign of
//! a row of H nor whose row it is. Minima come in families that differ by signs and by who plays whose part.
//!
//! A row that another player takes over is projected on what that player sees. Always listed are
//!
//! - player i takes the row of j, and j plays next to nothing, where i keeps most of a row that matters;
//! - one gain reversed, where it matters.
//!
//! Others are many and seldom lead lower. One row or two reversed are listed where the start itself is not far above the
//! best point; the rest where it is hardly above: two players' rows exchanged, with any signs (in large teams as far up as
//! rows are reversed); i takes the row of j and plays it beside j; i takes the row of j, j that of k, and k plays next to
//! nothing.

use super::candidate::Candidate;
use crate::error::Stopped;
use crate::simd::{norm, sum_of_squares};
use crate::synthesis::theta::Problem;

/// The part of a row that its taker must keep.
pub(super) const KEPT: f64 = 0.7;
/// The least size of a row taken and of a gain reversed, relative to H.
const ROW: f64 = 0.3;
const GAIN: f64 = 0.3;
/// What is left of a row given away: where Θ is even in a row, zero is a saddle that no descent leaves.
const LEFT: f64 = 0.1;
/// Θ at a start relative to the best point up to which it is worth a descent: rows reversed, and other moves.
const REVERSED: f64 = 2.5;
const OTHERS: f64 = 1.1;
/// Distance of such a start from the best point, relative to H: nearer ones lead back.
const AWAY: f64 = 0.1;
/// Players from which on rows are exchanged as far up as they are reversed, and small rows reversed, too: with five, lower
/// minima lay behind exchanges up to 2.2 times as high and a row of 2 % of H, with fewer behind none.
const MANY: usize = 5;
const SMALL: f64 = 0.01;

/// The rows of H at the best point of a candidate, and what Θ is made of there.
pub(crate) struct Moves<'a> {
    problem: &'a Problem,
    candidate: &'a Candidate,
    n: usize,
    pub(crate) root: Vec<f64>,
    h: Vec<f64>,
    size: f64,
    /// X, and E_p one after another.
    x: Vec<f64>,
    e: Vec<f64>,
    /// Σ c_i‖Δ_i‖².
    close: f64,
    /// Players that have a variable.
    players: Vec<usize>,
}

/// New rows of H for some players, each with a factor.
pub(crate) type Change<'a> = &'a [(usize, &'a [f64], f64)];

impl<'a> Moves<'a> {
    pub(crate) fn new(problem: &'a Problem, candidate: &'a Candidate) -> Self {
        let (n, of, g) = (problem.size, &problem.theta.double, &candidate.g);
        let root: Vec<f64> = of.r.iter().map(|r| r.sqrt()).collect();
        let h: Vec<f64> = g.iter().enumerate().map(|(e, g)| root[e / n] * g).collect();
        let size = norm(&h);
        let mut players: Vec<usize> = candidate.variables.iter().map(|v| v.own / n).collect();
        players.dedup();
        let mut moves =
            Self { problem, candidate, n, root, h, size, x: Vec::new(), e: Vec::new(), close: 0.0, players };
        moves.evaluate();
        moves
    }

    /// The parts of Θ at the best point.
    fn evaluate(&mut self) {
        let (n, of, g) = (self.n, &self.problem.theta.double, &self.candidate.g);
        self.x = of.target.iter().map(|m| -m).collect();
        self.e = vec![0.0; of.coupling.len() * n * n];
        for i in 0..self.problem.rows {
            let row = &self.h[i * n..][..n];
            let delta: Vec<f64> = (0..n).map(|b| g[i * n + b] - of.fne[i * n + b]).collect();
            add_square(&mut self.x, row, 1.0);
            for (w, e) in of.coupling.iter().zip(self.e.chunks_exact_mut(n * n)) {
                add_pair(e, &w[i * n..][..n], &delta);
            }
            self.close += of.closeness[i] * sum_of_squares(&delta);
        }
    }

    pub(crate) fn row(&self, i: usize) -> &[f64] {
        &self.h[i * self.n..(i + 1) * self.n]
    }

    /// A row projected on what player i may use.
    fn taken(&self, i: usize, row: &[f64], out: &mut [f64]) {
        let free = self.candidate.variables.iter().filter(|v| v.own / self.n == i);
        let relative = free.clone().any(|v| v.relative);
        let (mut sum, mut count) = if relative { (row[i], 1.0) } else { (0.0, 0.0) };
        for v in free.clone() {
            sum += row[v.entry % self.n];
            count += 1.0;
        }
        let mean = if relative { sum / count } else { 0.0 };
        for v in free {
            out[v.entry % self.n] = row[v.entry % self.n] - mean;
        }
        if relative {
            out[i] = row[i] - mean;
        }
    }

    /// Θ with some rows changed, or what of it exceeds the limit already.
    pub(crate) fn theta(&self, change: Change, limit: f64, scratch: &mut Vec<f64>) -> f64 {
        let (n, of) = (self.n, &self.problem.theta.double);
        scratch.clear();
        scratch.extend_from_slice(&self.x);
        for &(i, row, factor) in change {
            add_square(scratch, row, factor * factor);
            add_square(scratch, self.row(i), -1.0);
        }
        let mut sum = of.first * sum_of_squares(scratch) + self.close;
        for &(i, row, factor) in change {
            let fne = &of.fne[i * n..][..n];
            let of_row = |row: &[f64], factor: f64| -> f64 {
                row.iter().zip(fne).map(|(x, f)| (factor * x / self.root[i] - f).powi(2)).sum()
            };
            sum += of.closeness[i] * (of_row(row, factor) - of_row(self.row(i), 1.0));
        }
        for (w, e) in of.coupling.iter().zip(self.e.chunks_exact(n * n)) {
            if sum >= limit {
                break;
            }
            scratch.clear();
            scratch.extend_from_slice(e);
            for &(i, row, factor) in change {
                let old = self.row(i);
                for a in 0..n {
                    let d = (factor * row[a] - old[a]) / self.root[i];
                    for (b, &w) in w[i * n..][..n].iter().enumerate() {
                        scratch[a * n + b] += d * w;
                        scratch[b * n + a] += d * w;
                    }
                }
            }
            sum += sum_of_squares(scratch);
        }
        sum
    }

    /// Hands the gains with some rows changed to `add`, if that leads not too far up, nor next to nowhere.
    fn near<A>(&self, change: Change, limit: f64, scratch: &mut Vec<f64>, add: &mut A) -> Result<(), Stopped>
    where
        A: FnMut(&[f64]) -> Result<(), Stopped>,
    {
        let one = change.len() == 1 && self.problem.rows >= MANY;
        let away = if one { SMALL } else { AWAY };
        if limit.is_finite() {
            let distance: f64 = change
                .iter()
                .map(|&(i, row, factor)| -> f64 {
                    row.iter().zip(self.row(i)).map(|(x, old)| (factor * x - old).powi(2)).sum()
                })
                .sum();
            let limit = limit * self.candidate.reached.value;
            if distance <= (away * self.size).powi(2) || self.theta(change, limit, scratch) >= limit {
                return Ok(());
            }
        }
        let mut g = self.candidate.g.clone();
        for &(i, row, factor) in change {
            for (g, x) in g[i * self.n..].iter_mut().zip(row) {
                *g = factor * x / self.root[i];
            }
        }
        add(&g)
    }

    /// Hands every start to `add`.
    pub(crate) fn list(&self, mut add: impl FnMut(&[f64]) -> Result<(), Stopped>) -> Result<(), Stopped> {
        if self.size == 0.0 {
            return Ok(());
        }
        let (n, m, always) = (self.n, self.problem.rows, f64::INFINITY);
        let (mut scratch, add) = (Vec::new(), &mut add);
        for &i in self.players.iter().filter(|&&i| norm(self.row(i)) > 0.0) {
            self.near(&[(i, self.row(i), -1.0)], REVERSED, &mut scratch, add)?;
        }
        // Row j as i takes it, and its size.
        let mut all = vec![0.0; m * m * n];
        for (at, out) in all.chunks_exact_mut(n).enumerate() {
            if at / m != at % m && self.players.contains(&(at / m)) {
                self.taken(at / m, self.row(at % m), out);
            }
        }
        let taken = |i: usize, j: usize| &all[(i * m + j) * n..][..n];
        let whole: Vec<f64> = (0..m).map(|i| norm(self.row(i))).collect();
        let kept: Vec<f64> = all.chunks_exact(n).map(norm).collect();
        let keeps = |i: usize, j: usize| kept[i * m + j] > 0.0 && kept[i * m + j] >= KEPT * whole[j];
        let exchanged = if m >= MANY { REVERSED } else { OTHERS };
        for (k, &i) in self.players.iter().enumerate() {
            for &j in &self.players[k + 1..] {
                let (a, b) = (taken(i, j), taken(j, i));
                self.near(&[(i, self.row(i), -1.0), (j, self.row(j), -1.0)], REVERSED, &mut scratch, add)?;
                for (of_a, of_b) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                    self.near(&[(i, a, of_a), (j, b, of_b)], exchanged, &mut scratch, add)?;
                }
            }
        }
        for &i in &self.players {
            for &j in self.players.iter().filter(|&&j| j != i && keeps(i, j)) {
                let (row, large) = (taken(i, j), kept[i * m + j] >= ROW * self.size);
                let given = if large { always } else { OTHERS };
                self.near(&[(i, row, 1.0), (j, self.row(j), LEFT)], given, &mut scratch, add)?;
                self.near(&[(i, row, 1.0)], OTHERS, &mut scratch, add)?;
                for &k in self.players.iter().filter(|&&k| k != i && k != j && keeps(j, k)) {
                    let change = [(i, row, 1.0), (j, taken(j, k), 1.0), (k, self.row(k), LEFT)];
                    self.near(&change, OTHERS, &mut scratch, add)?;
                }
            }
        }
        for v in &self.candidate.variables {
            let x = self.candidate.g[v.entry];
            if x.abs() * self.root[v.own / n] >= GAIN * self.size {
                let mut g = self.candidate.g.clone();
                g[v.entry] = -x;
                if v.relative {
                    g[v.own] += 2.0 * x;
                }
                add(&g)?;
            }
        }
        Ok(())
    }
}

/// x += factor · rowᵀ row.
fn add_square(x: &mut [f64], row: &[f64], factor: f64) {
    for (x, &a) in x.chunks_exact_mut(row.len()).zip(row) {
        let a = factor * a;
        x.iter_mut().zip(row).for_each(|(x, b)| *x += a * b);
    }
}

/// e += wᵀ d + dᵀ w.
fn add_pair(e: &mut [f64], w: &[f64], d: &[f64]) {
    for (a, e) in e.chunks_exact_mut(w.len()).enumerate() {
        for (b, e) in e.iter_mut().enumerate() {
            *e += w[a] * d[b] + d[a] * w[b];
        }
    }
}

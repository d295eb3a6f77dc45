//! How far each trial was from every outcome: the robustness of "until", for trials that are played on past their ends.
//!
//! With g_i(k) = σ_i − d_i(k) of defender i, g_τ(k) = σ_a − d_τ(k) of the target (d: distance from the attacker), and
//! minima over j < k of what has not happened before:
//!
//! | outcome | score |
//! |---|---|
//! | timeout | min_k min(min_i −g_i(k), −g_τ(k)) |
//! | captured | max_k min(g_τ(k), min_{j≤k, i} −g_i(j)) |
//! | intercepted | max_k min(max_i g_i(k), min_{j<k} −g_τ(j)) |
//! | d_i | max_k min(g_i(k), min_{j<k} −g_τ(j), min_{l≠i, j<k} −g_l(j), min_{l≠i} max(−g_l(k), d_l(k) − d_i(k))) |
//!
//! A score is at least 0 exactly where the trial ended so and did not diverge before: balls are closed, so what must not
//! have happened is a strict inequality, whose margin 0 counts as the largest negative number; and of two defenders
//! equally near the first intercepts. Distances are compared as by a recorded run: d² ≤ the squared reach of σ is exactly
//! √d² ≤ σ, and who is nearer is told by squares. Where a trial diverges its scores stay as they are, and the timeout's is
//! −∞ unless the game was over.

use super::End;
use super::block::{BLOCK, PerTrial, playing};
use super::trials::Trials;
use crate::error::NoMemory;
use crate::memory::grow;
use crate::simd::{Number, Width, dispatch};
use crate::simulation::divergence::{self, within};
use crate::simulation::{Outcome, Reach};

/// What asks for memory here.
const WHAT: &str = "the scores of a batch";
/// The margin of a strict inequality that holds with equality.
const MISSED: f64 = -f64::from_bits(1);
/// Scores before those of d₁…d_n.
const BEFORE: usize = 3;

/// Scores of one trial: timeout, captured, intercepted, d₁…d_n.
#[must_use]
pub fn columns(defenders: usize) -> usize {
    BEFORE + defenders
}

/// The scores of the trials of a chunk, by their places.
pub(super) struct Scores<'a> {
    width: Width,
    n: usize,
    /// Of each block σ₁…σ_n, σ_a.
    radii: Vec<PerTrial>,
    /// Of each block its scores, then min_{j<k} of −g₁…−g_n and of −g_τ.
    kept: Vec<PerTrial>,
    /// A bit for each place whose game is over, and for each whose game diverged.
    over: Vec<u32>,
    diverged: Vec<u32>,
    /// Where the scores of each trial go; where the course of one is asked for, its value after every instant.
    out: &'a mut [f64],
    course: Option<Course>,
}

/// Which score is followed, and over how many instants.
#[derive(Clone, Copy)]
struct Course {
    column: usize,
    instants: usize,
}

impl<'a> Scores<'a> {
    /// For trials at t_0, which are to be played on past their ends.
    ///
    /// # Errors
    /// [`NoMemory`] where there is none for so many.
    pub(super) fn new(
        trials: &mut Trials,
        width: Width,
        column: Option<usize>,
        out: &'a mut [f64],
    ) -> Result<Self, NoMemory> {
        let instants = trials.policy.game().grid().steps() + 1;
        let course = column.map(|column| Course { column, instants });
        let n = trials.shape.size - 1;
        let (blocks, rows) = (trials.blocks.far.len(), columns(n) + n + 1);
        let (mut radii, mut kept) = (Vec::new(), Vec::new());
        grow(WHAT, &mut radii, blocks * (n + 1), [1.0; BLOCK])?;
        grow(WHAT, &mut kept, blocks * rows, [f64::NEG_INFINITY; BLOCK])?;
        for rows in kept.chunks_exact_mut(rows) {
            rows[0] = [f64::INFINITY; BLOCK];
            rows[columns(n)..].fill([f64::INFINITY; BLOCK]);
        }
        for place in 0..trials.blocks.live {
            let row = trials.batch.capture_row(trials.first + place, n + 1);
            let own = &mut radii[place / BLOCK * (n + 1)..][..n + 1];
            own.iter_mut().zip(row).for_each(|(of_trials, &sigma)| of_trials[place % BLOCK] = sigma);
        }
        // Nobody is within −1, so no sweep stops for a game that is over.
        trials.blocks.capture.fill([-1.0; BLOCK]);
        Ok(Self { width, n, radii, kept, over: vec![0; blocks], diverged: vec![0; blocks], out, course })
    }

    /// Takes in the state at t_k, ends what is over there, and takes out those whose numbers end.
    pub(super) fn observe(&mut self, trials: &mut Trials, k: usize, ends: &mut [End]) {
        let (dim, width) = (trials.shape.dim, trials.shape.size * trials.shape.dim);
        let mut now = Distances::new(self.n + 1);
        // From the last block down, so that a trial that moves in has been observed.
        for block in (0..trials.blocks.live.div_ceil(BLOCK)).rev() {
            let z = &trials.blocks.z[block * width..][..width];
            let radii = &self.radii[block * (self.n + 1)..][..self.n + 1];
            let (caught, beyond) = measured(self.width, z, dim, radii, &trials.blocks.far[block], &mut now);
            let playing = playing(trials.blocks.live, block);
            let mut gone = 0;
            for l in members(beyond & playing) {
                gone |= u32::from(!self.diverge(trials, block * BLOCK + l, ends)) << l;
            }
            self.take_in(block, &now);
            self.follow(trials, block, k);
            // Where the numbers end nobody is caught any more.
            for l in members(caught & playing & !gone & !self.over[block]) {
                self.end(trials, block * BLOCK + l, k, ends);
            }
            for l in members(gone).rev() {
                self.remove(trials, block * BLOCK + l, k);
            }
        }
        trials.fill_up();
    }

    /// Notes that a trial diverged; whether its numbers go on.
    fn diverge(&mut self, trials: &mut Trials, place: usize, ends: &mut [End]) -> bool {
        let (block, l, rows) = (place / BLOCK, place % BLOCK, self.rows());
        trials.blocks.far[block][l] = divergence::LAST;
        self.diverged[block] |= 1 << l;
        if self.over[block] >> l & 1 == 0 {
            ends[trials.who[place] as usize].diverged = true;
            self.kept[block * rows][l] = f64::NEG_INFINITY;
        }
        within(divergence::reach(&trials.state(place), trials.shape.dim), divergence::LAST)
    }

    /// Ends the game of one place at t_k, where somebody is caught.
    fn end(&mut self, trials: &Trials, place: usize, k: usize, ends: &mut [End]) {
        let trial = trials.who[place] as usize;
        let reach = Reach::new(trials.batch.capture_row(trials.first + trial, self.n + 1));
        if let Some(outcome) = reach.ends(&trials.state(place), trials.shape.dim) {
            self.over[place / BLOCK] |= 1 << (place % BLOCK);
            (ends[trial].outcome, ends[trial].step) = (outcome, k);
        }
    }

    fn rows(&self) -> usize {
        columns(self.n) + self.n + 1
    }

    /// The scores of one block with its distances at one more instant.
    fn take_in(&mut self, block: usize, now: &Distances) {
        let (n, rows) = (self.n, self.rows());
        let sigma = &self.radii[block * (n + 1)..][..n + 1];
        let kept = &mut self.kept[block * rows..][..rows];
        let before = (self.diverged[block] != 0).then(|| kept.to_vec());
        taken_in(self.width, n, sigma, now, kept);
        let Some(before) = before else { return };
        for l in members(self.diverged[block]) {
            kept.iter_mut().zip(&before).for_each(|(row, before)| row[l] = before[l]);
        }
    }

    /// Writes out what the score that is followed is at t_k.
    fn follow(&mut self, trials: &Trials, block: usize, k: usize) {
        let Some(Course { column, instants }) = self.course else { return };
        let row = &self.kept[block * self.rows() + column];
        for l in members(playing(trials.blocks.live, block)) {
            self.out[trials.who[block * BLOCK + l] as usize * instants + k] = row[l];
        }
    }

    /// Writes the scores of one place out, which t_k was the last instant of.
    fn write(&mut self, trials: &Trials, place: usize, k: usize) {
        if let Some(Course { instants, .. }) = self.course {
            let course = &mut self.out[trials.who[place] as usize * instants..][k..instants];
            let (now, later) = course.split_at_mut(1);
            later.fill(now[0]);
            return;
        }
        let count = columns(self.n);
        let from = &self.kept[place / BLOCK * self.rows()..];
        let out = &mut self.out[trials.who[place] as usize * count..][..count];
        out.iter_mut().zip(from).for_each(|(score, row)| *score = row[place % BLOCK]);
    }

    /// Takes the trial in one place out; the last one moves in.
    fn remove(&mut self, trials: &mut Trials, place: usize, k: usize) {
        self.write(trials, place, k);
        trials.remove(place);
        let last = trials.blocks.live;
        for (all, rows) in [(&mut self.radii, self.n + 1), (&mut self.kept, columns(self.n) + self.n + 1)] {
            for e in 0..rows {
                all[place / BLOCK * rows + e][place % BLOCK] = all[last / BLOCK * rows + e][last % BLOCK];
            }
        }
        for bits in [&mut self.over, &mut self.diverged] {
            let bit = bits[last / BLOCK] >> (last % BLOCK) & 1;
            bits[place / BLOCK] = bits[place / BLOCK] & !(1 << (place % BLOCK)) | bit << (place % BLOCK);
        }
    }

    /// The trials that are left at T: what is not over is out of time.
    pub(super) fn finish(mut self, trials: &mut Trials, last: usize, ends: &mut [End]) {
        self.observe(trials, last, ends);
        for place in 0..trials.blocks.live {
            self.write(trials, place, last);
        }
        for end in ends.iter_mut().filter(|end| end.outcome == Outcome::Timeout) {
            end.step = last;
        }
    }
}

/// Distances from the attacker, and their squares.
struct Distances {
    squares: Vec<PerTrial>,
    roots: Vec<PerTrial>,
}

impl Distances {
    fn new(rows: usize) -> Self {
        Self { squares: vec![[0.0; BLOCK]; rows], roots: vec![[0.0; BLOCK]; rows] }
    }
}

/// The places of a block that have a bit.
fn members(bits: u32) -> impl DoubleEndedIterator<Item = usize> {
    (0..BLOCK).filter(move |l| bits >> l & 1 == 1)
}

dispatch! {
    /// Distances of a block; a bit for each place in which somebody is within a radius, and for each beyond the limit.
    fn measured<V>(
        z: &[PerTrial],
        dim: usize,
        sigma: &[PerTrial],
        far: &PerTrial,
        now: &mut Distances,
    ) -> (u32, u32) {
        let (mut caught, mut near) = (0, u16::MAX);
        let far = V::Eight::load(far);
        for (i, row) in z.chunks_exact(dim).enumerate() {
            let mut d2 = V::Eight::splat(0.0);
            for x in row {
                let x = V::Eight::load(x);
                d2 = d2 + x * x;
            }
            let d = d2.sqrt();
            caught |= V::Eight::bits(d.at_most(V::Eight::load(&sigma[i])));
            // What is no number is beyond every limit.
            near &= V::Eight::bits(d2.at_most(far));
            d2.store(&mut now.squares[i]);
            d.store(&mut now.roots[i]);
        }
        (u32::from(caught), u32::from(!near))
    }
}

dispatch! {
    /// Scores and minima of a block with one more instant.
    fn taken_in<V>(n: usize, sigma: &[PerTrial], now: &Distances, kept: &mut [PerTrial]) {
        let (squares, d, sigma) = (&now.squares[..=n], &now.roots[..=n], &sigma[..=n]);
        let (scores, clear) = kept.split_at_mut(columns(n));
        let (own, of_team) = scores.split_at_mut(BEFORE);
        let (clear, of_team) = (&mut clear[..=n], &mut of_team[..n]);
        let (zero, missed) = (V::Eight::splat(0.0), V::Eight::splat(MISSED));
        let free = V::Eight::load(&clear[n]);
        let mut nearest = V::Eight::splat(f64::NEG_INFINITY);
        for i in 0..n {
            let (d_i, squares_i) = (V::Eight::load(&d[i]), V::Eight::load(&squares[i]));
            let within = V::Eight::load(&sigma[i]) - d_i;
            nearest = larger(nearest, within);
            let mut margin = smaller(free, within);
            for j in 0..n {
                if j == i {
                    continue;
                }
                let (d_j, squares_j) = (V::Eight::load(&d[j]), V::Eight::load(&squares[j]));
                // Of two equally near the one with the lower number intercepts. Roots of different squares may be equal:
                // the sign is that of the squares.
                let after = if j > i { squares_i.at_most(squares_j) } else { squares_i.less(squares_j) };
                let by = d_j - d_i;
                let by = V::Eight::select(after, larger(by, zero), smaller(by, missed));
                let first = larger(strict(d_j - V::Eight::load(&sigma[j])), by);
                margin = smaller(margin, smaller(V::Eight::load(&clear[j]), first));
            }
            larger(V::Eight::load(&of_team[i]), margin).store(&mut of_team[i]);
        }
        larger(V::Eight::load(&own[2]), smaller(nearest, free)).store(&mut own[2]);
        let mut all = V::Eight::splat(f64::INFINITY);
        for i in 0..n {
            let now_clear = strict(V::Eight::load(&d[i]) - V::Eight::load(&sigma[i]));
            let still = smaller(V::Eight::load(&clear[i]), now_clear);
            still.store(&mut clear[i]);
            all = smaller(all, still);
        }
        let beyond = V::Eight::load(&d[n]) - V::Eight::load(&sigma[n]);
        let within = V::Eight::load(&sigma[n]) - V::Eight::load(&d[n]);
        larger(V::Eight::load(&own[1]), smaller(within, all)).store(&mut own[1]);
        let free = smaller(free, strict(beyond));
        free.store(&mut clear[n]);
        smaller(V::Eight::load(&own[0]), smaller(all, free)).store(&mut own[0]);
    }
}

#[inline(always)]
fn smaller<T: Number>(a: T, b: T) -> T {
    T::select(a.less(b), a, b)
}

#[inline(always)]
fn larger<T: Number>(a: T, b: T) -> T {
    T::select(b.less(a), a, b)
}

/// The margin of a strict inequality.
#[inline(always)]
fn strict<T: Number>(margin: T) -> T {
    T::select(T::splat(0.0).less(margin), margin, smaller(margin, T::splat(MISSED)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strict_margin_is_never_zero() {
        assert_eq!([1.5, 5e-324, 0.0, -0.0, -2.0].map(strict), [1.5, 5e-324, -5e-324, -5e-324, -2.0]);
    }
}

//! Within a step: z(t_k + s) = exp(Cs) z(t_k) on halves, quarters and smaller parts of the step.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | exp(Cw) | [`Level::transition`] | over a part of length w = δ 2⁻ʲ |
//! | sup ‖exp(Cτ)‖, τ ≤ w | [`Level::growth`] | in the norm of row sums |
//! | Σ_j \|C_ij\|, C² | `norm`, `square` | what bounds ‖z̈_i‖ |

use super::state::apply;
use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::zeros;
use crate::policy::closed_loop;
use crate::policy::exponential::{exponential, multiply};

/// What asks for memory here.
const WHAT: &str = "the motion within a step";
/// Halvings of a step at most: 2⁻⁶⁴ of a step is below every rounding of its length.
pub(super) const LEVELS: usize = 64;
/// ‖C‖w up to which e^{‖C‖w} bounds the growth well.
pub(super) const SHORT: f64 = 1.0;
/// A chord is exact where it is off by no more than this part of its ends.
pub(super) const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// The parts of a step whose states are kept are numbered below this: halved six times.
const KEPT: usize = 1 << 7;

#[derive(Debug)]
pub(super) struct Level {
    transition: Vec<f64>,
    pub(super) growth: f64,
}

/// The motion of all rows of z over one step.
#[derive(Debug)]
pub(crate) struct Motion<'a> {
    pub(super) c: &'a [f64],
    pub(super) size: usize,
    pub(super) dim: usize,
    pub(super) step: f64,
    pub(super) norm: f64,
    pub(super) square: Vec<f64>,
    pub(super) levels: Vec<Level>,
    /// Parts that may still be looked at, and whether there were too few: what was found is then not to be relied on.
    pub(super) left: usize,
    pub(super) lost: bool,
    /// The rows that bound how a row turns: all, or where these were too many parts, only those that move it.
    pub(super) movers: Option<Vec<bool>>,
    pub(super) kept: Kept,
    pub(super) cancel: &'a CancelToken,
}

/// States that are asked for one row after another, by the number of their part: 1 is the step, 2i and 2i + 1 are the
/// halves of i, and 0 is none that is kept.
#[derive(Debug, Default)]
pub(super) struct Kept {
    /// Where the step begins.
    begin: Vec<f64>,
    /// C²z where a part begins.
    turning: Vec<Option<Vec<f64>>>,
    /// z where a part's second half begins.
    middle: Vec<Option<Vec<f64>>>,
}

impl<'a> Motion<'a> {
    /// Of ż = C z over `step`, for states of `dim` axes.
    pub(crate) fn new(
        c: &'a [f64],
        size: usize,
        dim: usize,
        step: f64,
        cancel: &'a CancelToken,
    ) -> Result<Self, Stopped> {
        let norm = closed_loop::norm(c, size);
        let mut square = zeros(WHAT, size * size)?;
        multiply(&mut square, c, c, size, cancel)?;
        Ok(Self {
            c,
            size,
            dim,
            step,
            norm,
            square,
            levels: Vec::new(),
            left: 0,
            lost: false,
            movers: None,
            kept: Kept::default(),
            cancel,
        })
    }

    /// The motion is asked for from `start` on.
    pub(super) fn begin(&mut self, start: &[f64]) {
        if self.kept.begin != start {
            let none = vec![None; KEPT];
            self.kept = Kept { begin: start.to_vec(), turning: none.clone(), middle: none };
        }
    }

    /// C²z at z, where part `number` begins.
    pub(super) fn turning(&mut self, number: usize, z: &[f64]) -> Vec<f64> {
        if let Some(Some(known)) = self.kept.turning.get(number) {
            return known.clone();
        }
        let turning = self.moved(&self.square, z);
        if number > 0 {
            self.kept.turning[number] = Some(turning.clone());
        }
        turning
    }

    /// z in the middle of part `number`, which begins at z and whose halves are of a level.
    pub(super) fn middle(&mut self, number: usize, level: usize, z: &[f64]) -> Result<Vec<f64>, Stopped> {
        if let Some(Some(known)) = self.kept.middle.get(number) {
            return Ok(known.clone());
        }
        self.level(level)?;
        let middle = self.moved(&self.levels[level].transition, z);
        if number > 0 {
            self.kept.middle[number] = Some(middle.clone());
        }
        Ok(middle)
    }

    /// The numbers of the halves of a part.
    pub(super) fn numbers(number: usize) -> [usize; 2] {
        if (1..KEPT / 2).contains(&number) { [2 * number, 2 * number + 1] } else { [0; 2] }
    }

    /// The rows that the motion of row i depends on, itself among them.
    pub(super) fn movers_of(&self, i: usize) -> Vec<bool> {
        let (mut movers, mut next) = (vec![false; self.size], vec![i]);
        movers[i] = true;
        while let Some(row) = next.pop() {
            for (j, &c) in self.c[row * self.size..(row + 1) * self.size].iter().enumerate() {
                if c != 0.0 && !movers[j] {
                    movers[j] = true;
                    next.push(j);
                }
            }
        }
        movers
    }

    /// z(s), and what h ∫₀ˢ exp(Cτ) dτ z(0) adds to the position of the player whose feedback is `row`.
    pub(crate) fn at(&self, s: f64, row: &[f64], start: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Stopped> {
        let (mut e, mut a) = (zeros(WHAT, self.size * self.size)?, vec![0.0; self.size]);
        exponential(self.c, row, s, &mut e, &mut a, self.cancel)?;
        let mut moved = vec![0.0; self.dim];
        apply(&a, start, self.dim, &mut moved);
        Ok((self.moved(&e, start), moved))
    }

    fn moved(&self, transition: &[f64], z: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; z.len()];
        for (row, out) in transition.chunks_exact(self.size).zip(out.chunks_exact_mut(self.dim)) {
            apply(row, z, self.dim, out);
        }
        out
    }

    pub(super) fn width(&self, level: usize) -> f64 {
        self.step * 0.5_f64.powi(level as i32)
    }

    /// The level that halves a step `j` times; those before it first.
    pub(super) fn level(&mut self, j: usize) -> Result<&Level, Stopped> {
        while self.levels.len() <= j {
            let level = self.levels.len();
            let mut transition = zeros(WHAT, self.size * self.size)?;
            let mut unused = vec![0.0; self.size];
            exponential(self.c, &vec![0.0; self.size], self.width(level), &mut transition, &mut unused, self.cancel)?;
            self.levels.push(Level { transition, growth: f64::NAN });
        }
        if self.levels[j].growth.is_nan() {
            let (size, n) = (self.norm * self.width(j), self.size);
            self.levels[j].growth = if size <= SHORT || j >= LEVELS {
                size.exp()
            } else {
                // Over two halves: what one of them can do, once more.
                let half = self.level(j + 1)?;
                half.growth * closed_loop::norm(&half.transition, n).max(1.0)
            };
        }
        Ok(&self.levels[j])
    }
}

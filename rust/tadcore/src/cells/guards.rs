//! What an enclosure leaves open at an instant: who may be caught, and which networks there may be.
//!
//! A distance is enclosed, squared, by [lo, hi]; it is within a reach for certain where hi is, beyond it for certain where lo
//! is. Both hold for the rounded square that the engine compares and for the exact one.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | ζ², σ² | [`Radii`] | squared reaches, as the engine has them |
//! | 𝒜 | [`Seen`] | the edges that are certain, and the choices that are not |

use super::enclosure::{Enclosure, Half};
use crate::network::squared_reach;
use crate::simulation::Outcome;
use crate::simulation::divergence::{LEAST, limit};

/// Roundings of a squared distance and its bounds, generously: 32 u.
const SLACK: f64 = 16.0 * f64::EPSILON;
/// Networks that one enclosure may ask for at one instant.
pub(super) const MOST_NETWORKS: usize = 8;

/// Squared reaches of all players.
#[derive(Debug)]
pub(super) struct Radii {
    sight: Vec<f64>,
    capture: Vec<f64>,
}

impl Radii {
    pub(super) fn new(visibility: &[f64], capture: &[f64]) -> Self {
        let squared = |radii: &[f64]| radii.iter().map(|&radius| squared_reach(radius)).collect();
        Self { sight: squared(visibility), capture: squared(capture) }
    }
}

/// A squared distance from below and above.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    lo: f64,
    hi: f64,
}

impl Range {
    fn within(self, reach: f64) -> bool {
        self.hi <= reach
    }

    fn beyond(self, reach: f64) -> bool {
        self.lo > reach
    }
}

/// From the middle of a difference and its half-width, an axis each.
#[inline(always)]
fn range(parts: [(f64, f64); 2]) -> Range {
    let (mut lo, mut hi) = (0.0, 0.0);
    for (middle, width) in parts {
        let middle = middle.abs();
        let width = width + SLACK * (middle + width);
        let near = (middle - width).max(0.0);
        lo += near * near;
        hi += (middle + width) * (middle + width);
    }
    Range { lo: lo * (1.0 - SLACK) - f64::MIN_POSITIVE, hi: hi * (1.0 + SLACK) + f64::MIN_POSITIVE }
}

/// ‖z_i‖².
fn norm(e: &Enclosure, i: usize, half: Half) -> Range {
    range([0, 1].map(|x| (e.centre[x][i], e.slope[i].abs() * half[x] + e.error[x][i])))
}

/// ‖z_i − z_j‖², with a bound for the difference of their errors.
#[inline(always)]
fn distance(e: &Enclosure, i: usize, j: usize, half: Half, error: impl Fn(usize) -> f64) -> Range {
    let tilt = (e.slope[i] - e.slope[j]).abs();
    range([0, 1].map(|x| (e.centre[x][i] - e.centre[x][j], tilt * half[x] + error(x))))
}

/// Largest distances at the start: the squared scale of the starts of a cell, from below and above.
pub(super) fn scale(e: &Enclosure, half: Half) -> (f64, f64) {
    let mut most = (0.0_f64, 0.0_f64);
    for i in 0..e.size {
        for j in 0..=i {
            let Range { lo, hi } =
                if i == j { norm(e, i, half) } else { distance(e, i, j, half, |x| e.error[x][i] + e.error[x][j]) };
            most = (most.0.max(lo), most.1.max(hi));
        }
    }
    (limit(most.0) * (1.0 - SLACK), limit(most.1.max(LEAST)) * (1.0 + SLACK))
}

/// How the starts of an enclosure may end at an instant.
#[derive(Debug, Clone, Default)]
pub(super) struct Ends {
    /// What may happen.
    pub(super) possible: Vec<Outcome>,
    /// Whether something does for all of them.
    pub(super) over: bool,
    /// Whether some may be further off than a game that has not diverged; all are, where the second is set.
    pub(super) far: (bool, bool),
    /// ‖z_i‖² of every row.
    norms: Vec<Range>,
}

/// Who may be caught; `limits` are the squared distances from below and above of which [`scale`] tells.
pub(super) fn ends(e: &Enclosure, half: Half, radii: &Radii, limits: (f64, f64), out: &mut Ends) {
    out.possible.clear();
    (out.over, out.far) = (false, (false, false));
    let target = e.size - 1;
    let mut sure = false;
    out.norms.clear();
    for i in 0..e.size {
        let d = norm(e, i, half);
        out.norms.push(d);
        out.far.0 |= d.hi.is_nan() || d.hi > limits.0;
        out.far.1 |= d.lo > limits.1;
        if i == target || d.beyond(radii.capture[i]) {
            continue;
        }
        sure |= d.within(radii.capture[i]);
        out.possible.push(Outcome::Intercepted(i));
    }
    if out.possible.len() > 1 && sure {
        // Not the nearest, if another is nearer and in its own reach for certain.
        let all = std::mem::take(&mut out.possible);
        let norms = &out.norms;
        let beaten = |i: usize| (0..target).any(|j| norms[j].within(radii.capture[j]) && norms[j].hi < norms[i].lo);
        out.possible.extend(all.into_iter().filter(|end| matches!(end, Outcome::Intercepted(i) if !beaten(*i))));
    }
    out.over = sure;
    if !sure {
        let d = out.norms[target];
        if !d.beyond(radii.capture[target]) {
            out.possible.push(Outcome::Captured);
            out.over = d.within(radii.capture[target]);
        }
    }
}

/// The networks that an enclosure may have.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    /// Edges of all of them, 64 a word.
    base: Vec<u64>,
    /// Choices, each between sets of edges: pairs of (bit, or none).
    choices: Vec<Vec<[Option<usize>; 2]>>,
}

impl Seen {
    /// Reads the networks that there may be; what [`ends`] found first.
    pub(super) fn read(&mut self, e: &Enclosure, half: Half, radii: &Radii, ends: &Ends) {
        let (n, m) = (e.size, radii.sight.len());
        self.base.clear();
        self.base.resize((n * m).div_ceil(64), 0);
        self.choices.clear();
        for i in 0..n {
            if i < m {
                self.pair(ends.norms[i], (radii.sight[i], Some(i * n + i)), (f64::NAN, None));
            }
            for j in 0..i {
                let one = (radii.sight.get(i).copied().unwrap_or(f64::NAN), (i < m).then_some(i * n + j));
                let other = (radii.sight.get(j).copied().unwrap_or(f64::NAN), (j < m).then_some(j * n + i));
                let mut d = distance(e, i, j, half, |x| e.error[x][i] + e.error[x][j]);
                let open = |d: Range, (reach, bit): (f64, Option<usize>)| {
                    bit.is_some() && !d.within(reach) && !d.beyond(reach)
                };
                if open(d, one) || open(d, other) {
                    d = distance(e, i, j, half, |x| e.apart(i, j, x));
                }
                self.pair(d, one, other);
            }
        }
    }

    /// Two edges that depend on the same distance.
    fn pair(&mut self, d: Range, one: (f64, Option<usize>), other: (f64, Option<usize>)) {
        let mut open = [None; 2];
        for (slot, (reach, bit)) in open.iter_mut().zip([one, other]) {
            let Some(bit) = bit else { continue };
            if d.within(reach) {
                self.base[bit / 64] |= 1 << (bit % 64);
            } else if !d.beyond(reach) {
                *slot = Some(bit);
            }
        }
        match open {
            [None, None] => {}
            [Some(a), Some(b)] => {
                // Who sees further sees first; of two that see as far both see, or none.
                let mut sets = vec![[None, None], [Some(a), Some(b)]];
                if one.0 < other.0 {
                    sets.insert(1, [None, Some(b)]);
                } else if other.0 < one.0 {
                    sets.insert(1, [Some(a), None]);
                }
                self.choices.push(sets);
            }
            [bit, None] | [None, bit] => self.choices.push(vec![[None, None], [bit, None]]),
        }
    }

    /// How many networks there may be.
    pub(super) fn count(&self) -> usize {
        self.choices.iter().map(Vec::len).fold(1, usize::saturating_mul)
    }

    /// Writes one of them, by its number.
    pub(super) fn network(&self, mut number: usize, words: &mut Vec<u64>) {
        words.clear();
        words.extend_from_slice(&self.base);
        for sets in &self.choices {
            for bit in sets[number % sets.len()].into_iter().flatten() {
                words[bit / 64] |= 1 << (bit % 64);
            }
            number /= sets.len();
        }
    }
}

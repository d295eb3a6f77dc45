//! The canonical start and the variables: what a topology leaves free.
//!
//! Row i of the gains lies in the row space of 𝓘_i: entries on the players it sees and on itself; when it does not see
//! the attacker these sum to zero, because it then knows only differences z_j − z_i. A player that sees no one has no
//! variable at all. A variable is a direction e_j, or e_j − e_i in a row that does not see the attacker.
//!
//! The canonical start is the orthogonal projection of the FNE rows on these spaces: the minimiser of the ‖S‖² terms
//! alone. It depends on (t_k, topology) and on nothing else.

use super::problem::Problem;
use crate::lanes::Number;
use crate::network::Topology;

/// One variable: the direction e_j, less e_i in a row that does not see the attacker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Variable {
    /// Position of (i, j) in the m × N gains.
    pub entry: usize,
    /// Position of (i, i), subtracted when `relative`.
    pub own: usize,
    /// Whether row i knows differences only.
    pub relative: bool,
}

/// The variables of `topology`, row by row.
pub(super) fn variables(topology: &Topology) -> Vec<Variable> {
    let mut out = Vec::new();
    let n = topology.size();
    for i in 0..topology.rows() {
        let own = i * n + i;
        let relative = !topology.sees_attacker(i);
        for j in (0..n).filter(|&j| j == i || topology.sees(i, j)) {
            if j != i || !relative {
                out.push(Variable { entry: i * n + j, own, relative });
            }
        }
    }
    out
}

/// The paper's own variables, the entries of K_i: e_j − e_i for each player seen, e_i when the attacker is seen.
pub(super) fn paper_variables(topology: &Topology) -> Vec<Variable> {
    let mut out = Vec::new();
    let n = topology.size();
    for i in 0..topology.rows() {
        for j in (0..n).filter(|&j| topology.sees(i, j)) {
            out.push(Variable { entry: i * n + j, own: i * n + i, relative: j != i });
        }
    }
    out
}

/// Writes the canonical start into `g` (m × N).
pub(super) fn canonical(problem: &Problem, topology: &Topology, g: &mut [f64]) {
    let n = problem.size;
    for i in 0..problem.rows {
        let relative = !topology.sees_attacker(i);
        let used = |j: usize| j == i || topology.sees(i, j);
        let row = &problem.fne[i * n..(i + 1) * n];
        let (mut sum, mut count) = (0.0, 0.0);
        for j in (0..n).filter(|&j| used(j)) {
            sum += row[j];
            count += 1.0;
        }
        let mean = if relative { sum / count } else { 0.0 };
        for j in 0..n {
            g[i * n + j] = if used(j) { row[j] - mean } else { 0.0 };
        }
        if relative && count == 1.0 {
            g[i * n + i] = 0.0;
        }
    }
}

/// A variable of at least one of several networks side by side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slot<T: Number> {
    entry: usize,
    own: usize,
    /// The lanes that have this variable.
    active: T::Mask,
    /// The lanes in which it is relative.
    relative: T::Mask,
    /// Whether it is relative in any.
    differs: bool,
}

/// The variables of the networks in the lanes: an unknown that a lane does not have stays where it is.
#[derive(Debug)]
pub(super) struct Layout<T: Number> {
    slots: Vec<Slot<T>>,
    /// By position in the gains: the lanes that have it as a variable, those in which it is relative, and its row's own.
    seen: Vec<(u8, u8, usize)>,
}

impl<T: Number> Default for Layout<T> {
    fn default() -> Self {
        Self { slots: Vec::new(), seen: Vec::new() }
    }
}

impl<T: Number> Layout<T> {
    /// Lists the variables of the lanes, for as many copies of the `width` gains.
    #[inline(always)]
    pub(super) fn list(&mut self, lanes: [&[Variable]; 8], width: usize, copies: usize) {
        self.seen.clear();
        self.seen.resize(width, (0, 0, 0));
        for (lane, variables) in lanes.into_iter().enumerate() {
            for v in variables {
                let seen = &mut self.seen[v.entry];
                seen.0 |= 1 << lane;
                seen.1 |= u8::from(v.relative) << lane;
                seen.2 = v.own;
            }
        }
        self.slots.clear();
        for copy in 0..copies {
            for (entry, &(active, relative, own)) in self.seen.iter().enumerate() {
                if active != 0 {
                    let (entry, own) = (copy * width + entry, copy * width + own);
                    let (active, differs) = (T::mask(active), relative != 0);
                    self.slots.push(Slot { entry, own, active, relative: T::mask(relative), differs });
                }
            }
        }
    }

    /// The unknowns.
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    /// The lanes that have an unknown.
    #[inline(always)]
    pub(super) fn active(&self, slot: usize) -> T::Mask {
        self.slots[slot].active
    }

    /// The largest diagonal entry of a restricted form.
    #[inline(always)]
    pub(super) fn largest(&self, form: &[T]) -> T {
        let (d, mut largest) = (self.slots.len(), T::splat(0.0));
        for i in 0..d {
            largest = largest.or_larger(form[i * d + i].abs());
        }
        largest
    }

    /// Adds Σ x_v · direction_v to the gains.
    #[inline(always)]
    pub(super) fn advance(&self, g: &mut [T], x: &[T]) {
        for (v, &x) in self.slots.iter().zip(x) {
            g[v.entry] = g[v.entry] + x;
            if v.differs {
                g[v.own] = T::select(v.relative, g[v.own] - x, g[v.own]);
            }
        }
    }

    /// Restricts a gradient with respect to the m × N gains to the variables.
    #[inline(always)]
    pub(super) fn restrict(&self, full: &[T], out: &mut [T]) {
        for (v, out) in self.slots.iter().zip(out) {
            let mut x = full[v.entry];
            if v.differs {
                x = T::select(v.relative, x - full[v.own], x);
            }
            *out = T::select(v.active, x, T::splat(0.0));
        }
    }

    /// Restricts a quadratic form on the gains (`width` × `width`, row-major, overwritten) to the variables; lower
    /// triangle of `out`.
    #[inline(always)]
    pub(super) fn restrict_form(&self, full: &mut [T], width: usize, out: &mut [T]) {
        let d = self.slots.len();
        for (a, va) in self.slots.iter().enumerate() {
            if va.differs {
                subtract_row(full, width, va);
            }
            let row = &full[va.entry * width..][..width];
            for (vb, out) in self.slots[..a + 1].iter().zip(&mut out[a * d..][..a + 1]) {
                let mut x = row[vb.entry];
                if vb.differs {
                    x = T::select(vb.relative, x - row[vb.own], x);
                }
                *out = if T::LANES > 1 {
                    T::select(va.active, T::select(vb.active, x, T::splat(0.0)), T::splat(0.0))
                } else {
                    x
                };
            }
        }
    }
}

/// Takes the own row off a variable's, in the lanes in which it is relative.
#[inline(always)]
fn subtract_row<T: Number>(full: &mut [T], width: usize, v: &Slot<T>) {
    for c in 0..v.entry.max(v.own) + 1 {
        let (x, own) = (full[v.entry * width + c], full[v.own * width + c]);
        full[v.entry * width + c] = T::select(v.relative, x - own, x);
    }
}

/// Adds Σ x_v · direction_v to one network's gains.
pub(super) fn advance(g: &mut [f64], variables: &[Variable], x: &[f64]) {
    for (v, &x) in variables.iter().zip(x) {
        g[v.entry] += x;
        if v.relative {
            g[v.own] -= x;
        }
    }
}

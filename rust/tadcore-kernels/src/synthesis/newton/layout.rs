//! The unknowns of several networks side by side, and forms on the gains restricted to them.

use super::variables::Variable;
use crate::cancel::{CancelToken, raised};
use crate::error::NoMemory;
use crate::memory::reserve;
use crate::simd::Number;

/// What asks for memory here.
const WHAT: &str = "the unknowns of one network";
/// Entries of a row, for each unknown, from which they are asked for singly.
const SPARSE: usize = 12;
/// Rows of a form between two looks at the cancel token.
const POLL: usize = 16;

/// Unknowns come in groups of this size, that factorisations take at once: the last are filled up with empty ones.
pub const GROUP: usize = 4;

/// An unknown: the variable of at least one of the networks side by side, or of none.
#[derive(Debug, Clone, Copy)]
pub struct Slot<T: Number> {
    /// Position of (i, j) in the gains.
    pub entry: usize,
    /// Position of (i, i), subtracted where the variable is relative.
    pub own: usize,
    /// The lanes that have this variable.
    active: T::Mask,
    /// 1 in lanes in which it is relative, 0 in others.
    pub relative: T,
    /// Whether it is relative in any.
    pub differs: bool,
}

/// A quadratic form on the gains, given by rows.
pub trait Form<T: Number> {
    /// Writes the form's product with the direction of `v`: its entries before and in the block of `v`.
    fn row(&self, g: &[T], v: &Slot<T>, out: &mut [T]);

    /// One entry of that product, where the form gives them singly.
    fn entry(&self, _g: &[T], _v: &Slot<T>, _at: usize) -> Option<T> {
        None
    }
}

/// The variables of the networks in the lanes: an unknown that a lane does not have stays where it is.
#[derive(Debug)]
pub struct Layout<T: Number> {
    slots: Vec<Slot<T>>,
    /// The slots that are not empty in all lanes.
    used: usize,
    copies: usize,
    /// By position in the gains: the lanes that have it as a variable, those in which it is relative, and its row's own.
    seen: Vec<(u16, u16, usize)>,
}

impl<T: Number> Default for Layout<T> {
    fn default() -> Self {
        Self { slots: Vec::new(), used: 0, copies: 1, seen: Vec::new() }
    }
}

/// Where row i of a packed lower triangle begins.
#[inline(always)]
pub fn packed(i: usize) -> usize {
    i * (i + 1) / 2
}

impl<T: Number> Layout<T> {
    /// Makes room for gains of `width` entries, so many of them unknown.
    #[inline(always)]
    pub fn reserve(&mut self, width: usize, unknowns: usize) -> Result<(), NoMemory> {
        self.seen.clear();
        self.slots.clear();
        reserve(WHAT, &mut self.seen, width)?;
        reserve(WHAT, &mut self.slots, unknowns.next_multiple_of(GROUP))
    }

    /// Begins with empty lanes, for `copies` copies of `width` gains.
    #[inline(always)]
    pub fn begin(&mut self, width: usize, copies: usize) {
        self.copies = copies;
        self.seen.clear();
        self.seen.resize(width, (0, 0, 0));
    }

    /// Gives a lane its variables. What follows holds once the slots are [listed](Self::list).
    #[inline(always)]
    pub fn place(&mut self, lane: usize, variables: &[Variable]) {
        let bit = 1u16 << lane;
        for seen in &mut self.seen {
            seen.0 &= !bit;
            seen.1 &= !bit;
        }
        for v in variables {
            let seen = &mut self.seen[v.entry];
            seen.0 |= bit;
            seen.1 |= if v.relative { bit } else { 0 };
            seen.2 = v.own;
        }
    }

    /// Lists the unknowns of the lanes.
    #[inline(always)]
    pub fn list(&mut self) {
        self.slots.clear();
        let (width, one, zero) = (self.seen.len(), T::splat(1.0), T::splat(0.0));
        for copy in 0..self.copies {
            for (entry, &(active, relative, own)) in self.seen.iter().enumerate() {
                if active != 0 {
                    self.slots.push(Slot {
                        entry: copy * width + entry,
                        own: copy * width + own,
                        active: T::mask(active),
                        relative: T::select(T::mask(relative), one, zero),
                        differs: relative != 0,
                    });
                }
            }
        }
        self.used = self.slots.len();
        let empty = Slot { entry: 0, own: 0, active: T::mask(0), relative: zero, differs: false };
        self.slots.resize(self.used.next_multiple_of(GROUP), empty);
    }

    /// The unknowns, empty ones included.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// The unknowns that are not empty in all lanes: the first ones.
    #[inline(always)]
    pub fn used(&self) -> usize {
        self.used
    }

    /// The unknowns that are not empty.
    pub fn listed(&self) -> &[Slot<T>] {
        &self.slots[..self.used]
    }

    /// The lanes that have an unknown.
    #[inline(always)]
    pub fn active(&self, slot: usize) -> T::Mask {
        self.slots[slot].active
    }

    /// The diagonal of a quadratic form restricted to the variables.
    #[inline(always)]
    pub fn diagonal(&self, form: &impl Form<T>, g: &[T], row: &mut [T], out: &mut [T]) {
        for (v, out) in self.slots[..self.used].iter().zip(out) {
            let x = if let (Some(x), Some(own)) = (form.entry(g, v, v.entry), form.entry(g, v, v.own)) {
                x.minus(v.relative, own)
            } else {
                form.row(g, v, row);
                row[v.entry].minus(v.relative, row[v.own])
            };
            *out = if T::LANES > 1 { T::select(v.active, x, T::splat(0.0)) } else { x };
        }
    }

    /// The largest diagonal entry of a restricted form.
    #[inline(always)]
    pub fn largest(&self, form: &[T]) -> T {
        let mut largest = T::splat(0.0);
        for i in 0..self.used {
            largest = largest.or_larger(form[packed(i) + i].abs());
        }
        largest
    }

    /// Adds Σ x_v · direction_v to the gains.
    #[inline(always)]
    pub fn advance(&self, g: &mut [T], x: &[T]) {
        for (v, &x) in self.slots[..self.used].iter().zip(x) {
            g[v.entry] = g[v.entry] + x;
            g[v.own] = g[v.own].minus(v.relative, x);
        }
    }

    /// Restricts a gradient with respect to the m × N gains to the variables.
    #[inline(always)]
    pub fn restrict(&self, full: &[T], out: &mut [T]) {
        for (v, out) in self.slots.iter().zip(out) {
            *out = T::select(v.active, full[v.entry].minus(v.relative, full[v.own]), T::splat(0.0));
        }
    }

    /// Restricts a quadratic form on the gains to the variables: the packed lower triangle of `out`. `row` holds one of
    /// the form's. Once `cancel` is raised the triangle is not finished.
    #[inline(always)]
    pub fn restrict_form(
        &self,
        form: &impl Form<T>,
        g: &[T],
        row: &mut [T],
        out: &mut [T],
        cancel: Option<&CancelToken>,
    ) {
        let zero = T::splat(0.0);
        for (a, va) in self.slots[..self.used].iter().enumerate() {
            if a % POLL == POLL - 1 && raised(cancel) {
                return;
            }
            if T::LANES == 1 && SPARSE * self.used < row.len() {
                let mut known = true;
                for (vb, out) in self.slots[..a + 1].iter().zip(&mut out[packed(a)..packed(a + 1)]) {
                    let Some(x) = form.entry(g, va, vb.entry) else {
                        known = false;
                        break;
                    };
                    *out = x;
                    if vb.differs
                        && let Some(own) = form.entry(g, va, vb.own)
                    {
                        *out = x.minus(vb.relative, own);
                    }
                }
                if known {
                    continue;
                }
            }
            form.row(g, va, row);
            for (vb, out) in self.slots[..a + 1].iter().zip(&mut out[packed(a)..packed(a + 1)]) {
                let x = row[vb.entry].minus(vb.relative, row[vb.own]);
                *out = if T::LANES > 1 { T::select(va.active, T::select(vb.active, x, zero), zero) } else { x };
            }
        }
        for x in &mut out[packed(self.used)..packed(self.slots.len())] {
            *x = zero;
        }
    }
}

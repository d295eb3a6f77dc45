//! A network that is being solved: its variables, the best gains found so far, and the start that led to them.

use crate::error::NoMemory;
use crate::memory::{copy, within};
use crate::simd::norm;
use crate::synthesis::newton::{Incumbent, Owner, Reached, Variable, balance};

/// The start whose descent won.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Newton from the canonical start.
    Canonical,
    /// The end of a descent in complex gains.
    Complex,
    /// The end of a descent in stacked gains.
    Stacked,
    /// The best gains with rows reversed, or the canonical start with a row left out.
    Reversed,
    /// Between the minima at two instants around.
    Between,
}

/// Distance, relative to the best gains, at which a descent is taken to be back at them; a second part B that is as
/// small makes no other points of A + B and A − B.
pub(crate) const BACK: f64 = 1e-3;
/// How much lower, relatively, a restart must lead to win.
pub(crate) const TIE: f64 = 1e-9;

/// Iterations of the first descent up to which later ones may end early, back at the best point or unable to win: more
/// of them mean a narrow valley, whose floor is worth following to its end.
const QUICK: usize = 30;

/// One network at the instant: its variables, and the best gains found so far.
#[derive(Debug)]
pub(crate) struct Candidate {
    /// N.
    size: usize,
    pub variables: Vec<Variable>,
    pub initial: Vec<f64>,
    pub g: Vec<f64>,
    pub reached: Reached,
    pub start: Start,
    pub certified: bool,
    /// Iterations of all descents together.
    pub iterations: usize,
    /// Whether its first descent says that later ones may end early.
    pub quick: bool,
    /// Whether every constrained player sees everyone. The canonical start is then the equilibrium, where Θ, a sum of
    /// squares, is zero: the global minimum, and nothing is left to be done.
    pub complete: bool,
    /// Restarts of a large game that promised to lead lower, beyond those made.
    pub left_out: usize,
}

impl Candidate {
    /// A network of N = `size` that starts from `start`; `complete` says whether every constrained player sees everyone in it.
    pub(crate) fn new(
        variables: Vec<Variable>,
        start: Vec<f64>,
        size: usize,
        complete: bool,
    ) -> Result<Self, NoMemory> {
        Ok(Self {
            size,
            variables,
            complete,
            g: copy("the gains of one network", &start)?,
            initial: start,
            reached: Reached::default(),
            start: Start::Canonical,
            certified: false,
            iterations: 0,
            quick: false,
            left_out: 0,
        })
    }

    /// The same network, for another search.
    pub(crate) fn again(&self) -> Result<Self, NoMemory> {
        Self::new(self.variables.clone(), copy("the gains of one network", &self.initial)?, self.size, self.complete)
    }

    /// Notes, after the first descent, whether later ones may end early.
    pub(crate) fn note_quick(&mut self) {
        self.quick = self.iterations <= QUICK;
    }

    pub(crate) fn owner(&self) -> Owner<'_> {
        let incumbent = Incumbent { g: &self.g, value: self.reached.value, near: BACK * norm(&self.g) };
        Owner { variables: &self.variables, incumbent: self.quick.then_some(incumbent) }
    }

    /// Makes a point of single precision one of this network again: rows that know differences only sum to zero, and rows
    /// without a variable are those of the start.
    pub(crate) fn in_double(&self, point: &mut [f64]) {
        balance(point, &self.variables);
        let n = self.size;
        let mut variables = self.variables.iter().map(|v| v.entry / n).peekable();
        for (i, (row, initial)) in point.chunks_exact_mut(n).zip(self.initial.chunks_exact(n)).enumerate() {
            if variables.peek() != Some(&i) {
                row.copy_from_slice(initial);
            }
            while variables.next_if_eq(&i).is_some() {}
        }
    }

    /// Keeps what a descent of `start` reached.
    pub(crate) fn take(&mut self, start: Start, g: &[f64], reached: Reached) {
        self.g.copy_from_slice(g);
        (self.reached, self.start) = (reached, start);
    }

    /// Keeps what a restart reached when it is lower; says whether it is.
    pub(crate) fn offer(&mut self, start: Start, g: &[f64], reached: Reached) -> bool {
        self.iterations += reached.iterations;
        let lower = reached.value < self.reached.value - TIE * self.reached.value.abs();
        if lower {
            self.take(start, g, reached);
        }
        lower
    }
}

/// The most bytes that the matrices of one descent may take: past some 9,000 unknowns its factorisations, of which there
/// are hundreds, would take minutes each.
const MOST_BYTES: u64 = 4 << 30;
/// Bytes for each pair of unknowns: a factor, and the Hessian's triangle.
const PAIR_BYTES: u128 = 12;

/// Refuses a candidate whose search would take too much memory, before anything is allocated for it.
pub(crate) fn admit(candidate: &Candidate) -> Result<(), NoMemory> {
    if candidate.complete {
        return Ok(());
    }
    // Twice as many in doubled gains.
    let unknowns = 2 * candidate.variables.len() as u128;
    within("the synthesis of the gains under one network", PAIR_BYTES * unknowns.pow(2), MOST_BYTES)
}

//! A network that is being solved: its variables, the best gains found so far, and the start that led to them.

use crate::error::NoMemory;
use crate::memory::copy;
use crate::simd::norm;
use crate::synthesis::newton::{Incumbent, Owner, Reached, Variable};

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
}

/// Distance, relative to the best gains, at which a descent is taken to be back at them; a second part B that is as
/// small makes no other points of A + B and A − B.
pub(crate) const BACK: f64 = 1e-3;
/// How much lower, relatively, a restart must lead to win.
pub(crate) const TIE: f64 = 1e-9;

/// One network at the instant: its variables, and the best gains found so far.
#[derive(Debug)]
pub(crate) struct Candidate {
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
}

impl Candidate {
    /// A network that starts from `start`.
    pub(crate) fn new(variables: Vec<Variable>, start: Vec<f64>) -> Result<Self, NoMemory> {
        let complete = variables.len() == start.len();
        Ok(Self {
            variables,
            complete,
            g: copy("the gains of one network", &start)?,
            initial: start,
            reached: Reached::default(),
            start: Start::Canonical,
            certified: false,
            iterations: 0,
            quick: false,
        })
    }

    pub(crate) fn owner(&self) -> Owner<'_> {
        let incumbent = Incumbent { g: &self.g, value: self.reached.value, near: BACK * norm(&self.g) };
        Owner { variables: &self.variables, incumbent: self.quick.then_some(incumbent) }
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

//! A network that is being solved: its variables, the best gains found so far, and the look that found them.

use crate::simd::norm;
use crate::synthesis::newton::{Owner, Reached, Rival, Variable};

/// The look that won.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Newton from the canonical start.
    Canonical,
    /// The second look, in complex gains.
    Complex,
    /// The third look, in stacked gains.
    Stacked,
    /// The last look, with rows reversed or left out.
    Reversed,
}

/// Distance, relative to the best gains, at which a descent is taken to be back at them; a second part B that is as
/// small makes no other points of A + B and A − B.
pub(crate) const BACK: f64 = 1e-3;
/// How much lower, relatively, a look must be to win.
const TIE: f64 = 1e-9;

/// One network at the instant: its variables, and the best gains found so far.
#[derive(Debug)]
pub(crate) struct Entry {
    pub variables: Vec<Variable>,
    pub start: Vec<f64>,
    pub g: Vec<f64>,
    pub reached: Reached,
    pub look: Look,
    pub certified: bool,
    /// Iterations of all descents together.
    pub iterations: usize,
    /// Whether its first descent says that later ones may end early.
    pub quick: bool,
}

impl Entry {
    /// A network that starts from `start`.
    pub(crate) fn new(variables: Vec<Variable>, start: Vec<f64>) -> Self {
        Self {
            variables,
            g: start.clone(),
            start,
            reached: Reached::default(),
            look: Look::Canonical,
            certified: false,
            iterations: 0,
            quick: false,
        }
    }

    pub(crate) fn owner(&self) -> Owner<'_> {
        let rival = Rival { g: &self.g, value: self.reached.value, near: BACK * norm(&self.g) };
        Owner { variables: &self.variables, rival: self.quick.then_some(rival) }
    }

    /// Keeps what a descent of `look` reached.
    pub(crate) fn take(&mut self, look: Look, g: &[f64], reached: Reached) {
        self.g.copy_from_slice(g);
        (self.reached, self.look) = (reached, look);
    }

    /// Keeps what a descent of a further look reached when it is lower; says whether it is.
    pub(crate) fn offer(&mut self, look: Look, g: &[f64], reached: Reached) -> bool {
        self.iterations += reached.iterations;
        let lower = reached.value < self.reached.value - TIE * self.reached.value.abs();
        if lower {
            self.take(look, g, reached);
        }
        lower
    }
}

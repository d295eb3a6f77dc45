//! The game: who wants what, for how long, on which grid.
//!
//! Everything here is a reduced Kronecker factor: every weight of the paper is a scalar times **I**₂, so the number of
//! axes never enters. Positions, visibility radii and capture radii are *not* part of a [`Game`]; they are given to a
//! run. Anything that changes a weight, λ, T or δ makes another `Game`.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | n, N | [`Game::n`], [`Game::size`] | defenders; N = n + 1 players relative to the attacker |
//! | r_{d_i}, r_τ, r_a | `r_d`, `r_tau`, `r_a` | control weights |
//! | q_{d_i a}, f_{d_i a} | `q_da`, `f_da` | defender's weight on its distance to the attacker (I1) |
//! | q_{a d_i}, f_{a d_i} | `q_ad`, `f_ad` | attacker's weight on evading the defender |
//! | q_{aτ}, f_{aτ} | `q_atau`, `f_atau` | attacker's weight on reaching the target |
//! | q_{τa}, f_{τa} | `q_taua`, `f_taua` | target's weight on fleeing the attacker (I1) |
//! | λ | `lambda` | 0 suicidal, 1 evading attacker (I1) |
//! | γ | `gamma` | weights of Θ₁ (four) or Θ₂ (three) |
//!
//! Source: the paper's section II, eq:fullobj (I1) and eq:obj:zero_sum (I2).

pub mod bank;
mod grid;
pub(crate) mod validation;

pub use grid::Grid;

use crate::error::GameError;
use crate::simd;

/// Which of the paper's two interactions is played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Interaction {
    /// Defenders with limited observations against an attacker and a target that see everything (non-zero-sum).
    I1,
    /// Defenders and target with limited observations, one team against the attacker (zero-sum).
    I2,
}

impl Interaction {
    /// Terms of Θ: four in I1 (ΔQ_d, ΔQ_τ, ΔQ_a, S₁), three in I2 (ΔQ, S₂, S₃).
    #[must_use]
    pub fn terms(self) -> usize {
        match self {
            Self::I1 => 4,
            Self::I2 => 3,
        }
    }
}

/// What the gains of the players with limited observations minimise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Criterion {
    /// T1, the paper's: Θ over the rows of all of them.
    #[default]
    Paper,
    /// T2: who knows everything plays the equilibrium; Θ over the rows of the others.
    Component,
}

/// The scalars that define the players' objectives.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    /// r_{d_i}.
    pub r_d: Vec<f64>,
    /// r_τ.
    pub r_tau: f64,
    /// r_a.
    pub r_a: f64,
    /// q_{d_i a}; empty in I2.
    pub q_da: Vec<f64>,
    /// f_{d_i a}; empty in I2.
    pub f_da: Vec<f64>,
    /// q_{a d_i}.
    pub q_ad: Vec<f64>,
    /// f_{a d_i}.
    pub f_ad: Vec<f64>,
    /// q_{aτ}.
    pub q_atau: f64,
    /// f_{aτ}.
    pub f_atau: f64,
    /// q_{τa}; not read in I2.
    pub q_taua: f64,
    /// f_{τa}; not read in I2.
    pub f_taua: f64,
    /// λ; not read in I2.
    pub lambda: f64,
    /// γ.
    pub gamma: Vec<f64>,
}

/// A valid, immutable game.
#[derive(Debug, Clone, PartialEq)]
pub struct Game {
    interaction: Interaction,
    weights: Weights,
    grid: Grid,
    /// The horizon of the prediction as a grid of one step, where it recedes.
    prediction: Option<Grid>,
    criterion: Criterion,
}

impl Game {
    /// A game, once every weight and the grid have been checked.
    ///
    /// # Errors
    /// [`GameError`] naming the first field that breaks its rule, or `TADCORE_SIMD` if that cannot be followed.
    pub fn new(interaction: Interaction, weights: Weights, grid: Grid) -> Result<Self, GameError> {
        simd::in_use()?;
        validation::weights(interaction, weights.r_d.len(), &weights)?;
        validation::size(interaction, weights.r_d.len(), grid.steps())?;
        Ok(Self { interaction, weights, grid, prediction: None, criterion: Criterion::Paper })
    }

    /// The same game under another criterion.
    #[must_use]
    pub fn with_criterion(self, criterion: Criterion) -> Self {
        Self { criterion, ..self }
    }

    /// The same game with a receding horizon: at every instant the players use P at the beginning of a horizon `ahead`, as
    /// if the game ended so much later. P is then constant, and it is played up to T all the same.
    ///
    /// # Errors
    /// [`GameError::Value`] when `ahead` is not a positive finite number.
    pub fn receding(self, ahead: f64) -> Result<Self, GameError> {
        validation::positive("prediction_horizon", ahead)?;
        Ok(Self { prediction: Some(Grid::new(ahead, ahead)?), ..self })
    }

    /// What the gains minimise.
    #[must_use]
    pub fn criterion(&self) -> Criterion {
        self.criterion
    }

    /// T_h, where the horizon recedes.
    #[must_use]
    pub fn prediction_horizon(&self) -> Option<f64> {
        self.prediction.as_ref().map(Grid::horizon)
    }

    /// The game that is predicted at every instant, in one step; none where the horizon is the game's own.
    pub(crate) fn predicted(&self) -> Option<Self> {
        self.prediction.map(|grid| Self { grid, prediction: None, ..self.clone() })
    }

    /// The same game with every weight of players changed by at most `part` of itself, in a fixed pattern without symmetry.
    pub(crate) fn nudged(&self, part: f64) -> Self {
        let mut weights = self.weights.clone();
        let w = &mut weights;
        let lists = [&mut w.r_d, &mut w.q_da, &mut w.f_da, &mut w.q_ad, &mut w.f_ad].into_iter().flatten();
        let single = [&mut w.r_tau, &mut w.r_a, &mut w.q_atau, &mut w.f_atau, &mut w.q_taua, &mut w.f_taua].into_iter();
        for (index, x) in lists.chain(single).enumerate() {
            // The golden angle spreads it.
            *x *= 1.0 + part * (1.0 + 2.399_963_229_728_653 * index as f64).cos();
        }
        Self { weights, ..self.clone() }
    }

    /// I1 or I2.
    #[must_use]
    pub fn interaction(&self) -> Interaction {
        self.interaction
    }

    /// n, the number of defenders.
    #[must_use]
    pub fn n(&self) -> usize {
        self.weights.r_d.len()
    }

    /// N = n + 1, the size of every reduced matrix.
    #[must_use]
    pub fn size(&self) -> usize {
        self.n() + 1
    }

    /// m, the players with limited observations: n in I1, N in I2.
    #[must_use]
    pub fn constrained(&self) -> usize {
        match self.interaction {
            Interaction::I1 => self.n(),
            Interaction::I2 => self.size(),
        }
    }

    /// The weights.
    #[must_use]
    pub fn weights(&self) -> &Weights {
        &self.weights
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// r of the constrained players, r_{d_1}…r_{d_n} and, in I2, r_τ.
    #[must_use]
    pub fn constrained_control_weights(&self) -> Vec<f64> {
        let mut r = self.weights.r_d.clone();
        if self.interaction == Interaction::I2 {
            r.push(self.weights.r_tau);
        }
        r
    }

    /// Diagonals of Q_p (and, with `terminal`, of F_p), one per objective: [d, τ, a] in I1, one in I2.
    #[must_use]
    pub fn state_weights(&self, terminal: bool) -> Vec<Vec<f64>> {
        let w = &self.weights;
        let n = self.n();
        let (da, ad, atau, taua) =
            if terminal { (&w.f_da, &w.f_ad, w.f_atau, w.f_taua) } else { (&w.q_da, &w.q_ad, w.q_atau, w.q_taua) };
        let evasion = if self.interaction == Interaction::I1 { w.lambda } else { 1.0 };
        let mut attacker: Vec<f64> = ad.iter().map(|&v| -evasion * v).collect();
        attacker.push(atau);
        if self.interaction == Interaction::I2 {
            return vec![attacker];
        }
        let mut defenders = da.clone();
        defenders.push(0.0);
        let mut target = vec![0.0; n];
        target.push(-taua);
        vec![defenders, target, attacker]
    }
}

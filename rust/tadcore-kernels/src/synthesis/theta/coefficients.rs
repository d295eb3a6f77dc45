//! What Θ is made of, in the precision of a kernel.

use std::sync::OnceLock;

use crate::simd::Scalar;

/// N up to which the constant part of the Hessian is a matrix in memory; beyond, where its (mN)² numbers would be most of
/// what there is, its rows are put together as they are read, bitwise the same.
pub const TABULATED_UP_TO: usize = 8;

/// The numbers of one instant: F, M, W and R are those of the paper's problem at that instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficients<S> {
    /// N.
    pub size: usize,
    /// m.
    pub rows: usize,
    /// γ₁.
    pub first: S,
    /// 4γ₁r_i.
    pub strength: Vec<S>,
    pub r: Vec<S>,
    /// F.
    pub fne: Vec<S>,
    /// M.
    pub target: Vec<S>,
    /// W_p.
    pub coupling: Vec<Vec<S>>,
    /// Σ_p W_pᵀW_p, m × m.
    pub gram: Vec<S>,
    /// c_i.
    pub closeness: Vec<S>,
    /// The Hessian's constant part 4 Σ_p[(W_pᵀW_p)_ij **I** ± w_jᵀw_i] + 2δ_ij c_i **I** with + and with −, mN × mN;
    /// blocks on and below the diagonal. Empty past [`TABULATED_UP_TO`].
    pub quadratic: [Vec<S>; 2],
    pub scale: Scale,
}

/// Norms that say how large the cancelling parts of Θ and its gradient are.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    /// ‖F‖.
    pub fne: f64,
    /// ‖M‖.
    pub target: f64,
    /// Σ_p ‖W_p‖².
    pub coupling: f64,
    /// The largest c_i.
    pub closeness: f64,
    /// 4γ₁ and the largest r_i.
    pub quartic: f64,
    /// Size of the parts of Θ: what its rounding is relative to.
    pub value: f64,
}

/// One problem in both precisions.
#[derive(Debug, Clone, PartialEq)]
pub struct Precisions {
    pub double: Coefficients<f64>,
    /// In single precision, made when it is first asked for: who follows a minimum does not need it.
    single: OnceLock<Option<Coefficients<f32>>>,
}

impl From<Coefficients<f64>> for Precisions {
    fn from(double: Coefficients<f64>) -> Self {
        Self { double, single: OnceLock::new() }
    }
}

impl Precisions {
    /// A problem that is to be looked at in double precision alone.
    #[must_use]
    pub fn double_only(double: Coefficients<f64>) -> Self {
        Self { double, single: None.into() }
    }

    /// In single precision, where that can hold it.
    pub fn single(&self) -> Option<&Coefficients<f32>> {
        let double = &self.double;
        let make = || (double.size <= TABULATED_UP_TO && double.in_range()).then(|| double.rounded());
        self.single.get_or_init(make).as_ref()
    }
}

/// Sizes between which sums of squares and their roundings are numbers of single precision.
const RANGE: (f64, f64) = (1e-9, 1e12);

impl Coefficients<f64> {
    /// Whether Θ and gains of the size of F, their gradients and curvatures lie well within single precision.
    pub fn in_range(&self) -> bool {
        let within = |x: f64| RANGE.0 <= x && x <= RANGE.1;
        let (s, value) = (&self.scale, self.scale.value);
        within(value) && within(s.fne * s.fne) && within(value / (s.fne * s.fne))
    }

    /// Every number rounded.
    pub fn rounded(&self) -> Coefficients<f32> {
        let all = |numbers: &[f64]| numbers.iter().map(|&x| f32::of(x)).collect();
        Coefficients {
            size: self.size,
            rows: self.rows,
            first: f32::of(self.first),
            strength: all(&self.strength),
            r: all(&self.r),
            fne: all(&self.fne),
            target: all(&self.target),
            coupling: self.coupling.iter().map(|w| all(w)).collect(),
            gram: all(&self.gram),
            closeness: all(&self.closeness),
            quadratic: [all(&self.quadratic[0]), all(&self.quadratic[1])],
            scale: self.scale.clone(),
        }
    }
}

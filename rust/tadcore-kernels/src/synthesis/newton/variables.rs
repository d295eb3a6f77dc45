//! Variables: directions in the space of the gains.
//!
//! A variable is e_j in row i, or e_j − e_i where a row is to depend on differences only: such a row sums to zero.

/// One variable: the direction e_j, less e_i in a row that does not see the attacker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Variable {
    /// Position of (i, j) in the m × N gains.
    pub entry: usize,
    /// Position of (i, i), subtracted when `relative`.
    pub own: usize,
    /// Whether row i knows differences only.
    pub relative: bool,
}

/// Makes the rows that know differences only sum to zero again, which rounding in single precision does not.
pub fn balance(g: &mut [f64], variables: &[Variable]) {
    for row in variables.chunk_by(|a, b| a.own == b.own).filter(|row| row[0].relative) {
        g[row[0].own] = -row.iter().map(|v| g[v.entry]).sum::<f64>();
    }
}

/// Adds Σ x_v · direction_v to one network's gains.
pub fn advance(g: &mut [f64], variables: &[Variable], x: &[f64]) {
    for (v, &x) in variables.iter().zip(x) {
        g[v.entry] += x;
        if v.relative {
            g[v.own] -= x;
        }
    }
}

//! The certificate for the paper's gains in blocks: does it cover more than scalars times the identity?
//!
//! A block of dim × dim is a multiple of **I**, a symmetric part without trace and an antisymmetric one J. All of Θ but
//! ‖GᵀRG − M‖² is a sum of squares of linear expressions, and the three kinds do not mix in them. X + Xᵀ reads the same
//! for scalars and for symmetric blocks; the transpose of DJ is −Dᵀ J, so for antisymmetric ones it is X − Xᵀ. Of
//! the certificate's form there are then two versions, with blocks
//!
//! $$4\gamma_1\delta_{ij} r_i X + 4\sum_p\bigl[(W_p^\top W_p)_{ij} I \pm w_j^\top w_i\bigr] + 2\delta_{ij} c_i I,
//! \qquad X = G^\top R G - M,$$
//!
//! with the plus for scalars and symmetric blocks (`theta::real`), the minus for antisymmetric ones. Where both are positive semidefinite at a
//! critical point in scalars, no gains in blocks have a lower Θ. Without W the two are the same: in I2, and in I1 where
//! γ₂ = γ₃ = 0.

use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::memory::zeros;
use crate::synthesis::newton::Variable;
use crate::synthesis::theta::Problem;

/// How far below zero rounding may push the form where its parts are scaled to one, variable by variable.
const ROUNDING: f64 = 1e-12;
/// What asks for memory here.
const WHAT: &str = "the certificate in blocks";

/// Whether the form of antisymmetric blocks is positive semidefinite at the gains `g`.
pub(crate) fn covers_blocks(
    problem: &Problem,
    g: &[f64],
    variables: &[Variable],
    cancel: &CancelToken,
) -> Result<bool, Stopped> {
    let (n, of, count) = (problem.size, &problem.theta.double, variables.len());
    if of.coupling.is_empty() {
        return Ok(true);
    }
    let (mut x, mut sizes) = (zeros(WHAT, n * n)?, zeros(WHAT, n * n)?);
    for a in 0..n {
        cancel.check()?;
        for b in 0..n {
            let squares = (0..problem.rows).map(|i| of.r[i] * g[i * n + a] * g[i * n + b]);
            x[a * n + b] = squares.clone().sum::<f64>() - of.target[a * n + b];
            sizes[a * n + b] = squares.map(f64::abs).sum::<f64>() + of.target[a * n + b].abs();
        }
    }
    // The form, packed by rows, then its factor in the same place.
    let mut form = zeros(WHAT, count * (count + 1) / 2)?;
    let mut parts = zeros(WHAT, count)?;
    let (mut first, mut second) = (Vec::with_capacity(2), Vec::with_capacity(2));
    for (row, v) in variables.iter().enumerate() {
        cancel.check()?;
        entries(v, n, &mut first);
        for (column, w) in variables[..=row].iter().enumerate() {
            entries(w, n, &mut second);
            let (i, j) = (v.own / n, w.own / n);
            let mut total = 0.0;
            for &(a, s) in &first {
                for &(b, t) in &second {
                    let same = if a == b { 1.0 } else { 0.0 };
                    let coupled: f64 = of.coupling.iter().map(|p| p[i * n + b] * p[j * n + a]).sum();
                    total += s * t * 4.0 * (of.gram[i * problem.rows + j] * same - coupled);
                    if i == j {
                        total += s * t * (of.strength[i] * x[a * n + b] + 2.0 * of.closeness[i] * same);
                    }
                }
            }
            form[row * (row + 1) / 2 + column] = total;
        }
        let i = v.own / n;
        for &(a, _) in &first {
            parts[row] += 4.0 * of.gram[i * problem.rows + i] + 2.0 * of.closeness[i];
            for &(b, _) in &first {
                let coupled: f64 = of.coupling.iter().map(|p| (p[i * n + a] * p[i * n + b]).abs()).sum();
                parts[row] += of.strength[i] * sizes[a * n + b] + 4.0 * coupled;
            }
        }
    }
    definite(&mut form, &parts, cancel)
}

/// The entries of a variable's direction, in its row.
fn entries(v: &Variable, n: usize, out: &mut Vec<(usize, f64)>) {
    out.clear();
    out.push((v.entry % n, 1.0));
    if v.relative {
        out.push((v.own % n, -1.0));
    }
}

/// Whether Cholesky's factorisation of the scaled form with the allowance for rounding on its diagonal succeeds.
fn definite(form: &mut [f64], parts: &[f64], cancel: &CancelToken) -> Result<bool, Stopped> {
    let packed = |row: usize| row * (row + 1) / 2;
    let scale = |v: usize| if parts[v] > 0.0 { parts[v].sqrt().recip() } else { 1.0 };
    for row in 0..parts.len() {
        cancel.check()?;
        let (above, own) = form.split_at_mut(packed(row));
        for column in 0..=row {
            let other = if column < row { &above[packed(column)..packed(column + 1)] } else { &own[..column] };
            let known: f64 = own[..column].iter().zip(other).map(|(a, b)| a * b).sum();
            let left = own[column] * scale(row) * scale(column) - known;
            if column < row {
                own[column] = left / other[column];
            } else {
                let pivot = left + ROUNDING;
                if pivot <= 0.0 || pivot.is_nan() {
                    return Ok(false);
                }
                own[column] = pivot.sqrt();
            }
        }
    }
    Ok(true)
}

//! The canonical start and the variables: what a topology leaves free.
//!
//! Row i of the gains lies in the row space of 𝓘_i: entries on the players it sees and on itself; when it does not see
//! the attacker these sum to zero, because it then knows only differences z_j − z_i. A player that sees no one has no
//! variable at all. A variable is a direction e_j, or e_j − e_i in a row that does not see the attacker.
//!
//! The canonical start is the orthogonal projection of the FNE rows on these spaces: the minimiser of the ‖S‖² terms
//! alone. It depends on (t_k, topology) and on nothing else.

use crate::error::NoMemory;
use crate::game::Criterion;
use crate::memory::reserve;
use crate::network::Topology;
use crate::synthesis::newton::Variable;
use crate::synthesis::theta::Problem;

/// The variables of `topology`, row by row. Under [`Criterion::Component`] who knows everything has none: the canonical
/// start is the equilibrium's row there, and it stays.
pub(crate) fn variables(topology: &Topology, criterion: Criterion) -> Result<Vec<Variable>, NoMemory> {
    // At most all that are seen and, in each row, the player itself.
    let mut out = Vec::new();
    reserve("the unknowns of one network", &mut out, topology.edges() + topology.rows())?;
    let n = topology.size();
    for i in (0..topology.rows()).filter(|&i| is_free(topology, i, criterion)) {
        let own = i * n + i;
        let relative = !topology.sees_attacker(i);
        for j in (0..n).filter(|&j| j == i || topology.sees(i, j)) {
            if j != i || !relative {
                out.push(Variable { entry: i * n + j, own, relative });
            }
        }
    }
    Ok(out)
}

/// Whether the criterion leaves row i to be chosen.
fn is_free(topology: &Topology, i: usize, criterion: Criterion) -> bool {
    criterion == Criterion::Paper || !topology.sees_all(i)
}

/// The paper's own variables, the entries of K_i: e_j − e_i for each player seen, e_i when the attacker is seen.
pub(crate) fn paper_variables(topology: &Topology, criterion: Criterion) -> Vec<Variable> {
    let mut out = Vec::new();
    let n = topology.size();
    for i in (0..topology.rows()).filter(|&i| is_free(topology, i, criterion)) {
        for j in (0..n).filter(|&j| topology.sees(i, j)) {
            out.push(Variable { entry: i * n + j, own: i * n + i, relative: j != i });
        }
    }
    out
}

/// Writes the canonical start into `g` (m × N).
pub(crate) fn canonical(problem: &Problem, topology: &Topology, g: &mut [f64]) {
    let n = problem.size;
    for i in 0..problem.rows {
        let relative = !topology.sees_attacker(i);
        let used = |j: usize| j == i || topology.sees(i, j);
        let row = &problem.theta.double.fne[i * n..(i + 1) * n];
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

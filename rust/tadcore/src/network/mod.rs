//! The visibility network: which players each constrained player sees, and what that lets its feedback use.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | 𝒜 | [`Topology`] | augmented adjacency: row i, entry j ≠ i player j, entry i the attacker (eq:extadj) |
//! | ζ_i | `radius` of [`squared_reach`] | visibility radius |
//! | 𝓘_i | [`information_matrix`] | what player i observes of z (eq:infomatrix), reduced: without ⊗ **I** |
//! | h, D | [`EdgeRule`] | hysteresis and dwell time: a variant, not the paper's |
//!
//! Player i may use z_i when it sees the attacker, and z_j − z_i for each j that it sees: the row space of 𝓘_i.

mod edge_rule;
mod topology;
mod visibility;

pub use edge_rule::{EdgeRule, EdgeState};
pub use topology::Topology;
pub use visibility::{observe, squared_distance, squared_norm, squared_reach};

/// 𝓘_i of eq:infomatrix without its factor ⊗ **I**, N × N row-major:
/// diag(row i of 𝒜) · (**I** with −1 down column i off the diagonal).
#[must_use]
pub fn information_matrix(topology: &Topology, i: usize) -> Vec<f64> {
    let n = topology.size();
    let mut info = vec![0.0; n * n];
    for j in (0..n).filter(|&j| topology.sees(i, j)) {
        info[j * n + j] = 1.0;
        if j != i {
            info[j * n + i] = -1.0;
        }
    }
    info
}

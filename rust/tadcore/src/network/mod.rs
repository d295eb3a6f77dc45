//! The network: which players each constrained player sees, what fails, who is told, and what that lets its feedback use.
//!
//! 𝒜_k = relay(mask_k ∧ sight(z_k; ζ), links(z_k)): three parts, a file each. In the paper's game there is the sight alone.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | 𝒜 | [`Topology`] | augmented adjacency: row i, entry j ≠ i player j, entry i the attacker (eq:extadj) |
//! | sight, ζ_i | [`observe`], `radius` of [`squared_reach`] | who is near enough; visibility radius |
//! | mask | [`Failures`] | which sensors, edges and links are up |
//! | relay, L, H_i | [`Links`] | who hears whom, and who is told by it |
//! | 𝓘_i | [`information_matrix`] | what player i observes of z (eq:infomatrix), reduced: without ⊗ **I** |
//! | h, D | [`EdgeRule`] | hysteresis and dwell time: a variant, not the paper's |
//!
//! Player i may use z_i when it sees the attacker, and z_j − z_i for each j that it sees: the row space of 𝓘_i.

mod edge_rule;
mod mask;
mod relay;
#[cfg(test)]
mod relay_tests;
mod sight;
mod topology;

pub use edge_rule::{EdgeRule, EdgeState};
pub use mask::{Failures, Kind};
pub use relay::{Frame, Links};
pub use sight::{observe, squared_distance, squared_norm, squared_reach};
pub use topology::Topology;

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

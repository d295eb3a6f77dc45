//! Who sees whom: ‖z_i − z_j‖ ≤ ζ_i and ‖z_i‖ ≤ ζ_i for the attacker (eq:limob, closed balls).
//!
//! Distances are compared by their squares against the largest double whose rounded root does not exceed the radius, so
//! the answer is that of comparing the rounded distance itself, without a root in the loop.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | ζ_i | `radius` of [`squared_reach`] | visibility radius; [`squared_reach`] gives the square it is compared by |
//! | ‖z_i‖², ‖z_i − z_j‖² | [`squared_norm`], [`squared_distance`] | from player i to the attacker, to j |
//! | 𝒜 | [`observe`] | who sees whom |

use super::Topology;

/// The largest x with √x ≤ `radius` in double arithmetic: `d² <= squared_reach(ζ)` is exactly `d²`.sqrt() <= ζ. Of what
/// is no radius, negative or no number, −1: nothing is within it.
#[must_use]
pub fn squared_reach(radius: f64) -> f64 {
    if radius.is_nan() || radius < 0.0 {
        return -1.0;
    }
    let mut square = radius * radius;
    if !square.is_finite() {
        return if radius.is_infinite() { f64::INFINITY } else { f64::MAX };
    }
    while square.sqrt() > radius {
        square = square.next_down();
    }
    while square.next_up().sqrt() <= radius {
        square = square.next_up();
    }
    square
}

/// Squared distance between two points.
#[inline]
#[must_use]
pub fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

/// Squared length of a vector.
#[inline]
#[must_use]
pub fn squared_norm(a: &[f64]) -> f64 {
    a.iter().map(|x| x * x).sum()
}

/// Writes the network of the state `z` (N rows of `dim` axes) into `topology`; `reach` holds [`squared_reach`] of each
/// constrained player.
pub fn observe(z: &[f64], dim: usize, reach: &[f64], topology: &mut Topology) {
    topology.clear();
    let size = topology.size();
    for (i, &limit) in reach.iter().enumerate() {
        let zi = &z[i * dim..(i + 1) * dim];
        for j in 0..size {
            let d2 = if j == i { squared_norm(zi) } else { squared_distance(zi, &z[j * dim..(j + 1) * dim]) };
            if d2 <= limit {
                topology.set(i, j);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{observe, squared_reach};
    use crate::network::Topology;

    #[test]
    fn squared_reach_is_the_rounded_comparison() {
        for radius in [0.1, 3f64.sqrt(), 5.0, 2.25, 1e-160, 1e160, 0.3, f64::MIN_POSITIVE] {
            let reach = squared_reach(radius);
            assert!(reach.sqrt() <= radius && reach.next_up().sqrt() > radius || reach == f64::MAX, "{radius}");
        }
        assert_eq!(squared_reach(f64::INFINITY), f64::INFINITY);
        assert_eq!([-1e-300, -5.0, f64::NEG_INFINITY, f64::NAN].map(squared_reach), [-1.0; 4]);
        assert_eq!(squared_reach(0.0), 0.0);
    }

    /// Of two radii whose squares are the largest that root to them: a distance on the rim is seen, one double further
    /// it is not.
    #[test]
    fn a_ball_is_closed() {
        let z = [9.0, 12.0, 18.0, 24.0, -9.0, 36.0];
        let look = |radii: [f64; 2]| {
            let mut topology = Topology::complete(2, 3);
            observe(&z, 2, &radii.map(squared_reach), &mut topology);
            topology
        };
        assert_eq!([15.0, 30.0].map(squared_reach), [225.0, 900.0]);
        // z₁ to the attacker and to z₂ 15, to z₃ 30; z₂ to the attacker 30, to z₁ 15, to z₃ 3√97.
        let on = look([15.0, 30.0]);
        assert_eq!(on, Topology::from_fn(2, 3, |i, j| i == 1 || j < 2));
        let under = look([15.0_f64.next_down(), 30.0_f64.next_down()]);
        assert_eq!(under, Topology::from_fn(2, 3, |i, j| i == 1 && j != 1));
        assert!(look([30.0, 30.0]).is_complete());
    }
}

//! The paper's gradient descent on the gains K, as a second, independent method.
//!
//! The variables are the paper's K_{d_i} (and K_τ): the gain on z_j − z_i for each player seen and on z_i when the
//! attacker is seen, so the gradient is the printed one (eq:errgradient). Steps follow the negative gradient; their
//! length is Barzilai and Borwein's, safeguarded by a non-monotone Armijo search over the last [`MEMORY`] values. It
//! starts canonically, ends at a stationary point near its start, and does not restart.

use crate::cancel::CancelToken;
use crate::error::Stopped;
use crate::simd::norm;
use crate::synthesis::newton::{Layout, Limits, Objective, Reached, Variable};
use crate::synthesis::theta::{Problem, RealGains};

/// Values an Armijo test may look back at.
const MEMORY: usize = 10;
/// Halvings of one step.
const HALVINGS: usize = 60;

/// Descends from `g` along `variables`, leaving the end point in `g`.
pub(crate) fn descend(
    problem: &Problem,
    g: &mut [f64],
    variables: &[Variable],
    limits: Limits,
    cancel: &CancelToken,
) -> Result<Reached, Stopped> {
    let mut objective = RealGains::<f64, 0>::new(&problem.theta.double, Some(cancel))?;
    let mut layout = Layout::default();
    layout.begin(g.len(), 1);
    layout.place(0, variables);
    layout.list();
    let d = layout.len();
    let mut full = vec![0.0; objective.width()];
    let (mut gradient, mut next) = (vec![0.0; d], vec![0.0; d]);
    let mut value = objective.value(g);
    objective.gradient(g, &mut full);
    layout.restrict(&full, &mut gradient);
    let mut recent = [value; MEMORY];
    let mut length = 0.1 * norm(g) / norm(&gradient).max(f64::MIN_POSITIVE);
    let mut iterations = 0;
    loop {
        let (slope, scale) = (norm(&gradient), objective.gradient_scale(g));
        if slope <= limits.tolerance * scale || iterations == limits.iterations {
            break;
        }
        iterations += 1;
        let reference = recent.iter().fold(f64::NEG_INFINITY, |a: f64, &b| a.max(b));
        let mut taken = None;
        for _ in 0..HALVINGS {
            cancel.check()?;
            let step: Vec<f64> = gradient.iter().map(|x| -length * x).collect();
            let mut trial = g.to_vec();
            layout.advance(&mut trial, &step);
            let reached = objective.value(&trial);
            if reached <= reference - 1e-4 * length * slope * slope {
                taken = Some((trial, step, reached));
                break;
            }
            length *= 0.5;
        }
        let Some((trial, step, reached)) = taken else {
            value = objective.value(g);
            break;
        };
        g.copy_from_slice(&trial);
        value = reached;
        recent[iterations % MEMORY] = value;
        objective.gradient(g, &mut full);
        layout.restrict(&full, &mut next);
        let ss: f64 = step.iter().map(|s| s * s).sum();
        let sy: f64 = step.iter().zip(next.iter().zip(&gradient)).map(|(s, (n, o))| s * (n - o)).sum();
        length = if sy > 0.0 { ss / sy } else { 2.0 * length };
        std::mem::swap(&mut gradient, &mut next);
    }
    cancel.check()?;
    Ok(Reached::new(value, norm(&gradient), objective.gradient_scale(g), iterations, &limits))
}

//! Which rows may come within a radius in a step at all, many trials side by side: by their chords and one bound.

use super::motion::ROUNDING;

/// By how much, relative to the farthest row, any row may leave its chord over a step with ‖C‖δ = `size`.
pub(crate) fn clear(size: f64) -> f64 {
    0.125 * size * size * size.exp() * (1.0 + 1e-9) + ROUNDING
}

/// Of trials side by side, a bit for each in which some row may enter its radius: `start` and `end` hold row j on axis x
/// at j·dim + x, `capture` the squared radii, and `stretch` is [`clear`]'s. A bit too many costs time, none is missing.
pub(crate) fn near<const L: usize>(
    start: &[[f64; L]],
    end: &[[f64; L]],
    capture: &[[f64; L]],
    dim: usize,
    stretch: f64,
) -> u32 {
    let (mut farthest, mut near) = ([0.0_f64; L], [false; L]);
    for row in start.chunks_exact(dim) {
        for l in 0..L {
            farthest[l] = farthest[l].max(row.iter().map(|x| x[l] * x[l]).sum());
        }
    }
    let off = farthest.map(|square| stretch * square.sqrt());
    for ((p, q), reach) in start.chunks_exact(dim).zip(end.chunks_exact(dim)).zip(capture) {
        for l in 0..L {
            let (mut squared, mut along) = (0.0, 0.0);
            for (p, q) in p.iter().zip(q) {
                let d = p[l] - q[l];
                squared += d * d;
                along += p[l] * d;
            }
            let share = if squared > 0.0 { (along / squared).clamp(0.0, 1.0) } else { 0.0 };
            let nearest: f64 = p.iter().zip(q).map(|(p, q)| p[l] + share * (q[l] - p[l])).map(|x| x * x).sum();
            let limit = reach[l].sqrt() + off[l];
            // What is no number is looked at.
            let clear = nearest > limit * limit * (1.0 + 1e-9);
            near[l] |= !clear;
        }
    }
    near.iter().enumerate().fold(0, |bits, (l, &near)| bits | u32::from(near) << l)
}

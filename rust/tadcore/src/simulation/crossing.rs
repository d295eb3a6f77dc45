//! Within a step: when two players first come within a capture radius of one another, and how near they come.
//!
//! The motion is known, z(t_k + s) = exp(Cs) z(t_k), so nothing is sampled. The step is halved as often as needed; on a
//! part of length w with ends z(a) and z(b), row i leaves its chord by at most
//!
//! $$\tfrac{w^2}{8} \max_{\tau \le w} \lVert \ddot z_i(a + \tau) \rVert, \qquad
//!   \ddot z(a + \tau) = e^{C\tau} C^2 z(a).$$
//!
//! A part whose chord stays further away than that has no crossing. One that is a chord to rounding is a quadratic
//! equation. What lies between is halved again, the earlier half first: no crossing is missed, a tangency included.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | w = δ 2⁻ʲ | `Part`, its `level` j | a part of the step |
//! | w² max ‖z̈_i‖ / 8 | `Chord::off` | how far row i may leave its chord |
//! | C²z | [`Motion`]'s `turning` | z̈ where a part begins |
//! | σ² | `reach` | of the radius of row i |
//!
//! What is known of the motion on such parts is in [`super::motion`].

pub(crate) use super::near::{clear, near};

use super::motion::{LEVELS, Motion, ROUNDING, SHORT};
use crate::error::Stopped;
use crate::network::{squared_distance, squared_norm};

/// Parts of one step that are looked at for one row: enough for hundreds of turns in one step.
const PARTS: usize = 1 << 16;

/// A part of a step: from z(`from`) over δ 2^−`level`.
#[derive(Clone, Copy)]
struct Part<'z> {
    level: usize,
    /// Among those whose states are kept.
    number: usize,
    from: f64,
    start: &'z [f64],
    end: &'z [f64],
}

/// The chord of one row over a part.
struct Chord {
    /// The nearest point to the origin, as a share of the chord, and its distance.
    share: f64,
    nearest: f64,
    /// The same for the whole line through it.
    foot: f64,
    aside: f64,
    /// Its length, and by how much the motion may leave it.
    length: f64,
    off: f64,
    /// Whether it leaves it by rounding alone.
    straight: bool,
}

impl Motion<'_> {
    /// The first s in (0, δ] with ‖z_i(s)‖² ≤ `reach`, from a start outside; `start` and `end` are z(0) and z(δ).
    pub(crate) fn enters(&mut self, i: usize, reach: f64, start: &[f64], end: &[f64]) -> Result<Option<f64>, Stopped> {
        self.begin(start);
        let whole = Part { level: 0, number: 1, from: 0.0, start, end };
        self.followed(i, |motion| motion.first(i, reach, whole))
    }

    /// The s in [0, δ] at which ‖z_i(s)‖ is least, and that distance.
    pub(crate) fn closest(&mut self, i: usize, start: &[f64], end: &[f64]) -> Result<(f64, f64), Stopped> {
        let row = |z: &[f64]| squared_norm(&z[i * self.dim..(i + 1) * self.dim]).sqrt();
        let (before, after) = (row(start), row(end));
        let nearest_end = if after < before { (self.step, after) } else { (0.0, before) };
        self.begin(start);
        let whole = Part { level: 0, number: 1, from: 0.0, start, end };
        self.followed(i, |motion| {
            let mut best = nearest_end;
            motion.nearer(i, whole, &mut best)?;
            Ok(best)
        })
    }

    /// What is found of row i in so many parts; where another row that does not move this one explodes, its motion bounds
    /// nothing, and the parts are counted anew without it.
    fn followed<T>(&mut self, i: usize, find: impl Fn(&mut Self) -> Result<T, Stopped>) -> Result<T, Stopped> {
        let before = self.lost;
        self.left = PARTS;
        let mut found = find(self)?;
        if self.lost && !before {
            (self.lost, self.left, self.movers) = (false, PARTS, Some(self.movers_of(i)));
            found = find(self)?;
            self.movers = None;
        }
        Ok(found)
    }

    /// Whether the motion turned too often for some row to be followed.
    pub(crate) fn lost(&self) -> bool {
        self.lost
    }

    fn chord(&mut self, i: usize, part: Part) -> Result<Chord, Stopped> {
        let (dim, width) = (self.dim, self.width(part.level));
        let (p, q) = (&part.start[i * dim..(i + 1) * dim], &part.end[i * dim..(i + 1) * dim]);
        self.cancel.check()?;
        self.left = self.left.saturating_sub(1);
        let squared = squared_distance(p, q);
        let along: f64 = p.iter().zip(q).map(|(p, q)| p * (p - q)).sum();
        let foot = if squared > 0.0 { along / squared } else { 0.0 };
        let share = foot.clamp(0.0, 1.0);
        let at =
            |share: f64| -> f64 { length(&p.iter().zip(q).map(|(p, q)| p + share * (q - p)).collect::<Vec<f64>>()) };
        let turning = self.turning(part.number, part.start);
        let farthest = part.start.chunks_exact(dim).map(length).fold(0.0, f64::max);
        let counts = |j: usize| self.movers.as_ref().is_none_or(|movers| movers[j]);
        let rows = turning.chunks_exact(dim).enumerate().filter(|&(j, _)| counts(j));
        let most = rows.map(|(_, z)| length(z)).fold(0.0, f64::max);
        let size = self.norm * width;
        let bend = if size <= SHORT {
            length(&turning[i * dim..(i + 1) * dim]) + size.exp_m1() * most
        } else {
            // C² z is known to rounding only, which a stiff C makes large.
            self.level(part.level)?.growth * (most + ROUNDING * self.norm * self.norm * farthest)
        };
        let off = 0.125 * width * width * bend;
        let ends = length(p) + length(q);
        let mut straight = off <= ROUNDING * ends || part.level >= LEVELS;
        if self.left == 0 && !straight {
            (self.lost, straight) = (true, true);
        }
        let (nearest, aside) = (at(share), at(foot));
        Ok(Chord { share, nearest, foot, aside, length: squared.sqrt(), off: off + ROUNDING * ends, straight })
    }

    fn halves<'z>(&mut self, part: Part<'z>, middle: &'z mut Vec<f64>) -> Result<[Part<'z>; 2], Stopped> {
        let level = part.level + 1;
        *middle = self.middle(part.number, level, part.start)?;
        let from = part.from + self.width(level);
        let [earlier, number] = Self::numbers(part.number);
        let later = Part { level, number, from, start: middle, end: part.end };
        Ok([Part { level, number: earlier, end: middle, ..part }, later])
    }

    fn first(&mut self, i: usize, reach: f64, part: Part) -> Result<Option<f64>, Stopped> {
        let row = i * self.dim..(i + 1) * self.dim;
        if squared_norm(&part.start[row.clone()]) <= reach {
            return Ok(Some(part.from));
        }
        let (ends_inside, radius) = (squared_norm(&part.end[row]) <= reach, reach.sqrt());
        let chord = self.chord(i, part)?;
        if !ends_inside && chord.nearest > radius + chord.off {
            return Ok(None);
        }
        if chord.straight {
            if !ends_inside && chord.nearest > radius {
                return Ok(None);
            }
            let inside = ((radius - chord.aside) * (radius + chord.aside)).max(0.0);
            let share = if chord.length > 0.0 { chord.foot - inside.sqrt() / chord.length } else { 1.0 };
            return Ok(Some(part.from + share.clamp(0.0, 1.0) * self.width(part.level)));
        }
        let mut middle = Vec::new();
        let [earlier, later] = self.halves(part, &mut middle)?;
        let found = self.first(i, reach, earlier)?;
        if found.is_some() { Ok(found) } else { self.first(i, reach, later) }
    }

    fn nearer(&mut self, i: usize, part: Part, best: &mut (f64, f64)) -> Result<(), Stopped> {
        let chord = self.chord(i, part)?;
        if chord.nearest - chord.off >= best.1 && !chord.straight {
            return Ok(());
        }
        if chord.straight {
            if chord.nearest < best.1 {
                *best = (part.from + chord.share * self.width(part.level), chord.nearest);
            }
            return Ok(());
        }
        let mut middle = Vec::new();
        let parts = self.halves(part, &mut middle)?;
        let distance = squared_norm(&parts[1].start[i * self.dim..(i + 1) * self.dim]).sqrt();
        if distance < best.1 {
            *best = (parts[1].from, distance);
        }
        for part in parts {
            self.nearer(i, part, best)?;
        }
        Ok(())
    }
}

/// The length of a vector, also where its square is no double.
fn length(v: &[f64]) -> f64 {
    let most = v.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    if (1e-140..1e140).contains(&most) {
        return squared_norm(v).sqrt();
    }
    if most > 0.0 { most * v.iter().map(|x| (x / most) * (x / most)).sum::<f64>().sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cancel::CancelToken;

    /// Two rows that turn into one another: the first is on the ellipse (a cos ωs, −b sin ωs).
    fn ellipse(omega: f64, a: f64, b: f64, step: f64, test: impl Fn(&mut Motion, &[f64], &[f64])) {
        let (c, start) = ([0.0, -omega, omega, 0.0], [a, 0.0, 0.0, b]);
        let (sin, cos) = (omega * step).sin_cos();
        let end = [a * cos, -b * sin, a * sin, b * cos];
        test(&mut Motion::new(&c, 2, 2, step, &CancelToken::new()).expect("memory"), &start, &end);
    }

    #[test]
    fn an_ellipse_is_entered_where_its_equation_says() {
        let (a, b): (f64, f64) = (2.0, 0.01);
        for (omega, step) in [(1.0, 3.0), (0.1, 20.0), (900.0, 3.4e-3), (1.0, 30.0)] {
            for sigma in [1.9, 0.5, 0.011, b * (1.0 + 1e-9)] {
                let angle = ((sigma * sigma - b * b) / (a * a - b * b)).sqrt().acos();
                ellipse(omega, a, b, step, |motion, start, end| {
                    let found =
                        motion.enters(0, sigma * sigma, start, end).expect("memory").expect("a crossing") * omega;
                    // Near a tangency the angle is known to the root of a rounding.
                    let known = 1e-13 + 1e-15 / (angle.cos() * a);
                    assert!((found - angle).abs() < known, "ω = {omega}, σ = {sigma}: {found} and {angle}");
                });
            }
            ellipse(omega, a, b, step, |motion, start, end| {
                let (at, nearest) = motion.closest(0, start, end).expect("memory");
                // An ellipse comes as near once in each half turn.
                let quarter = (at * omega / std::f64::consts::PI - 0.5).rem_euclid(1.0);
                assert!((nearest - b).abs() < 1e-15 && quarter.min(1.0 - quarter) < 1e-6, "{at} {nearest} {quarter}");
            });
        }
    }

    #[test]
    fn a_tangency_is_met_and_a_near_miss_is_none() {
        for omega in [0.05, 1.0, 3.0] {
            for (sigma, met) in [(0.3 * (1.0 + 1e-13), true), (0.3 * (1.0 - 1e-13), false), (0.29, false)] {
                ellipse(omega, 2.0, 0.3, 3.0 / omega, |motion, start, end| {
                    assert_eq!(
                        motion.enters(0, sigma * sigma, start, end).expect("memory").is_some(),
                        met,
                        "ω = {omega}, σ = {sigma}"
                    );
                });
            }
        }
    }

    /// A row that goes round 10⁵ times in one step, a hair outside a radius: too often to be followed, and it says so.
    #[test]
    fn a_motion_that_turns_too_often_says_so() {
        for (turns, lost) in [(10.0, false), (1e5, true)] {
            let omega = 2.0 * std::f64::consts::PI * turns;
            ellipse(omega, 1.0, 1.0 - 1e-6, 1.0, |motion, start, end| {
                let sigma: f64 = 1.0 - 2e-6;
                let found = motion.enters(0, sigma * sigma, start, end).expect("memory");
                assert!(lost || found.is_none());
                assert_eq!(motion.lost(), lost, "{turns} turns");
            });
        }
    }

    /// A row that comes to rest beside one that explodes: what does not move it does not count.
    #[test]
    fn a_row_that_explodes_hides_none_that_it_does_not_move() {
        let (c, start, end) = ([-1.0, 0.0, 0.0, 260.0], [2.0, 1.0], [2.0 * (-1.0_f64).exp(), 260.0_f64.exp()]);
        let cancel = CancelToken::new();
        let mut motion = Motion::new(&c, 2, 1, 1.0, &cancel).expect("memory");
        let found = motion.enters(0, 1.0, &start, &end).expect("memory").expect("a crossing");
        assert!((found - std::f64::consts::LN_2).abs() < 1e-13 && !motion.lost(), "{found}");
        assert!(motion.enters(1, 0.25, &start, &end).expect("memory").is_none() && !motion.lost());
    }

    /// A stiff row that runs past the origin to where a row at rest draws it: x = 1 − 2 e^{−λs}, y = 0.005.
    #[test]
    fn a_stiff_motion_is_met_as_early_as_it_comes() {
        for rate in [1.0, 1e3, 1e6, 1e9] {
            let (c, start) = ([-rate, rate, 0.0, 0.0], [-1.0, 0.005, 1.0, 0.005]);
            let end = [1.0 - 2.0 * (-rate * 1.0_f64).exp(), 0.005, 1.0, 0.005];
            let none = CancelToken::new();
            let mut motion = Motion::new(&c, 2, 2, 1.0, &none).expect("memory");
            let sigma: f64 = 0.01;
            let x = -(sigma * sigma - 0.005 * 0.005).sqrt();
            let wanted = -((1.0 - x) / 2.0).ln() / rate;
            let found = motion.enters(0, sigma * sigma, &start, &end).expect("memory").expect("a crossing");
            assert!((found - wanted).abs() < 1e-12 * wanted, "λ = {rate}: {found} and {wanted}");
            let (at, nearest) = motion.closest(0, &start, &end).expect("memory");
            assert!((at * rate - std::f64::consts::LN_2).abs() < 1e-6, "λ = {rate}: {at}");
            assert!((nearest - 0.005).abs() < 1e-14);
            assert_eq!(motion.enters(0, 0.0049 * 0.0049, &start, &end), Ok(None));
        }
    }

    /// One motion from one start after another: what is kept of the first is not taken for the second.
    #[test]
    fn every_start_is_followed_by_itself() {
        let (c, none) = ([0.0, -1.0, 1.0, 0.0], CancelToken::new());
        let turned =
            |z: [f64; 2]| [z[0] * 2.5_f64.cos() - z[1] * 2.5_f64.sin(), z[0] * 2.5_f64.sin() + z[1] * 2.5_f64.cos()];
        let mut motion = Motion::new(&c, 2, 1, 2.5, &none).expect("memory");
        for start in [[1.0, 0.0], [1.0, 0.9]] {
            let alone = Motion::new(&c, 2, 1, 2.5, &none).expect("memory").enters(0, 0.01, &start, &turned(start));
            assert_eq!(motion.enters(0, 0.01, &start, &turned(start)), alone);
            assert!(matches!(alone, Ok(Some(_))));
        }
    }
}

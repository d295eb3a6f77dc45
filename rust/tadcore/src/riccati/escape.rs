//! P ≈ R / (s* − s): telling a solution that escapes at s* from one that merely grows, decays fast, or is stiff.
//!
//! Near a pole of a quadratic equation the relative growth ⟨P, Ṗ⟩ / ⟨P, P⟩ tends to 1 / (s* − s), so its inverse is the
//! distance left. Both solvers walk towards the pole with steps that shrink in proportion to that distance, and say
//! *escape* only once the distance is a 10⁻¹³th (I2) or a 10⁻¹⁵th (I1) of the way covered; the last distance is then
//! added. No other solution can look like this: an exponential growth keeps its distance, and for a stiff or quickly
//! decaying one to reach growth × s = 10¹³ would take more steps than the budgets allow. A solution can also pass close
//! to a pole in the complex plane and go on. In I1 it may do so again and again, ever closer, before it escapes in the
//! end (seen in one of some twenty random games); hence the sharper bound there.
//!
//! | symbol | name here | meaning |
//! |---|---|---|
//! | s | `s` | time before the horizon, T − t |
//! | s* | [`EquilibriumError::FiniteEscape`] | escape time: the supremum of the horizons that have an equilibrium |
//!
//! An escape within a 10⁻¹²th of T counts as an escape at T, hence as no equilibrium: rounding alone moves s* by about
//! as much, and no digit of P would be meant.
//!
//! Source: the theorems thm:fbne and thm:zero:sum:game (existence); the criterion is ours.

use crate::error::EquilibriumError;

/// Steps longer than this part of s are not near a pole.
pub(super) const GATE: f64 = 1e-6;
/// How near T, relative to it, an escape counts as at T.
const AT_HORIZON: f64 = 1e-12;

/// ⟨P, Ṗ⟩ / ⟨P, P⟩ with neither product able to overflow.
pub(super) fn growth(p: &[f64], dp: &[f64]) -> f64 {
    let largest = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let (a, b) = (largest(p), largest(dp));
    if !(a > 0.0 && b > 0.0) {
        return 0.0;
    }
    let (mut cross, mut square) = (0.0, 0.0);
    for (x, y) in p.iter().zip(dp) {
        cross += (x / a) * (y / b);
        square += (x / a) * (x / a);
    }
    cross / square * (b / a)
}

/// `Err` when a solution with relative growth `rate` at `s` escapes at or before the horizon. `resolved` is the distance
/// to the pole, relative to s, at which the walk towards it ends.
pub(super) fn check(s: f64, rate: f64, horizon: f64, resolved: f64) -> Result<(), EquilibriumError> {
    if rate * s * resolved >= 1.0 || (s >= horizon && rate * s * AT_HORIZON >= 1.0) {
        let escape_time = s + rate.recip();
        if escape_time <= horizon * (1.0 + AT_HORIZON) {
            return Err(EquilibriumError::FiniteEscape { escape_time: escape_time.min(horizon), horizon });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// P = R / (s* − s) has the growth 1 / (s* − s) whatever R is, and its escape time is s*.
    #[test]
    fn a_pole_is_named_from_before_it() {
        let (pole, r) = (2.0_f64, [3.0, -1.0, -1.0, 1e-3]);
        for left in [0.05, 1e-3, 1e-7] {
            let s = pole - left;
            let (p, dp) = (r.map(|r| r / left), r.map(|r| r / left / left));
            let rate = growth(&p, &dp);
            assert!((rate * left - 1.0).abs() < 1e-14);
            let found = check(s, rate, 3.0, 0.5);
            assert!(
                matches!(found, Err(EquilibriumError::FiniteEscape { escape_time, horizon })
                    if (escape_time - pole).abs() < 1e-14 && horizon == 3.0),
                "{left}: {found:?}"
            );
            // One that lies behind the horizon is none.
            assert_eq!(check(s, rate, pole - 0.5 * left, 0.5), Ok(()));
        }
        assert_eq!(growth(&[0.0; 4], &[1.0; 4]), 0.0);
    }

    /// Too far from the pole nothing is said; at the horizon itself a 10⁻¹²th is near enough.
    #[test]
    fn only_the_horizon_itself_is_judged_more_roughly() {
        let rate = 2e12;
        assert_eq!(check(1.0, rate, 3.0, 1e-15), Ok(()));
        assert_eq!(check(1.0, 0.1 * rate, 1.0, 1e-15), Ok(()));
        assert!(matches!(check(1.0, rate, 1.0, 1e-15), Err(EquilibriumError::FiniteEscape { .. })));
        assert_eq!(check(1.0, -rate, 1.0, 1e-15), Ok(()));
    }
}

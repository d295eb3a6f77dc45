//! Something that is up or down: a Markov chain in continuous time with two states, looked at on the grid.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | U, D | `mean_up`, `mean_down` | mean time up and down, infinite for good |
//! | a = 1/U, b = 1/D | `fails`, `returns` | rates |
//! | p = a/(a+b) · (1 − e^{−(a+b)δ}) | `leaves` of up | probability to be down one step later |
//! | H = 1 + ⌊ln u / ln(1 − p)⌋ | [`Walk`] | steps up to the next flip: geometric |
//!
//! On the grid the chain is exactly the one in continuous time, so halving δ changes its law nowhere. A chain takes one
//! number per flip, not per step, and a rate that falls moves every flip out, with the same numbers.

/// The step of what does not happen.
pub const NEVER: i32 = i32::MAX;

/// How a chain begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Begin {
    /// Up.
    #[default]
    Up,
    /// By the law that does not change in time.
    Stationary,
}

/// The law of a chain on a grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chain {
    /// ln(1 − p) of leaving down and up; 0 where a state is never left.
    stays: [f64; 2],
    /// The probability to begin up.
    share: f64,
}

impl Chain {
    /// The chain with these mean times, positive or infinite, on a grid of step δ.
    #[must_use]
    pub fn new(mean_up: f64, mean_down: f64, begin: Begin, step: f64) -> Self {
        let (fails, returns) = (1.0 / mean_up, 1.0 / mean_down);
        let both = fails + returns;
        // e^{−(a+b)δ} − 1.
        let within = libm::expm1(-both * step);
        let stays = |leaves: f64| if leaves == 0.0 { 0.0 } else { libm::log1p(leaves / both * within) };
        let share = if begin == Begin::Up || fails == 0.0 { 1.0 } else { returns / both };
        Self { stays: [stays(returns), stays(fails)], share }
    }

    /// Whether it is up at every step, and takes no number.
    #[must_use]
    pub fn is_always_up(&self) -> bool {
        self.share == 1.0 && self.stays[1] == 0.0
    }

    /// ln(1 − p) of leaving a state; 0 where it is never left.
    pub(crate) fn stays(&self, up: bool) -> f64 {
        self.stays[usize::from(up)]
    }

    /// Whether it begins up, by a uniform number that is drawn where it matters.
    pub(crate) fn begins_up(&self, uniform: impl FnOnce() -> f64) -> bool {
        self.share == 1.0 || uniform() < self.share
    }

    /// Steps from one flip to the next by a uniform number.
    fn holds(&self, up: bool, u: f64) -> Option<i32> {
        let stays = self.stays[usize::from(up)];
        if stays == 0.0 {
            return None;
        }
        let steps = (libm::log(u) / stays).floor() + 1.0;
        (steps < f64::from(NEVER)).then_some(steps as i32)
    }
}

/// A chain in one trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Walk {
    /// The step of the next flip, or [`NEVER`].
    next: i32,
    /// Twice the number of flips, and 1 where it is up.
    state: u32,
}

impl Walk {
    /// A chain at step 0; `uniform` gives the number of an index: 0 for the beginning, f for the f-th flip.
    pub fn new(chain: &Chain, uniform: impl Fn(u32) -> f64) -> Self {
        let up = chain.begins_up(|| uniform(0));
        let mut walk = Self { next: 0, state: u32::from(up) };
        walk.draw(chain, uniform);
        walk
    }

    /// Whether it is up.
    #[must_use]
    pub fn is_up(&self) -> bool {
        self.state & 1 == 1
    }

    /// The step of the next flip, or [`NEVER`].
    #[must_use]
    pub fn next(&self) -> i32 {
        self.next
    }

    /// Flips it as often as it flips up to step k.
    pub fn advance(&mut self, chain: &Chain, k: i32, uniform: impl Fn(u32) -> f64) {
        while self.next <= k && self.next != NEVER {
            self.state = (self.state + 2) ^ 1;
            self.draw(chain, &uniform);
        }
    }

    /// Draws when the next flip is.
    fn draw(&mut self, chain: &Chain, uniform: impl Fn(u32) -> f64) {
        let up = self.is_up();
        let steps =
            if chain.stays[usize::from(up)] == 0.0 { None } else { chain.holds(up, uniform(self.state / 2 + 1)) };
        self.next = steps.map_or(NEVER, |steps| self.next.saturating_add(steps));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Draws, Purpose};

    fn walk(chain: &Chain, trial: u64) -> (Walk, impl Fn(u32) -> f64) {
        let uniform = move |index| Draws { seed: 3, trial }.uniforms(Purpose::Sensor, 0, index)[0];
        (Walk::new(chain, uniform), uniform)
    }

    /// Whether a count of successes among `trials` is within six standard deviations of its expectation.
    fn plausible(found: usize, probability: f64, trials: usize) -> bool {
        let (mean, spread) = (probability * trials as f64, (probability * (1.0 - probability) * trials as f64).sqrt());
        (found as f64 - mean).abs() <= 6.0 * spread
    }

    /// The state at a time has the law of the chain in continuous time, whatever the step: begun up, P(up) =
    /// π + (1 − π) e^{−(a+b)t} with π = b/(a+b); begun by its stationary law, π throughout.
    #[test]
    fn the_law_is_that_of_continuous_time() {
        let trials = 40_000;
        for (up, down) in [(1.0, 0.25), (0.3, 3.0), (0.02, 0.01)] {
            let (a, b) = (1.0 / up, 1.0 / down);
            let share = b / (a + b);
            for (begin, step) in [(Begin::Up, 0.1), (Begin::Up, 0.05), (Begin::Stationary, 0.1)] {
                let chain = Chain::new(up, down, begin, step);
                for time in [0.0, 0.1, 0.5, 2.0] {
                    let k = f64::round(time / step) as i32;
                    let found = (0..trials).filter(|&trial| {
                        let (mut walk, uniform) = walk(&chain, trial);
                        walk.advance(&chain, k, uniform);
                        walk.is_up()
                    });
                    let begun =
                        if begin == Begin::Up { share + (1.0 - share) * f64::exp(-(a + b) * time) } else { share };
                    assert!(plausible(found.count(), begun, trials as usize), "{up} {down} {begin:?} {step} {time}");
                }
            }
        }
    }

    /// Holding times are geometric, and two in a row independent.
    #[test]
    fn holding_times_are_geometric() {
        let chain = Chain::new(0.5, 0.2, Begin::Up, 0.1);
        let p = 2.0 / 7.0 * (1.0 - f64::exp(-0.7));
        let back = 5.0 / 7.0 * (1.0 - f64::exp(-0.7));
        let trials = 50_000;
        let (mut first, mut second, mut both) = ([0; 12], [0; 12], 0);
        for trial in 0..trials {
            let (mut walk, uniform) = walk(&chain, trial);
            let up = walk.next();
            walk.advance(&chain, up, &uniform);
            let down = walk.next() - up;
            first[(up as usize).min(12) - 1] += 1;
            second[(down as usize).min(12) - 1] += 1;
            both += usize::from(up == 1 && down == 1);
        }
        for h in 0..11 {
            let of = |p: f64| p * (1.0 - p).powi(h as i32);
            assert!(
                plausible(first[h], of(p), trials as usize) && plausible(second[h], of(back), trials as usize),
                "{h}"
            );
        }
        assert!(plausible(both, p * back, trials as usize));
    }

    /// The same numbers under a lower rate: no flip comes earlier.
    #[test]
    fn rarer_failures_come_later() {
        let chains = [0.1, 0.2, 1.0, 5.0, 1e3, f64::INFINITY].map(|up| Chain::new(up, f64::INFINITY, Begin::Up, 0.01));
        for trial in 0..2_000 {
            let flips = chains.map(|chain| walk(&chain, trial).0.next());
            assert!(flips.is_sorted(), "{flips:?}");
            assert_eq!(flips[5], NEVER);
        }
    }

    #[test]
    fn what_never_fails_takes_no_number() {
        let none = |_| -> f64 { unreachable!("a number is drawn") };
        for (up, down, begin) in [
            (f64::INFINITY, f64::INFINITY, Begin::Up),
            (f64::INFINITY, 0.1, Begin::Up),
            (f64::INFINITY, 0.1, Begin::Stationary),
            (f64::INFINITY, f64::INFINITY, Begin::Stationary),
        ] {
            let chain = Chain::new(up, down, begin, 0.01);
            assert!(chain.is_always_up());
            let mut walk = Walk::new(&chain, none);
            walk.advance(&chain, NEVER - 1, none);
            assert!(walk.is_up() && walk.next() == NEVER);
        }
        // Rates at the ends of the doubles: at every step, or for good from the first.
        let restless = Chain::new(1e-100, 1e-100, Begin::Up, 0.01);
        assert!(!restless.is_always_up() && walk(&restless, 1).0.next() >= 1);
        let gone = Chain::new(1e-100, f64::INFINITY, Begin::Up, 0.01);
        let (mut walk, uniform) = walk(&gone, 1);
        assert_eq!(walk.next(), 1);
        walk.advance(&gone, 1, uniform);
        assert!(!walk.is_up() && walk.next() == NEVER);
        assert!(!Walk::new(&Chain::new(1.0, f64::INFINITY, Begin::Stationary, 0.01), |_| 1e-16).is_up());
    }
}

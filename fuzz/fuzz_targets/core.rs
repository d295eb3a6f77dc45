//! Any bytes as a game and a start: the core answers with finite numbers or with an error, never with a panic.

#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use tadcore::cancel::CancelToken;
use tadcore::cost::costs;
use tadcore::ensemble::{self, Batch, Between, End};
use tadcore::error::{EquilibriumError, RunError};
use tadcore::game::{Game, Grid, Interaction, Weights};
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::simulation::{Outcome, Rules, Setup, Termination, simulate, simulate_with};

/// What the bytes say; nothing of it is checked before the core sees it.
#[derive(Debug, Arbitrary)]
struct Input {
    first: bool,
    defenders: u8,
    axes: u8,
    steps: u8,
    step: Number,
    weights: [Number; 24],
    lambda: Number,
    gamma: [Number; 4],
    places: [Number; 24],
    sight: [Number; 6],
    reach: [Number; 6],
}

/// Mostly a number of ordinary size, so that the fuzzer gets past the checks; one of any decade; or any double at all,
/// infinities, subnormals and NaN among them.
#[derive(Debug, Arbitrary, Clone, Copy)]
struct Number {
    kind: u8,
    small: i16,
    power: i8,
    any: f64,
}

impl Number {
    fn signed(self) -> f64 {
        let small = f64::from(self.small) / 8192.0;
        match self.kind {
            0 => self.any,
            1..6 => small * 10f64.powi(i32::from(self.power) % 32),
            _ => small,
        }
    }

    /// Without its sign; what is no number stays none.
    fn positive(self) -> f64 {
        self.signed().abs()
    }
}

fuzz_target!(|input: Input| {
    // Mostly small; also teams whose matrices of all pairs of gains would be larger than memory.
    let n = if input.defenders < 250 { 1 + usize::from(input.defenders % 5) } else { usize::from(input.axes) };
    let n = n.max(1);
    let dim = 1 + usize::from(input.axes % 3);
    let steps = if n <= 5 { 1 + usize::from(input.steps % 120) } else { 1 };
    let interaction = if input.first { Interaction::I1 } else { Interaction::I2 };
    let part = |i: usize| -> Vec<f64> { (0..n).map(|k| input.weights[(5 * i + k) % 24].positive()).collect() };
    let own = |i: usize| if input.first { part(i) } else { Vec::new() };
    let single = |i: usize| input.weights[(7 * i + 3) % 24].positive();
    let weights = Weights {
        r_d: part(0),
        q_da: own(1),
        f_da: own(2),
        q_ad: part(3),
        f_ad: part(4),
        r_tau: single(0),
        r_a: single(1),
        q_atau: single(2),
        f_atau: single(3),
        q_taua: single(4),
        f_taua: single(5),
        lambda: input.lambda.positive() / 4.0,
        gamma: input.gamma[..interaction.terms()].iter().map(|g| g.positive() / 4.0).collect(),
    };
    let step = input.step.positive() / 40.0;
    let Ok(game) = Grid::new(step * steps as f64, step).and_then(|grid| Game::new(interaction, weights, grid)) else {
        return;
    };
    let cancel = CancelToken::new();
    if n > 5 {
        // Hundreds of unknowns may take hours: they are to stop when asked.
        let late = cancel.clone();
        std::thread::spawn(move || {
            std::thread::sleep(std::time::Duration::from_secs(1));
            late.cancel();
        });
    }
    let policy = match Policy::new(game, DEFAULT_TABLE_BYTES, &cancel) {
        Ok(policy) => policy,
        Err(EquilibriumError::StepBudget { reached, horizon, .. }) => {
            return assert!(reached < horizon, "all of the way was covered, and no equilibrium is given");
        }
        Err(_) => return,
    };
    assert!(policy.equilibrium().as_slice().iter().all(|p| p.is_finite()), "P is not finite");
    let (m, last) = (policy.game().constrained(), policy.game().grid().steps());
    let positions: Vec<f64> = (0..(n + 2) * dim).map(|e| input.places[e % 24].signed()).collect();
    let visibility: Vec<f64> = (0..m).map(|i| input.sight[i % 6].positive()).collect();
    let capture: Vec<f64> = (0..=n).map(|i| input.reach[i % 6].positive()).collect();
    let setup = Setup { dim, positions: &positions, visibility: &visibility, capture: &capture };
    let alone = simulate(&policy, &setup, &cancel);
    let batch = Batch { dim, positions: &positions, visibility: &visibility, capture: &capture };
    let ends = ensemble::run(&policy, &batch, Some(1), &cancel);
    if cancel.is_cancelled() {
        return;
    }
    let Ok(record) = alone else {
        // What refuses a run refuses a batch; a run refuses more, since it records what a batch never forms.
        return;
    };
    for values in [&record.positions, &record.controls, &record.gains, &record.theta] {
        assert!(values.iter().all(|x| x.is_finite()), "a number of the run is not finite");
    }
    assert!(record.theta.iter().all(|&theta| theta >= 0.0), "Θ is negative");
    match costs(&policy, &record, &cancel) {
        Ok(costs) => assert!(costs.iter().all(|j| j.is_finite()), "a cost is not finite"),
        Err(error) => assert!(matches!(error, RunError::Cost { .. } | RunError::Cancelled(_)), "{error}"),
    }
    assert!(record.steps <= record.end && record.end <= last, "the run is longer than the game");
    if let Outcome::Intercepted(i) = record.outcome {
        assert!(i < n, "there is no such defender");
    }
    assert_eq!(ends.as_deref(), Ok(&[End::from(&record)][..]), "the batch ends otherwise");
    let numbers = record.passes.iter().flat_map(|pass| [pass.enters, pass.closest, pass.distance]);
    assert!(numbers.into_iter().all(|x| x.is_finite() && x >= 0.0), "a pass is not finite");
    for termination in [Termination::Sampled, Termination::Continuous] {
        let rules = Rules { termination, ..Rules::default() };
        let one = simulate_with(&policy, &setup, rules, &cancel).expect("a run");
        let ends = ensemble::run_with(&policy, &batch, Between { termination, passes: true }, None, Some(1), &cancel);
        let end = End { passed: !one.passes.is_empty(), ..End::from(&one) };
        assert_eq!(ends.as_deref(), Ok(&[end][..]), "the batch passes or ends otherwise");
        // Without a pass the two ends are one, but for the time.
        assert!(!record.passes.is_empty() || one.outcome == record.outcome, "another end without a pass");
    }
});

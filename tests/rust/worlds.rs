//! Worlds that fail, talk and shake: a batch against its recorded runs, what a world must not change, and what it refuses.

use tadcore::cancel::CancelToken;
use tadcore::ensemble::{self, Batch, Between, End};
use tadcore::error::{GameError, RunError};
use tadcore::game::{Interaction, bank};
use tadcore::network::{Frame, Topology};
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::random::{Begin, TRIALS};
use tadcore::simulation::{
    Chances, Communication, Outside, Record, Rules, Setup, Termination, World, simulate, simulate_with,
};

/// Numbers in [0, 1), one after another (SplitMix64).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[(self.next() * choices.len() as f64) as usize]
    }
}

/// The world in which nothing happens.
fn quiet(m: usize, players: usize) -> World {
    let never = || vec![f64::INFINITY; m];
    World {
        mean_time_to_failure: never(),
        mean_time_to_repair: never(),
        mean_time_detected: never(),
        mean_time_missed: never(),
        begin: vec![Begin::Up; m],
        communication: None,
        disturbance: vec![0.0; players],
    }
}

/// Links without bounds.
fn all_links(m: usize) -> Communication {
    Communication {
        radius: vec![Some(f64::INFINITY); m],
        relays: None,
        frame: Frame::Relative,
        mean_time_up: vec![f64::INFINITY; m],
        mean_time_down: vec![f64::INFINITY; m],
        begin: Begin::Up,
    }
}

/// Any world: each part is there in some.
fn any_world(draws: &mut Draws, m: usize, players: usize) -> World {
    let mut world = quiet(m, players);
    let times = |draws: &mut Draws, most: f64| -> Vec<f64> {
        (0..m).map(|_| if draws.next() < 0.3 { f64::INFINITY } else { draws.between(0.02, most) }).collect()
    };
    if draws.next() < 0.5 {
        (world.mean_time_to_failure, world.mean_time_to_repair) = (times(draws, 2.0), times(draws, 0.5));
    }
    if draws.next() < 0.5 {
        (world.mean_time_detected, world.mean_time_missed) = (times(draws, 1.0), times(draws, 0.2));
    }
    let communication = Communication {
        radius: (0..m).map(|_| draws.one_of(&[None, Some(f64::INFINITY), Some(1.0), Some(2.5)])).collect(),
        relays: draws.one_of(&[None, Some(0), Some(1), Some(i64::MAX)]),
        frame: draws.one_of(&[Frame::Relative, Frame::Common]),
        mean_time_up: times(draws, 1.0),
        mean_time_down: times(draws, 0.3),
        begin: draws.one_of(&[Begin::Up, Begin::Stationary]),
    };
    world.communication = (m > 1 && draws.next() < 0.6).then_some(communication);
    for i in 0..m {
        world.begin[i] = draws.one_of(&[Begin::Up, Begin::Stationary]);
    }
    if draws.next() < 0.5 {
        (0..players).for_each(|p| world.disturbance[p] = draws.one_of(&[0.0, 0.1, 0.5]));
    }
    world
}

struct Case {
    policy: Policy,
    dim: usize,
    trials: usize,
    positions: Vec<f64>,
    visibility: Vec<f64>,
    capture: Vec<f64>,
}

impl Case {
    fn new(interaction: Interaction, n: usize, dim: usize, trials: usize) -> Self {
        let horizon = if interaction == Interaction::I2 && n > 3 { 0.1 } else { 1.0 };
        let mut draws = Draws(31 * n as u64 + dim as u64);
        let r_d = (0..n).map(|i| 0.8 + 0.3 * (i % 3) as f64).collect();
        let game = bank::unit_game(interaction, r_d, 1.2, 0.8, 1.0, horizon, 0.02).expect("a valid game");
        let m = game.constrained();
        Self {
            policy: Policy::new(game, DEFAULT_TABLE_BYTES, &CancelToken::new()).expect("an equilibrium"),
            dim,
            trials,
            positions: (0..trials * (n + 2) * dim).map(|_| draws.between(-2.0, 2.0)).collect(),
            visibility: (0..m).map(|_| draws.between(0.6, 3.0)).collect(),
            capture: (0..=n).map(|_| draws.between(0.05, 0.3)).collect(),
        }
    }

    fn m(&self) -> usize {
        self.policy.game().constrained()
    }

    fn players(&self) -> usize {
        self.policy.game().n() + 2
    }

    fn setup(&self, i: usize) -> Setup<'_> {
        let width = self.players() * self.dim;
        let positions = &self.positions[i * width..(i + 1) * width];
        Setup { dim: self.dim, positions, visibility: &self.visibility, capture: &self.capture }
    }

    fn run(&self, i: usize, chances: Option<Chances>, termination: Termination) -> Record {
        let rules = Rules { chances, termination, ..Rules::default() };
        simulate_with(&self.policy, &self.setup(i), rules, &CancelToken::new()).expect("a run")
    }

    fn batch(&self, chances: Option<Chances>, between: Between, threads: usize) -> Vec<End> {
        let batch =
            Batch { dim: self.dim, positions: &self.positions, visibility: &self.visibility, capture: &self.capture };
        ensemble::run_with(&self.policy, &batch, between, chances, Some(threads), &CancelToken::new()).expect("a batch")
    }
}

/// Every trial of every kind of world ends as its recorded run does, for any number of threads.
#[test]
fn a_trial_of_a_world_ends_as_it_would_alone() {
    let (mut draws, mut compared, mut relayed, mut failed) = (Draws(7), 0, 0, 0);
    let mut outcomes = std::collections::HashSet::new();
    for interaction in [Interaction::I1, Interaction::I2] {
        for (n, trials, worlds) in [(1, 37, 6), (2, 37, 8), (3, 37, 10), (5, 13, 6), (9, 3, 4)] {
            for dim in [2, 3] {
                let case = Case::new(interaction, n, dim, trials);
                for w in 0..worlds {
                    let world = any_world(&mut draws, case.m(), case.players());
                    let seed = [0, 7, u64::MAX][w % 3];
                    let first = [0, (1 << 32) - 5, TRIALS - trials as u64][w / 3 % 3];
                    let chances = Chances { world: &world, seed, trial: first };
                    let continuous = w % 4 == 3 && world.disturbance.iter().all(|&sigma| sigma == 0.0);
                    let termination = if continuous { Termination::Continuous } else { Termination::Sampled };
                    let ends = case.batch(Some(chances), Between { termination, passes: false }, 1 + w % 2);
                    for (i, end) in ends.into_iter().enumerate() {
                        let one = Chances { trial: first + i as u64, ..chances };
                        let record = case.run(i, Some(one), termination);
                        assert_eq!(end, End::from(&record), "{interaction:?} {n} {dim} {w} {i} {world:?}");
                        let course = record.course.as_ref().expect("a course");
                        relayed +=
                            usize::from(course.seen.iter().zip(&record.networks).any(|(seen, used)| seen != used));
                        failed += usize::from(
                            course.states.iter().any(|s| !(s.sensors.is_complete() && s.edges.is_complete())),
                        );
                        outcomes.insert((end.outcome.code(), interaction == Interaction::I1));
                        compared += 1;
                    }
                }
            }
        }
    }
    assert!(
        compared > 2000 && relayed > 200 && failed > 500 && outcomes.len() == 6,
        "{compared} {relayed} {failed} {outcomes:?}"
    );
}

/// Bitwise the paper's game where nothing can happen, in runs and batches.
#[test]
fn a_quiet_world_is_none() {
    for (interaction, n) in [(Interaction::I1, 3), (Interaction::I2, 2), (Interaction::I1, 9)] {
        let case = Case::new(interaction, n, 2, if n > 8 { 3 } else { 40 });
        let world = quiet(case.m(), case.players());
        let chances = Some(Chances { world: &world, seed: 5, trial: 0 });
        for termination in [Termination::Sampled, Termination::Continuous] {
            let between = Between { termination, passes: true };
            assert_eq!(case.batch(chances, between, 1), case.batch(None, between, 1));
            for i in 0..case.trials {
                let mut record = case.run(i, chances, termination);
                let course = record.course.take().expect("a course");
                assert_eq!(course.seen, record.networks);
                assert!(course.displacement.iter().all(|&x| x == 0.0));
                assert_eq!(record, case.run(i, None, termination));
            }
        }
    }
}

/// Whether the players and the attacker are one component under what all see together.
fn joint(seen: &Topology) -> bool {
    let n = seen.size();
    let mut found = vec![false; n + 1];
    found[n] = true;
    for _ in 0..=n {
        for (i, j) in (0..seen.rows()).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let other = if j == i { n } else { j };
            if seen.sees(i, j) && (found[i] || found[other]) {
                (found[i], found[other]) = (true, true);
            }
        }
    }
    found.into_iter().all(|is| is)
}

/// A team that hears one another everywhere, and together sees the attacker and everyone, plays as if each saw all.
#[test]
fn complete_links_are_full_sight() {
    let mut compared = 0;
    for (interaction, n) in [(Interaction::I1, 2), (Interaction::I1, 3), (Interaction::I2, 2)] {
        let case = Case::new(interaction, n, 2, 300);
        let mut world = quiet(case.m(), case.players());
        for frame in [Frame::Relative, Frame::Common] {
            world.communication = Some(Communication { frame, ..all_links(case.m()) });
            let chances = Chances { world: &world, seed: 0, trial: 0 };
            for i in 0..case.trials {
                let record = case.run(i, Some(chances), Termination::Sampled);
                let course = record.course.as_ref().expect("a course");
                if !course.seen.iter().all(joint) {
                    continue;
                }
                let everywhere = vec![f64::INFINITY; case.m()];
                let full = Setup { visibility: &everywhere, ..case.setup(i) };
                let full = simulate(&case.policy, &full, &CancelToken::new()).expect("a run");
                assert_eq!(Record { course: None, ..record }, full);
                compared += 1;
            }
        }
    }
    assert!(compared > 100, "{compared}");
}

/// A sensor that is down from the beginning and for good is a radius that nobody comes near.
#[test]
fn a_failure_for_good_is_a_player_without_sight() {
    let mut case = Case::new(Interaction::I1, 3, 2, 60);
    case.capture = vec![1e-3; 4];
    let mut world = quiet(3, 5);
    (world.mean_time_to_failure[1], world.begin[1]) = (1.0, Begin::Stationary);
    for i in 0..case.trials {
        let failed = case.run(i, Some(Chances { world: &world, seed: 1, trial: i as u64 }), Termination::Sampled);
        let mut blind = case.visibility.clone();
        blind[1] = 2e-3;
        let blind =
            simulate(&case.policy, &Setup { visibility: &blind, ..case.setup(i) }, &CancelToken::new()).expect("a run");
        assert!(blind.networks.iter().all(|network| network.row(1) == 0), "{i}");
        assert_eq!(Record { course: None, ..failed }, blind, "{i}");
    }
}

/// Runs of one seed and trial share what happens, whatever their radii: failures, links and disturbances.
#[test]
fn radii_and_rates_share_their_draws() {
    let case = Case::new(Interaction::I1, 3, 2, 30);
    let mut draws = Draws(3);
    for i in 0..case.trials {
        let mut world = any_world(&mut draws, 3, 5);
        (world.mean_time_to_failure, world.mean_time_to_repair) = (vec![0.3; 3], vec![0.1; 3]);
        (world.disturbance, world.communication) = (vec![0.2; 5], None);
        let chances = Chances { world: &world, seed: 9, trial: 4 };
        let one = case.run(i, Some(chances), Termination::Sampled);
        let narrow = vec![0.5; 3];
        let rules = Rules { chances: Some(chances), ..Rules::default() };
        let other =
            simulate_with(&case.policy, &Setup { visibility: &narrow, ..case.setup(i) }, rules, &CancelToken::new());
        let (one, other) = (one.course.expect("a course"), other.expect("a run").course.expect("a course"));
        let rows = one.states.len().min(other.states.len());
        // The last row of either repeats the network before, and is followed by no step.
        assert_eq!(one.states[..rows - 1], other.states[..rows - 1]);
        assert_eq!(one.displacement[..(rows - 1) * 10], other.displacement[..(rows - 1) * 10]);
        assert!(rows < 3 || one.displacement[..10] != one.displacement[10..20]);
    }
}

/// A network from outside takes the place of what is seen, and is asked for at every instant but the last.
#[test]
fn a_network_may_come_from_outside() {
    let case = Case::new(Interaction::I1, 3, 2, 20);
    for i in 0..case.trials {
        let plain = case.run(i, None, Termination::Sampled);
        let mut asked = Vec::new();
        let outside: Box<Outside> = Box::new(|moment| {
            asked.push((moment.step, moment.time, moment.positions.to_vec()));
            Some(moment.seen.clone())
        });
        let rules = Rules { outside: Some(outside), ..Rules::default() };
        let echoed = simulate_with(&case.policy, &case.setup(i), rules, &CancelToken::new()).expect("a run");
        let width = case.players() * 2;
        for (k, (step, time, positions)) in asked.iter().enumerate() {
            assert_eq!((*step, *time), (k, case.policy.game().grid().time(k)));
            assert_eq!(positions, &plain.positions[k * width..(k + 1) * width]);
        }
        assert_eq!(asked.len(), plain.steps.max(1));
        assert_eq!(Record { course: None, ..echoed }, plain);
        let full: Box<Outside> = Box::new(|moment| Some(Topology::complete(moment.seen.rows(), moment.seen.size())));
        let rules = Rules { outside: Some(full), ..Rules::default() };
        let full = simulate_with(&case.policy, &case.setup(i), rules, &CancelToken::new()).expect("a run");
        assert!(full.networks.iter().all(Topology::is_complete));
        let none: Box<Outside> = Box::new(|moment| (moment.step < 1).then(|| moment.seen.clone()));
        let rules = Rules { outside: Some(none), ..Rules::default() };
        let ended = simulate_with(&case.policy, &case.setup(i), rules, &CancelToken::new());
        let time = case.policy.game().grid().time(1);
        assert!(plain.steps < 2 || ended == Err(RunError::Network { time }));
    }
}

/// Worlds that cannot be are refused by the names of their fields.
#[test]
fn bad_worlds_are_refused_by_name() {
    let case = Case::new(Interaction::I1, 2, 2, 3);
    let good = || World { communication: Some(all_links(2)), ..quiet(2, 4) };
    let said = |world: &World| match world.check() {
        Err(GameError::Value { field, .. }) => field,
        Err(GameError::Length { field, .. }) => field.to_owned(),
        other => format!("{other:?}"),
    };
    assert_eq!(said(&good()), "Ok(())");
    type Break = fn(&mut World);
    let bad: [(&str, Break); 14] = [
        ("mean_time_to_failure[1]", |w| w.mean_time_to_failure[1] = 0.0),
        ("mean_time_to_failure[0]", |w| w.mean_time_to_failure[0] = f64::NAN),
        ("mean_time_to_repair[1]", |w| w.mean_time_to_repair[1] = -1.0),
        ("mean_time_detected[0]", |w| w.mean_time_detected[0] = f64::NEG_INFINITY),
        ("mean_time_missed[0]", |w| w.mean_time_missed[0] = 1e-200),
        ("mean_time_missed", |w| w.mean_time_missed = vec![1.0]),
        ("stationary", |w| w.begin = Vec::new()),
        ("disturbance[2]", |w| w.disturbance[2] = -0.1),
        ("disturbance[3]", |w| w.disturbance[3] = f64::INFINITY),
        ("link_radius[1]", |w| w.communication.as_mut().expect("links").radius[1] = Some(0.0)),
        ("link_radius[0]", |w| w.communication.as_mut().expect("links").radius[0] = Some(f64::NAN)),
        ("relays", |w| w.communication.as_mut().expect("links").relays = Some(-1)),
        ("link_mean_time_up[0]", |w| w.communication.as_mut().expect("links").mean_time_up[0] = 0.0),
        ("link_mean_time_down[1]", |w| w.communication.as_mut().expect("links").mean_time_down[1] = f64::NAN),
    ];
    for (field, broken) in bad {
        let mut world = good();
        broken(&mut world);
        assert_eq!(said(&world), field);
        let rules = Rules { chances: Some(Chances { world: &world, seed: 0, trial: 0 }), ..Rules::default() };
        let run = simulate_with(&case.policy, &case.setup(0), rules, &CancelToken::new());
        assert!(matches!(run, Err(RunError::Game(_))), "{field}");
    }
    let alone = World { communication: Some(all_links(1)), ..quiet(1, 3) };
    assert!(alone.check().expect_err("no link").to_string().contains("a team of one has nobody to talk to"));
    // Of another game's size; past the last trial; and disturbed between instants.
    let run = |world: &World, trial: u64, termination: Termination, between: Between| {
        let chances = Some(Chances { world, seed: 0, trial });
        let rules = Rules { chances, termination, ..Rules::default() };
        let one = simulate_with(&case.policy, &case.setup(0), rules, &CancelToken::new()).map(|_| ());
        let batch = Batch { dim: 2, positions: &case.positions, visibility: &case.visibility, capture: &case.capture };
        let many = ensemble::run_with(&case.policy, &batch, between, chances, Some(1), &CancelToken::new()).map(|_| ());
        [one, many].map(|result| result.expect_err("refused").to_string())
    };
    let sampled = Between::NOTHING;
    for said in run(&quiet(3, 5), 0, Termination::Sampled, sampled) {
        assert_eq!(said, "mean_time_to_failure has 3 entries, but it must have 2");
    }
    let [one, many] = run(&quiet(2, 4), TRIALS, Termination::Sampled, sampled);
    assert!(one == many && one.contains("below 2^56"), "{one}");
    let shaken = World { disturbance: vec![0.0, 0.0, 0.5, 0.0], ..quiet(2, 4) };
    let continuous = Between { termination: Termination::Continuous, passes: false };
    for said in run(&shaken, 0, Termination::Continuous, continuous) {
        assert!(said.starts_with("disturbance[2] is 0.5, but it must be 0 with a continuous end"), "{said}");
    }
    let batch = Batch { dim: 2, positions: &case.positions, visibility: &case.visibility, capture: &case.capture };
    let passes = Between { termination: Termination::Sampled, passes: true };
    let chances = Some(Chances { world: &shaken, seed: 0, trial: 0 });
    assert!(ensemble::run_with(&case.policy, &batch, passes, chances, Some(1), &CancelToken::new()).is_err());
    // The last trial of a batch, too.
    let last = Some(Chances { world: &shaken, seed: 0, trial: TRIALS - 2 });
    assert!(ensemble::run_with(&case.policy, &batch, sampled, last, Some(1), &CancelToken::new()).is_err());
}

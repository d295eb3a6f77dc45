//! A world that fails, talks and shakes: what a run is given besides positions and radii. Without one, the paper's game.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | U, D | [`World::mean_time_to_failure`] … | mean times of sensors, of single edges, of links |
//! | ρ | [`Communication::radius`] | how far a player is heard |
//! | ς | [`World::disturbance`] | length per square root of time: dX_p = u_p dt + ς_p dW_p |
//! | s = ς √δ | [`Conditions::spread`] | standard deviation of what is added to a position in one step, per axis |
//!
//! A [`World`] is checked by itself; [`Conditions`] are what it means in a game, on its grid.

use crate::error::GameError;
use crate::game::Game;
use crate::game::validation::rule;
use crate::network::{Failures, Frame, Links};
use crate::random::{Begin, Chain, Draws, TRIALS};

/// What may fail, who talks and who is shaken: for each constrained player, m numbers; disturbances for all n + 2.
#[derive(Debug, Clone, PartialEq)]
pub struct World {
    /// Mean time until a player's sensor fails; infinite: never.
    pub mean_time_to_failure: Vec<f64>,
    /// Mean time until it works again; infinite: for good.
    pub mean_time_to_repair: Vec<f64>,
    /// Mean time for which a single edge within sight is detected; infinite: always.
    pub mean_time_detected: Vec<f64>,
    /// Mean time for which it is missed.
    pub mean_time_missed: Vec<f64>,
    /// How the chains of a player's sensor and edges begin.
    pub begin: Vec<Begin>,
    /// How the team talks, if it does.
    pub communication: Option<Communication>,
    /// ς of d₁…d_n, target, attacker.
    pub disturbance: Vec<f64>,
}

/// How a team talks: of each constrained player what it sends.
#[derive(Debug, Clone, PartialEq)]
pub struct Communication {
    /// How far it is heard, infinite: everywhere; none where it sends nothing.
    pub radius: Vec<Option<f64>>,
    /// Most players between; none: any number.
    pub relays: Option<i64>,
    /// What players know of their own places.
    pub frame: Frame,
    /// Mean time for which a link from it is up; infinite: always.
    pub mean_time_up: Vec<f64>,
    /// Mean time for which it is down.
    pub mean_time_down: Vec<f64>,
    /// How links begin.
    pub begin: Begin,
}

/// The least mean time: the rates of smaller ones overflow.
const LEAST: f64 = 1e-100;
/// The largest disturbance, as positions are bounded.
const MOST: f64 = 1e100;

impl World {
    /// Checks every number by itself.
    ///
    /// # Errors
    /// [`GameError`] naming the first that breaks its rule.
    pub fn check(&self) -> Result<(), GameError> {
        let m = self.mean_time_to_failure.len();
        let mut times: Vec<(&'static str, &[f64])> = vec![
            ("mean_time_to_failure", &self.mean_time_to_failure),
            ("mean_time_to_repair", &self.mean_time_to_repair),
            ("mean_time_detected", &self.mean_time_detected),
            ("mean_time_missed", &self.mean_time_missed),
        ];
        let mut lengths = vec![("stationary", self.begin.len())];
        if let Some(talk) = &self.communication {
            times.extend([("link_mean_time_up", &*talk.mean_time_up), ("link_mean_time_down", &*talk.mean_time_down)]);
            lengths.push(("link_radius", talk.radius.len()));
        }
        lengths.extend(times.iter().map(|(field, values)| (*field, values.len())));
        if let Some(&(field, found)) = lengths.iter().find(|(_, found)| *found != m) {
            return Err(GameError::Length { field, found, expected: m });
        }
        for (field, values) in times {
            for (i, &time) in values.iter().enumerate() {
                rule(&format!("{field}[{i}]"), time, time >= LEAST, "a number of at least 1e-100, or infinity")?;
            }
        }
        for (p, &sigma) in self.disturbance.iter().enumerate() {
            let is = (0.0..=MOST).contains(&sigma);
            rule(&format!("disturbance[{p}]"), sigma, is, "a number from 0 to 1e100")?;
        }
        let Some(talk) = &self.communication else { return Ok(()) };
        for (j, &rho) in talk.radius.iter().enumerate() {
            let rho = rho.unwrap_or(1.0);
            rule(&format!("link_radius[{j}]"), rho, rho > 0.0, "a positive number or infinity")?;
        }
        let relays = talk.relays.unwrap_or(0);
        rule("relays", relays as f64, relays >= 0, "a whole number of at least 0")?;
        let own = talk.radius[0].unwrap_or_default();
        rule("link_radius[0]", own, m > 1, "left out: a team of one has nobody to talk to")
    }

    /// Refuses disturbances, where what happens between two instants is asked for.
    ///
    /// # Errors
    /// [`GameError`] naming the first disturbance.
    pub fn refuse_between(&self) -> Result<(), GameError> {
        let words = "0 with a continuous end or passes: the path between two instants is not known under disturbances";
        let Some(p) = self.disturbance.iter().position(|&sigma| sigma > 0.0) else { return Ok(()) };
        rule(&format!("disturbance[{p}]"), self.disturbance[p], false, words)
    }
}

/// A world, and which of its trials.
#[derive(Debug, Clone, Copy)]
pub struct Chances<'a> {
    /// What may happen.
    pub world: &'a World,
    /// The seed of all trials.
    pub seed: u64,
    /// The trial's number, or that of the first of a batch.
    pub trial: u64,
}

impl Chances<'_> {
    /// The numbers of the trial that is so many after the first.
    #[must_use]
    pub fn draws(&self, after: u64) -> Draws {
        Draws { seed: self.seed, trial: self.trial + after }
    }

    /// What the world means in a game, for so many trials.
    ///
    /// # Errors
    /// [`GameError`] for a world that breaks a rule or is not of this game's size, or where no numbers are left for a trial.
    pub fn conditions(&self, game: &Game, trials: u64) -> Result<Conditions, GameError> {
        let is = self.trial < TRIALS && trials <= TRIALS - self.trial;
        rule("trial", self.trial as f64, is, "below 2^56, the last of a batch included")?;
        Conditions::new(self.world, game)
    }
}

/// What a world means in a game.
#[derive(Debug, Clone, PartialEq)]
pub struct Conditions {
    /// What can fail.
    pub failures: Failures,
    /// Who hears whom.
    pub links: Option<Links>,
    /// s of every player, d₁…d_n, target, attacker; none where nobody is disturbed.
    pub spread: Option<Vec<f64>>,
}

impl Conditions {
    /// Checks the world and looks at it on the game's grid.
    ///
    /// # Errors
    /// [`GameError`] for a world that breaks a rule, or is not of this game's size.
    pub fn new(world: &World, game: &Game) -> Result<Self, GameError> {
        world.check()?;
        let (m, players, step) = (game.constrained(), game.n() + 2, game.grid().step());
        for (field, found, expected) in [
            ("mean_time_to_failure", world.mean_time_to_failure.len(), m),
            ("disturbance", world.disturbance.len(), players),
        ] {
            if found != expected {
                return Err(GameError::Length { field, found, expected });
            }
        }
        let chains = |up: &[f64], down: &[f64], begin: &dyn Fn(usize) -> Begin| -> Vec<Chain> {
            (0..m).map(|i| Chain::new(up[i], down[i], begin(i), step)).collect()
        };
        let own = |i: usize| world.begin[i];
        let sensor = chains(&world.mean_time_to_failure, &world.mean_time_to_repair, &own);
        let edge = chains(&world.mean_time_detected, &world.mean_time_missed, &own);
        let talk = world.communication.as_ref();
        let link = talk.map(|talk| chains(&talk.mean_time_up, &talk.mean_time_down, &|_| talk.begin));
        let relays = |talk: &Communication| talk.relays.map(|most| usize::try_from(most).unwrap_or(usize::MAX));
        let spread: Vec<f64> = world.disturbance.iter().map(|sigma| sigma * step.sqrt()).collect();
        Ok(Self {
            failures: Failures::new(game.size(), &sensor, &edge, link.as_deref()),
            links: talk.map(|talk| Links::new(&talk.radius, relays(talk), talk.frame)),
            spread: spread.iter().any(|&s| s > 0.0).then_some(spread),
        })
    }
}

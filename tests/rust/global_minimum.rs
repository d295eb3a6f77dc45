//! Hard instants, where Newton's method from the canonical start ends too high: the lowest Θ known, and the work.
//!
//! The lowest Θ are those of other programs (`tests/reference`): wide searches by the oracle of the Python tests, and the
//! published hard instants. Which restarts are made, and what each descent may skip, shows nowhere else.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tadcore::cancel::CancelToken;
use tadcore::game::{Game, Grid, Interaction, Weights};
use tadcore::network::Topology;
use tadcore::riccati;
use tadcore::synthesis::{Gains, Options, Problem, Status, Synthesizer};

/// By how much, relatively, Θ may be above the lowest known.
const LOWER: f64 = 1e-9;

/// Iterations of all descents of [`of_games`] together, of fewer than five constrained players and of more, measured in
/// November 2026, and what may come on top. Descents from fits of GᵀRG are a sixth of them: without they were 56,005, and
/// seven of 8,000 visited pairs were missed, not one. Of five players and more they were 42,573 before rows were exchanged
/// further up: three of 8,000 pairs, all of five defenders, were missed.
const ITERATIONS: ([usize; 2], f64) = ([24_957, 61_776], 1.03);

/// One instant and network, with the lowest Θ known.
struct Instant {
    name: String,
    problem: Problem,
    /// P, all groups.
    p: Vec<f64>,
    topology: Topology,
    theta: f64,
}

fn table(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/reference").join(name);
    serde_json::from_str(&fs::read_to_string(path).expect("a reference file")).expect("valid JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

fn numbers(value: &Value) -> Vec<f64> {
    list(value).iter().map(number).collect()
}

fn interaction(value: &Value) -> Interaction {
    if value == "I1" { Interaction::I1 } else { Interaction::I2 }
}

fn game(of: &Value) -> Game {
    let interaction = interaction(&of["interaction"]);
    let own = |name: &str| if interaction == Interaction::I1 { numbers(&of[name]) } else { Vec::new() };
    let (gamma, terms) = (numbers(&of["gamma"]), interaction.terms());
    let weights = Weights {
        r_d: numbers(&of["r_d"]),
        r_tau: number(&of["r_tau"]),
        r_a: number(&of["r_a"]),
        q_da: own("q_da"),
        f_da: own("f_da"),
        q_ad: numbers(&of["q_ad"]),
        f_ad: numbers(&of["f_ad"]),
        q_atau: number(&of["q_atau"]),
        f_atau: number(&of["f_atau"]),
        q_taua: number(&of["q_taua"]),
        f_taua: number(&of["f_taua"]),
        lambda: number(&of["evasion"]),
        gamma: if gamma.is_empty() { vec![1.0 / terms as f64; terms] } else { gamma },
    };
    let grid = Grid::new(number(&of["horizon"]), number(&of["step"])).expect("a grid");
    Game::new(interaction, weights, grid).expect("a valid game")
}

/// The tables write a network as one number whose first binary digit is its first entry.
fn network(game: &Game, code: u64) -> Topology {
    let (m, n) = (game.constrained(), game.size());
    Topology::from_fn(m, n, |i, j| code >> (m * n - 1 - (i * n + j)) & 1 == 1)
}

/// Instants of random games, by their step, network and lowest Θ.
fn of_games() -> Vec<Instant> {
    let mut found = Vec::new();
    let mut add = |file: &str, entry: &Value, rows: &[[&Value; 3]]| {
        let game = game(&entry["game"]);
        let equilibrium = riccati::solve(&game, &CancelToken::new()).expect("an equilibrium");
        for [step, code, theta] in rows {
            let (step, code) = (step.as_u64().expect("a step") as usize, code.as_u64().expect("a network"));
            found.push(Instant {
                name: format!("{file}: {:?} n = {} step {step} network {code}", game.interaction(), game.n()),
                problem: Problem::new(&game, equilibrium.node(step), &CancelToken::new()).expect("memory"),
                p: equilibrium.node(step).to_vec(),
                topology: network(&game, code),
                theta: number(theta),
            });
        }
    };
    for file in ["hard_instants", "reversed_rows", "lower_theta"] {
        for entry in list(&table(&format!("{file}.json"))["instants"]) {
            add(file, entry, &[[&entry["step"], &entry["network"], &entry["theta"]]]);
        }
    }
    for entry in list(&table("random_games.json")["games"]) {
        if let Some(hard) = entry.get("hard") {
            let rows: Vec<[&Value; 3]> = list(hard).iter().map(|row| [&row[0], &row[1], &row[2]]).collect();
            add("random_games", entry, &rows);
        }
    }
    found
}

/// The published hard instants, given by their P.
fn published() -> Vec<Instant> {
    let of = |(index, case): (usize, &Value)| {
        let weights = &case["control_weights"];
        let mut r = numbers(&weights["defenders"]);
        r.push(number(&weights["target"]));
        let rows: Vec<Vec<f64>> = list(&case["adjacency"]).iter().map(numbers).collect();
        let p: Vec<f64> = list(&case["P"]).iter().flat_map(numbers).collect();
        Instant {
            name: format!("synthesis_hard: {index}"),
            topology: Topology::from_fn(r.len(), r.len(), |i, j| rows[i][j] == 1.0),
            problem: Problem::from_parts(
                interaction(&case["interaction"]),
                r,
                numbers(&case["gamma"]),
                &p,
                &CancelToken::new(),
            )
            .expect("memory"),
            p,
            theta: number(&case["best_theta"]),
        }
    };
    list(&table("synthesis_hard.json")["cases"]).iter().enumerate().map(of).collect()
}

/// What a search gives for each instant.
fn solved(instants: &[Instant]) -> Vec<Gains> {
    let mut solver = Synthesizer::new();
    instants.iter().map(|i| solver.solve(&i.problem, &i.topology, Options::default()).expect("memory")).collect()
}

#[test]
fn no_instant_ends_above_the_lowest_theta_known() {
    let instants: Vec<Instant> = of_games().into_iter().chain(published()).collect();
    assert!(instants.len() >= 143, "{}", instants.len());
    let mut above = Vec::new();
    for (instant, found) in instants.iter().zip(solved(&instants)) {
        assert_eq!(found.status, Status::Converged, "{}", instant.name);
        if found.theta > instant.theta * (1.0 + LOWER) {
            above.push(format!("{}: {} times", instant.name, found.theta / instant.theta));
        }
    }
    assert!(above.is_empty(), "{above:#?}");
}

/// Whatever start won: no gain on a player that is not seen, rows of who does not see the attacker sum to zero, and Θ is
/// that of its terms.
#[test]
fn gains_use_what_the_network_shows() {
    let instants = of_games();
    for (instant, found) in instants.iter().zip(solved(&instants)) {
        let (n, topology) = (instant.problem.size(), &instant.topology);
        for (i, row) in found.rows.chunks_exact(n).enumerate() {
            let size: f64 = row.iter().map(|g| g.abs()).sum();
            for (j, &g) in row.iter().enumerate() {
                assert!(j == i || g == 0.0 || topology.sees(i, j), "{}: {i} {j}", instant.name);
            }
            if !topology.sees_attacker(i) {
                assert!(row.iter().sum::<f64>().abs() <= 1e-14 * size, "{}: {i}", instant.name);
            }
        }
        let theta = instant
            .problem
            .weigh(&instant.problem.terms(&instant.p, &found.rows, &CancelToken::new()).expect("memory"));
        assert!((theta - found.theta).abs() <= 1e-11 * theta, "{}: {theta}", instant.name);
    }
}

/// In the valleys of I2 games that almost escape, some with curvatures twelve orders of magnitude apart, a gradient at
/// the tolerance leaves gains uncertain: there the search goes on to the floor that rounding allows.
#[test]
fn a_narrow_valley_is_followed_to_its_floor() {
    let valleys = [20_950_980, 10_996_217].map(|code| format!("network {code}"));
    let mut instants = of_games();
    instants.retain(|i| i.name.starts_with("hard") && valleys.iter().any(|valley| i.name.ends_with(valley)));
    assert_eq!(instants.len(), 2);
    for (instant, found) in instants.iter().zip(solved(&instants)) {
        assert!(found.gradient_norm < 1e-15, "{}: {:e}", instant.name, found.gradient_norm);
    }
}

/// Not a matter of right or wrong: dampings, step lengths and early endings decide how much work a search is. Raise the
/// figure for a reason only; lower it when a change saves work.
#[test]
fn the_work_is_no_more_than_measured() {
    let instants = of_games();
    let mut iterations = [0; 2];
    for (instant, found) in instants.iter().zip(solved(&instants)) {
        iterations[usize::from(instant.topology.rows() >= 5)] += found.iterations;
    }
    for (found, measured) in iterations.iter().zip(ITERATIONS.0) {
        assert!(*found as f64 <= ITERATIONS.1 * measured as f64, "{iterations:?}");
    }
}

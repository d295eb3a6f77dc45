//! One recorded run, told as it happens: the paper's first interaction with limited observations.
//!
//! `cargo run --release --example run`

use tadcore::cancel::CancelToken;
use tadcore::cost;
use tadcore::game::{Interaction, bank};
use tadcore::network::Topology;
use tadcore::policy::{DEFAULT_TABLE_BYTES, Policy};
use tadcore::simulation::{Outcome, Setup, simulate};

/// The symbol of a player: d1…dn, τ, a.
fn symbol(player: usize, n: usize) -> String {
    match player {
        _ if player < n => format!("d{}", player + 1),
        _ if player == n => "τ".into(),
        _ => "a".into(),
    }
}

/// Edges of `now` that `before` lacks, as `d2→a`; the entry on the diagonal is the attacker.
fn gained(now: &Topology, before: &Topology, n: usize) -> Vec<String> {
    let pairs = (0..now.rows()).flat_map(|i| (0..now.size()).map(move |j| (i, j)));
    let new = pairs.filter(|&(i, j)| now.sees(i, j) && !before.sees(i, j));
    new.map(|(i, j)| format!("{}→{}", symbol(i, n), symbol(if i == j { n + 1 } else { j }, n))).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let game = bank::paper_game(Interaction::I1, 1.0)?;
    let (n, grid) = (game.n(), *game.grid());
    let start = bank::paper_i1_limited();
    let positions = start.positions.concat();
    let setup = Setup { dim: 2, positions: &positions, visibility: &start.visibility, capture: &start.capture };
    let cancel = CancelToken::new();
    let policy = Policy::new(game, DEFAULT_TABLE_BYTES, &cancel)?;
    let run = simulate(&policy, &setup, &cancel)?;

    println!("    t       Θ  network");
    let mut before = Topology::empty(run.networks[0].rows(), run.networks[0].size());
    for (k, now) in run.networks.iter().enumerate().take(run.steps) {
        if *now != before {
            let lost = gained(&before, now, n);
            let lost = if lost.is_empty() { String::new() } else { format!("  lost {}", lost.join(" ")) };
            println!("{:5.3}  {:6.3}  {}{lost}", grid.time(k), run.theta[k], gained(now, &before, n).join(" "));
            before = now.clone();
        }
    }
    let end = grid.time(run.steps);
    match run.outcome {
        Outcome::Intercepted(i) => println!("{end:5.3}          {} intercepts the attacker", symbol(i, n)),
        Outcome::Captured => println!("{end:5.3}          the attacker captures the target"),
        Outcome::Timeout => println!("{end:5.3}          nobody is caught"),
    }
    println!("\nplayer       start              end");
    for player in 0..n + 2 {
        let at = |k: usize| &run.positions[(k * (n + 2) + player) * 2..][..2];
        let (from, to) = (at(0), at(run.steps));
        println!("{:6}  ({:6.3}, {:6.3})  ({:6.3}, {:6.3})", symbol(player, n), from[0], from[1], to[0], to[1]);
    }
    let costs = cost::costs(&policy, &run, &cancel)?;
    println!("\nJ_d = {:.4}, J_τ = {:.4}, J_a = {:.4}", costs[0], costs[1], costs[2]);
    Ok(())
}

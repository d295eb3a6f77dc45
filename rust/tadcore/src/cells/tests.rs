//! What is enclosed must be inside: states that the engine's arithmetic gives, in double-double, at every instant; and an
//! error that is planted must be found by the same comparison.

use super::Region;
use super::cell::{Cell, Fate, Scratch};
use super::enclosure::Enclosure;
use super::map::{Map, Place, middle};
use crate::cancel::CancelToken;
use crate::game::{Interaction, bank};
use crate::network::{Topology, observe, squared_reach};
use crate::policy::{DEFAULT_TABLE_BYTES, Policy, step_table};
use crate::simulation::{Outcome, Reach, Setup, relative_state};
use crate::synthesis::Synthesizer;

/// Numbers in [0, 1) (SplitMix64).
struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// a − b as a sum of two doubles (Knuth).
fn minus(a: f64, b: f64) -> (f64, f64) {
    let d = a - b;
    let v = d - a;
    (d, (a - (d - v)) + (-b - v))
}

/// z − c − α s with the roundings of the last bits alone.
fn residual(z: f64, c: f64, slope: f64, s: (f64, f64)) -> f64 {
    let ((d, low), by) = (minus(z, c), slope * s.0);
    let by_low = slope.mul_add(s.0, -by) + slope * s.1;
    let (r, rest) = minus(d, by);
    r + (rest + (low - by_low))
}

/// Columns as the table has them.
fn columns(matrix: &[f64], n: usize) -> Vec<f64> {
    let rows = step_table::padded(n);
    let mut out = vec![0.0; n * rows];
    (0..n * n).for_each(|e| out[e % n * rows + e / n] = matrix[e]);
    out
}

/// Follows a cell and starts in it; how often a state was outside of every history, of how many, and how often a start ended
/// in a way that was not proved.
fn outside(
    policy: &Policy,
    map: &Map,
    setup: &Setup,
    place: Place,
    starts: usize,
    planted: f64,
) -> (usize, usize, bool) {
    let game = policy.game();
    let (n, m) = (game.size(), game.constrained());
    let (low, high) = map.bounds(place.column, place.row, map.level);
    let (middle, half) = middle(low, high);
    let origin = map.start(setup, middle, half);
    let mut cell = Cell::new(&origin, [0.0; 2], half, true);
    let mut draws = Draws(place.column * 77 + place.row);
    // Corners, middles of the rims, then anywhere.
    let mut points: Vec<[f64; 2]> = vec![low, high, [low[0], high[1]], [high[0], low[1]], [low[0], middle[1]], middle];
    points.extend((0..starts).map(|_| [0, 1].map(|x| (low[x] + (high[x] - low[x]) * draws.next()).min(high[x]))));
    let mut states: Vec<Option<Vec<f64>>> = Vec::new();
    for point in &points {
        let mut positions = setup.positions.to_vec();
        positions[2 * map.player..][..2].copy_from_slice(point);
        let mut z = Vec::new();
        relative_state(&positions, 2, &mut z);
        states.push(Some(z));
    }
    let (sight, reach): (Vec<f64>, Reach) =
        (setup.visibility.iter().map(|&r| squared_reach(r)).collect(), Reach::new(setup.capture));
    let (mut scratch, mut solver, cancel) = (Scratch::default(), Synthesizer::new(), CancelToken::new());
    let (mut wrong, mut checked, mut ends) = (0, 0, Vec::new());
    for k in 0..=game.grid().steps() {
        for (state, point) in states.iter_mut().zip(&points) {
            let Some(z) = state else { continue };
            let s = [0, 1].map(|x| minus(point[x], middle[x]));
            let inside = cell.histories.iter().any(|e| {
                (0..2 * n).all(|r| {
                    let (i, x) = (r / 2, r % 2);
                    residual(z[r], e.centre[x][i], e.slope[i], s[x]).abs() <= e.error[x][i]
                })
            });
            (wrong, checked) = (wrong + usize::from(!inside), checked + 1);
            if let Some(end) = reach.ends(z, 2).or((k == game.grid().steps()).then_some(Outcome::Timeout)) {
                ends.push(end);
                *state = None;
            }
        }
        let fate = cell.look(k, k == game.grid().steps(), &map.radii, &mut scratch);
        if let Some(fate) = fate {
            let contradicts = matches!(fate, Fate::Proved(outcome) if ends.iter().any(|&end| end != outcome) || states.iter().any(Option::is_some));
            return (wrong, checked, contradicts);
        }
        let mut matrices: Vec<(Vec<u64>, Vec<f64>)> = Vec::new();
        let mut matrix = |words: &[u64], solver: &mut Synthesizer| {
            if !matrices.iter().any(|(key, _)| key == words) {
                let topology = Topology::from_words(m, n, words);
                let of = policy.at(k, &topology, solver, &cancel).expect("an entry");
                matrices.push((words.to_vec(), columns(&of.transition, n)));
            }
        };
        cell.networks(&mut scratch, |words| {
            matrix(words, &mut solver);
            true
        });
        for z in states.iter_mut().flatten() {
            let mut topology = Topology::empty(m, n);
            observe(z, 2, &sight, &mut topology);
            let of = policy.at(k, &topology, &mut solver, &cancel).expect("an entry");
            let mut next = vec![0.0; 2 * n];
            for (r, to) in next.iter_mut().enumerate() {
                let row = &of.transition[r / 2 * n..][..n];
                *to = row.iter().zip(z[r % 2..].iter().step_by(2)).fold(0.0, |sum, (a, b)| sum + a * b);
            }
            *z = next;
        }
        for (_, matrix) in &mut matrices {
            matrix[1] += planted;
        }
        cell.step(k, &mut scratch, |words| &matrices.iter().find(|(key, _)| key == words).expect("asked for").1);
    }
    // A cell ends at T at the latest.
    (usize::MAX, checked, true)
}

/// A map of small cells of a game with n defenders.
fn small(policy: &Policy, setup: &Setup, player: usize, level: u32) -> Map {
    let region = Region { setup: *setup, player, low: [-2.0, -1.7], high: [2.0, 2.3] };
    let mut map = Map::new(policy, &region, 1e-3, usize::MAX).expect("a region");
    map.level = level;
    map
}

/// Every state of every start lies in a history of its cell, for both interactions, any player that moves, cells that fork and
/// cells that do not; a matrix entry that is off by 1e-6 is found at once.
#[test]
fn states_lie_in_their_cells() {
    let cancel = CancelToken::new();
    let mut totals = [0; 3];
    for (interaction, n, players) in [
        (Interaction::I1, 1, vec![0, 2]),
        (Interaction::I1, 3, vec![1, 3, 4]),
        (Interaction::I2, 2, vec![2, 3]),
        (Interaction::I1, 5, vec![6]),
    ] {
        let game = bank::unit_game(interaction, vec![1.0; n], 1.2, 0.8, 1.0, 1.0, 0.005).expect("a game");
        let m = game.constrained();
        let policy = Policy::new(game, DEFAULT_TABLE_BYTES, &cancel).expect("an equilibrium");
        let mut draws = Draws(n as u64);
        let positions: Vec<f64> = (0..2 * (n + 2)).map(|_| 4.0 * draws.next() - 2.0).collect();
        let (visibility, capture) = ((0..m).map(|i| 1.2 + 0.4 * i as f64).collect::<Vec<_>>(), vec![0.1; n + 1]);
        let setup = Setup { dim: 2, positions: &positions, visibility: &visibility, capture: &capture };
        for player in players {
            for level in [7, 9, 14] {
                let map = small(&policy, &setup, player, level);
                let count = (1_u64 << level) as f64;
                for _ in 0..3 {
                    let place =
                        Place { column: (draws.next() * count) as u64, row: (draws.next() * count) as u64, origin: 0 };
                    let (wrong, checked, contradicts) = outside(&policy, &map, &setup, place, 4, 0.0);
                    assert_eq!((wrong, contradicts), (0, false), "{interaction:?} {n} {player} {level} {place:?}");
                    let planted = outside(&policy, &map, &setup, place, 4, 1e-6);
                    totals = [totals[0] + checked, totals[1] + usize::from(planted.0 > 0), totals[2] + 1];
                }
            }
        }
    }
    // Where nothing forks the enclosure is tighter than 1e-6; a cell that ends at once has no step.
    assert!(totals[0] > 20_000 && totals[1] > totals[2] / 3, "{totals:?}");
}

/// A frame is turned, and two enclosures become one, without losing a state.
#[test]
fn turned_and_merged_enclosures_hold_what_they_held() {
    let (n, rows, half) = (3, 4, [0.1, 0.2]);
    let mut draws = Draws(5);
    let mut random = |scale: f64| -> Vec<f64> { (0..n).map(|_| scale * (2.0 * draws.next() - 1.0)).collect() };
    for _ in 0..50 {
        let slope = random(1.0);
        let mut pair: Vec<Enclosure> =
            (0..2).map(|_| Enclosure::start(n, rows, [&random(1.0), &random(1.0)], &slope, half)).collect();
        for e in &mut pair {
            let mut other = e.clone();
            other.centre[0][1] += 0.01;
            e.merge(&other, half);
            for _ in 0..5 {
                let m = columns(
                    &(0..9).map(|e| f64::from(u8::from(e % 4 == 0)) + 0.3 * random(1.0)[0]).collect::<Vec<_>>(),
                    n,
                );
                let mut next = Enclosure::new(n, rows);
                e.step(&m, half, &mut next);
                *e = next;
            }
        }
        // Corners of the parallelepiped A r + β of each.
        let corner = |e: &Enclosure, signs: u32, x: usize| -> Vec<f64> {
            let sign = |bit: u32| if signs >> bit & 1 == 1 { 1.0 } else { -1.0 };
            (0..n)
                .map(|i| {
                    let turned: f64 = (0..n).map(|l| e.frame[l * rows + i] * sign(l as u32) * e.reach[x][l]).sum();
                    e.centre[x][i] + e.slope[i] * sign(6) * half[x] + turned + sign(3 + i as u32) * e.rest[x][i]
                })
                .collect()
        };
        let mut corners = Vec::new();
        for e in &pair {
            for signs in 0..128 {
                (0..2).for_each(|x| corners.push((signs, x, corner(e, signs, x))));
            }
        }
        let (mut one, other) = (pair[0].clone(), pair[1].clone());
        one.merge(&other, half);
        for (signs, x, z) in &corners {
            let s = if signs >> 6 & 1 == 1 { half[*x] } else { -half[*x] };
            let e: Vec<f64> = (0..n).map(|i| z[i] - one.centre[*x][i] - one.slope[i] * s).collect();
            // Q is orthogonal: coordinates in the frame, less what the rest allows.
            for l in 0..n {
                let column = &one.frame[l * rows..][..n];
                let along: f64 = column.iter().zip(&e).map(|(a, b)| a * b).sum();
                let most: f64 = column.iter().zip(&one.rest[*x]).map(|(a, b)| a.abs() * b).sum();
                assert!(along.abs() <= one.reach[*x][l] + most + 1e-13);
            }
        }
        let mut turned = one.clone();
        turned.turn();
        assert!(turned.rest.iter().flatten().all(|&b| b == 0.0));
    }
}

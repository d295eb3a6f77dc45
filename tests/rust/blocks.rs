//! The certificate for gains in blocks, against Θ of full 2N × 2N matrices: what it must be the definiteness of.

use nalgebra::{DMatrix, SymmetricEigen};
use tadcore::cancel::CancelToken;
use tadcore::game::{Game, Grid, Interaction, Weights};
use tadcore::network::Topology;
use tadcore::riccati;
use tadcore::synthesis::{Options, Problem, Synthesizer};

/// Numbers between 0 and 1 that are always the same.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn weights(&mut self, len: usize) -> Vec<f64> {
        (0..len).map(|_| 0.3 + 2.0 * self.next()).collect()
    }
}

/// A game with weights of one order; γ₁ is often small, so that what couples the rows decides.
fn game(interaction: Interaction, n: usize, numbers: &mut Numbers) -> Game {
    let own = if interaction == Interaction::I1 { n } else { 0 };
    let mut gamma: Vec<f64> = (0..interaction.terms()).map(|_| numbers.next()).collect();
    gamma[0] *= numbers.next();
    *gamma.last_mut().expect("weights") *= numbers.next();
    let weights = Weights {
        r_d: numbers.weights(n),
        r_tau: 2.0 + numbers.next(),
        r_a: 1.0 + numbers.next(),
        q_da: numbers.weights(own),
        f_da: numbers.weights(own),
        q_ad: numbers.weights(n),
        f_ad: numbers.weights(n),
        q_atau: 1.0,
        f_atau: 1.5,
        q_taua: 0.8,
        f_taua: 0.7,
        lambda: 1.0,
        gamma,
    };
    Game::new(interaction, weights, Grid::new(0.3, 0.3).expect("a grid")).expect("a game")
}

/// Θ of gains in blocks of 2 × 2, by the terms of eq:errfun1 and eq:errfun2 with the paper's full matrices.
struct Full {
    r: DMatrix<f64>,
    gamma: Vec<f64>,
    /// √γ of S, row by row.
    closeness: DMatrix<f64>,
    equilibrium: DMatrix<f64>,
    /// P_τ B and P_a B, times √γ.
    coupling: Vec<DMatrix<f64>>,
}

/// ⊗ of a matrix with a block of 2 × 2.
fn blocks(a: &DMatrix<f64>, block: [[f64; 2]; 2]) -> DMatrix<f64> {
    a.kronecker(&DMatrix::from_fn(2, 2, |i, j| block[i][j]))
}

const ONE: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
const TURN: [[f64; 2]; 2] = [[0.0, -1.0], [1.0, 0.0]];

impl Full {
    fn new(game: &Game, node: &[f64]) -> Self {
        let (n, m) = (game.size(), game.constrained());
        let p = |group: usize| DMatrix::from_row_slice(n, n, &node[group * n * n..(group + 1) * n * n]);
        let r = game.constrained_control_weights();
        let gamma = game.weights().gamma.clone();
        let first = game.interaction() == Interaction::I1;
        let sign = if first { -1.0 } else { 1.0 };
        let fne = DMatrix::from_fn(m, n, |i, j| sign * p(0)[(i, j)] / r[i]);
        let of_s = |i: usize| gamma[if first { 3 } else { 1 + usize::from(i + 1 == m) }].sqrt();
        let closeness = DMatrix::from_fn(m, m, |i, j| if i == j { of_s(i) * r[i] } else { 0.0 });
        let coupling = if first { vec![1, 2] } else { Vec::new() };
        let coupling = coupling.into_iter().map(|g| blocks(&(p(g).columns(0, m) * gamma[g].sqrt()), ONE)).collect();
        let r = DMatrix::from_fn(m, m, |i, j| if i == j { r[i] } else { 0.0 });
        let [r, closeness, equilibrium] = [r, closeness, fne].map(|a| blocks(&a, ONE));
        Self { r, gamma, closeness, equilibrium, coupling }
    }

    fn theta(&self, g: &DMatrix<f64>) -> f64 {
        let (away, e) = (g - &self.equilibrium, &self.equilibrium);
        let first = g.transpose() * &self.r * g - e.transpose() * &self.r * e;
        let both = self.coupling.iter().map(|w| w * &away).map(|w| (&w + w.transpose()).norm_squared());
        self.gamma[0] * first.norm_squared() + both.sum::<f64>() + (&self.closeness * away).norm_squared()
    }

    /// What Θ(g + y) has beyond Θ(g), its slope along y and the square of the first term's own change.
    fn rest(&self, g: &DMatrix<f64>, y: &DMatrix<f64>) -> f64 {
        let even = 0.5 * (self.theta(&(g + y)) + self.theta(&(g - y))) - self.theta(g);
        let change = g.transpose() * &self.r * y;
        let square = (&change + change.transpose()).norm_squared() + (y.transpose() * &self.r * y).norm_squared();
        even - self.gamma[0] * square
    }
}

/// The directions of what is seen, as m × N rows.
fn directions(topology: &Topology, m: usize, n: usize) -> Vec<DMatrix<f64>> {
    let seen = (0..m).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|&(i, j)| topology.sees(i, j));
    seen.map(|(i, j)| {
        let mut direction = DMatrix::zeros(m, n);
        if i != j {
            direction[(i, i)] = -1.0;
        }
        direction[(i, j)] = 1.0;
        direction
    })
    .collect()
}

/// The smallest eigenvalue of a form over directions, relative to the largest.
fn definiteness(form: impl Fn(&DMatrix<f64>) -> f64, directions: &[DMatrix<f64>]) -> f64 {
    let own: Vec<f64> = directions.iter().map(&form).collect();
    let entry = |i: usize, j: usize| 0.5 * (form(&(&directions[i] + &directions[j])) - own[i] - own[j]);
    let matrix = DMatrix::from_fn(own.len(), own.len(), |i, j| if i == j { own[i] } else { entry(i, j) });
    let values = SymmetricEigen::new(matrix).eigenvalues;
    values.min() / values.amax()
}

/// Gains that turn, against Θ of full matrices: lower than scalars, and bitwise these where blocks are covered.
#[test]
fn gains_that_turn_have_the_theta_of_their_blocks() {
    let (mut numbers, mut turned, mut kept) = (Numbers(11), 0, 0);
    for round in 0..400 {
        let game = game(Interaction::I1, 2 + round % 2, &mut numbers);
        let cancel = CancelToken::new();
        let Ok(equilibrium) = riccati::solve(&game, &cancel) else { continue };
        let problem = Problem::new(&game, equilibrium.node(0), &cancel).expect("memory");
        let (m, n) = (game.constrained(), game.size());
        let drawn: Vec<bool> = (0..m * n).map(|_| numbers.next() > 0.6).collect();
        let topology = Topology::from_fn(m, n, |i, j| drawn[i * n + j]);
        let mut solver = Synthesizer::new();
        let scalars = solver.solve(&problem, &topology, Options::default()).expect("memory");
        let gains = solver.turn(&problem, &topology, &scalars).expect("memory");
        if gains.turn.is_empty() {
            assert_eq!((&gains.rows, gains.theta), (&scalars.rows, scalars.theta), "round {round}");
            kept += 1;
            continue;
        }
        assert!(!scalars.certified_blocks(&problem, &topology, &cancel).expect("memory"), "round {round}");
        let [a, b] = [&gains.rows, &gains.turn].map(|rows| DMatrix::from_row_slice(m, n, rows));
        let full = Full::new(&game, equilibrium.node(0));
        for sign in [1.0, -1.0] {
            let theta = 0.5 * full.theta(&(blocks(&a, ONE) + blocks(&(sign * &b), TURN)));
            assert!((theta - gains.theta).abs() <= 1e-12 * theta, "round {round}: {theta:e}, {:e}", gains.theta);
        }
        assert!(gains.theta < scalars.theta, "round {round}");
        let p = equilibrium.node(0);
        let terms = problem.turning_terms(p, &gains.rows, &gains.turn, &cancel).expect("memory");
        assert!((problem.weigh(&terms) - gains.theta).abs() <= 1e-12 * gains.theta, "round {round}");
        turned += 1;
    }
    println!("{turned} turn, {kept} do not");
    assert!(turned > 3 && kept > 50, "{turned} turn, {kept} do not");
}

#[test]
fn gains_in_blocks_are_proved_where_the_form_of_blocks_that_turn_is_definite() {
    let (mut numbers, mut proved, mut open) = (Numbers(5), 0, 0);
    for round in 0..300 {
        let (interaction, n) = [(Interaction::I1, 2), (Interaction::I1, 3), (Interaction::I2, 2)][round % 3];
        let game = game(interaction, n, &mut numbers);
        let cancel = CancelToken::new();
        let Ok(equilibrium) = riccati::solve(&game, &cancel) else { continue };
        let problem = Problem::new(&game, equilibrium.node(0), &cancel).expect("memory");
        let (m, n) = (game.constrained(), game.size());
        let drawn: Vec<bool> = (0..m * n).map(|_| numbers.next() > 0.4).collect();
        let topology = Topology::from_fn(m, n, |i, j| drawn[i * n + j]);
        let gains = Synthesizer::new().solve(&problem, &topology, Options::default()).expect("memory");
        let found = gains.certified_blocks(&problem, &topology, &cancel).expect("memory");
        assert!(gains.certified || !found);
        let ways = directions(&topology, m, n);
        if !gains.certified || ways.is_empty() || topology.is_complete() {
            continue;
        }
        let (full, g) =
            (Full::new(&game, equilibrium.node(0)), blocks(&DMatrix::from_row_slice(m, n, &gains.rows), ONE));
        let least = |kind| {
            let ways: Vec<DMatrix<f64>> = ways.iter().map(|way| blocks(way, kind)).collect();
            definiteness(|y| full.rest(&g, y), &ways)
        };
        assert!(least(ONE) > -1e-9, "certified without reason, round {round}");
        let turning = least(TURN);
        if turning.abs() > 1e-9 {
            assert_eq!(found, turning > 0.0, "round {round}: {turning:e}");
            if found { proved += 1 } else { open += 1 }
        }
    }
    println!("{proved} proved, {open} open");
    assert!(proved > 50 && open > 5, "{proved} proved, {open} open");
}

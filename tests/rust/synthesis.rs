//! The gains from outside: against Θ as the terms define it, its differences, and projections written out in full.

use nalgebra::{DMatrix, DVector};
use tadcore::cancel::CancelToken;
use tadcore::game::{Game, Interaction, bank};
use tadcore::network::Topology;
use tadcore::riccati::{self, Equilibrium};
use tadcore::synthesis::{Gains, Method, Options, Problem, Status, Synthesizer};

/// Numbers between −1 and 1 that are always the same.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, len: usize) -> Vec<f64> {
        (0..len).map(|_| self.next()).collect()
    }
}

/// One instant of a game.
struct Instant {
    game: Game,
    equilibrium: Equilibrium,
    problem: Problem,
}

impl Instant {
    fn new(interaction: Interaction, n: usize) -> Self {
        let game = bank::varied_game(interaction, n, 0.2, 0.1).expect("a valid game");
        let equilibrium = riccati::solve(&game, &CancelToken::new()).expect("an equilibrium");
        let problem = Problem::new(&game, equilibrium.node(0), &CancelToken::new()).expect("memory");
        Self { game, equilibrium, problem }
    }

    /// Θ by its terms, each a sum over the printed matrices.
    fn theta(&self, g: &[f64]) -> f64 {
        self.problem.weigh(&self.problem.terms(self.equilibrium.node(0), g, &CancelToken::new()).expect("memory"))
    }

    /// GᵀRG.
    fn square(&self, g: &[f64]) -> DMatrix<f64> {
        let g = DMatrix::from_row_slice(self.problem.rows(), self.problem.size(), g);
        let r = DMatrix::from_diagonal(&DVector::from_vec(self.game.constrained_control_weights()));
        g.transpose() * r * g
    }

    /// What a row may be: a basis of its gains, by rows of m × N.
    fn basis(&self, topology: &Topology) -> Vec<Vec<f64>> {
        let (m, n) = (self.problem.rows(), self.problem.size());
        let mut basis = Vec::new();
        for i in 0..m {
            for j in (0..n).filter(|&j| topology.sees(i, j)) {
                let mut direction = vec![0.0; m * n];
                if j != i {
                    direction[i * n + i] = -1.0;
                }
                direction[i * n + j] = 1.0;
                basis.push(direction);
            }
        }
        basis
    }

    fn solve(&self, topology: &Topology, options: Options) -> Gains {
        Synthesizer::new().solve(&self.problem, topology, options).expect("memory")
    }
}

fn moved(g: &[f64], direction: &[f64], by: f64) -> Vec<f64> {
    g.iter().zip(direction).map(|(g, d)| g + by * d).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn networks(instant: &Instant, count: usize, seed: u64) -> Vec<Topology> {
    let (m, n) = (instant.problem.rows(), instant.problem.size());
    let mut numbers = Numbers(seed);
    let mut draw = || {
        let bits: Vec<bool> = (0..m * n).map(|_| numbers.next() > 0.0).collect();
        Topology::from_fn(m, n, |i, j| bits[i * n + j])
    };
    (0..count).map(|_| draw()).collect()
}

fn instants() -> impl Iterator<Item = Instant> {
    [(Interaction::I1, 3), (Interaction::I2, 2), (Interaction::I1, 2), (Interaction::I2, 3)]
        .into_iter()
        .map(|(interaction, n)| Instant::new(interaction, n))
}

/// No iteration at all leaves the canonical start: in the space of what is seen, and F less it at right angles to that.
#[test]
fn the_canonical_start_is_the_orthogonal_projection() {
    for instant in instants() {
        for topology in networks(&instant, 20, 1) {
            let options = Options { method: Method::Descent, max_iterations: 0 };
            let start = instant.solve(&topology, options).rows;
            let basis = instant.basis(&topology);
            let left = moved(instant.problem.fne(), &start, -1.0);
            assert!(basis.iter().all(|b| dot(b, &left).abs() < 1e-13), "{topology:?}");
            // Within: the projection of the start itself, by least squares, is the start.
            if basis.is_empty() {
                assert!(start.iter().all(|&g| g == 0.0));
                continue;
            }
            let columns = DMatrix::from_fn(start.len(), basis.len(), |e, v| basis[v][e]);
            let goal = DVector::from_vec(start);
            let normal = (columns.transpose() * &columns).cholesky().expect("independent directions");
            let again = &columns * normal.solve(&(columns.transpose() * &goal));
            assert!((again - goal).amax() < 1e-13, "{topology:?}");
        }
    }
}

/// Both methods end where no difference of Θ along any direction says that it falls, and at most at the start's Θ.
#[test]
fn both_methods_end_where_theta_is_stationary() {
    for instant in instants() {
        for topology in networks(&instant, 12, 2) {
            let start = instant.solve(&topology, Options { method: Method::Descent, max_iterations: 0 });
            for method in [Method::Newton, Method::Descent] {
                let found = instant.solve(&topology, Options::new(method));
                assert_eq!(found.status, Status::Converged);
                let theta = instant.theta(&found.rows);
                assert!((found.theta - theta).abs() <= 1e-12 * (1.0 + theta));
                assert!(theta <= start.theta * (1.0 + 1e-12));
                for b in instant.basis(&topology) {
                    let h = 1e-5;
                    let slope = instant.theta(&moved(&found.rows, &b, h)) - instant.theta(&moved(&found.rows, &b, -h));
                    assert!((slope / (2.0 * h)).abs() < 1e-7, "{method:?} {slope}");
                }
            }
        }
    }
}

/// Θ with ‖X‖² replaced by its tangent at a critical point is a quadratic function below Θ. A point is certified exactly
/// where that function, by its own second differences, is nowhere concave.
#[test]
fn a_certificate_is_a_lower_bound_that_is_convex() {
    let mut certified = [0, 0];
    for instant in instants() {
        for topology in networks(&instant, 40, 3) {
            let found = instant.solve(&topology, Options::default());
            let (basis, gamma) = (instant.basis(&topology), instant.game.weights().gamma[0]);
            if basis.is_empty() {
                continue;
            }
            let goal = instant.square(instant.problem.fne());
            let x = instant.square(&found.rows) - &goal;
            let bound = |g: &[f64]| {
                let terms = instant.problem.terms(instant.equilibrium.node(0), g, &CancelToken::new()).expect("memory");
                let tangent = 2.0 * x.dot(&(instant.square(g) - &goal)) - x.norm_squared();
                instant.problem.weigh(&terms) - gamma * terms[0] + gamma * tangent
            };
            let at =
                |a: f64, i: usize, b: f64, j: usize| bound(&moved(&moved(&found.rows, &basis[i], a), &basis[j], b));
            let form = DMatrix::from_fn(basis.len(), basis.len(), |i, j| {
                0.25 * (at(1.0, i, 1.0, j) - at(1.0, i, -1.0, j) - at(-1.0, i, 1.0, j) + at(-1.0, i, -1.0, j))
            });
            let values = form.symmetric_eigenvalues();
            let least = values.min() / values.amax();
            if least.abs() > 1e-9 {
                assert_eq!(found.certified, least > 0.0, "{topology:?} {least}");
                certified[usize::from(found.certified)] += 1;
            }
        }
    }
    assert!(certified[0] >= 5 && certified[1] >= 50, "too few of one kind: {certified:?}");
}

/// Nothing is below Θ = 0. Where only ‖ΔQ_τ‖² counts and P_τ has rank one the certificate's form is singular at that
/// point, with pivots that are zero up to rounding, and proves it all the same.
#[test]
fn a_singular_certificate_proves_what_is_lowest() {
    for (n, seed) in (1..7).flat_map(|n| (1..9).map(move |seed| (n, seed))) {
        let mut numbers = Numbers(seed);
        let size = n + 1;
        let draw = numbers.vector(size * size);
        let own: Vec<f64> = (0..size * size).map(|e| draw[e] + draw[e % size * size + e / size]).collect();
        let v = numbers.vector(size);
        let tau: Vec<f64> = (0..size * size).map(|e| v[e / size] * v[e % size]).collect();
        let p: Vec<f64> = [own, tau, vec![0.0; size * size]].concat();
        let r = numbers.vector(n).iter().map(|x| x.exp()).collect();
        let problem =
            Problem::from_parts(Interaction::I1, r, vec![0.7, 0.4, 0.0, 0.0], &p, &CancelToken::new()).expect("memory");
        let found =
            Synthesizer::new().solve(&problem, &Topology::complete(n, size), Options::default()).expect("memory");
        assert!(found.theta < 1e-24 && found.certified, "{n} {seed}: {}", found.theta);
    }
}

/// K_i on differences and on z_i moves player i as its row on z does.
#[test]
fn the_papers_gains_give_the_same_velocities() {
    let mut numbers = Numbers(4);
    for instant in instants() {
        let n = instant.problem.size();
        for topology in networks(&instant, 10, 5) {
            let found = instant.solve(&topology, Options::default());
            let (k, z) = (found.paper_gains(&topology), numbers.vector(n));
            for i in 0..instant.problem.rows() {
                let (row, k) = (&found.rows[i * n..(i + 1) * n], &k[i * n..(i + 1) * n]);
                let paper: f64 = (0..n).map(|j| k[j] * if j == i { z[i] } else { z[j] - z[i] }).sum();
                assert!((dot(row, &z) - paper).abs() < 1e-13);
                assert!((0..n).all(|j| topology.sees(i, j) || k[j] == 0.0));
            }
        }
    }
}

/// Θ times a number has the same relative gradient (times a power of four, to the bit), and no iteration is too few but
/// where the start is stationary.
#[test]
fn what_is_reached_is_relative_and_says_why_it_ended() {
    for instant in instants() {
        let weights = instant.game.constrained_control_weights();
        let gamma = instant.game.weights().gamma.iter().map(|g| 1024.0 * g).collect();
        let scaled = Problem::from_parts(
            instant.game.interaction(),
            weights,
            gamma,
            instant.equilibrium.node(0),
            &CancelToken::new(),
        )
        .expect("memory");
        let (mut stopped, options) = (0, Options { method: Method::Descent, max_iterations: 0 });
        for topology in networks(&instant, 12, 6) {
            let one = instant.solve(&topology, options);
            let other = Synthesizer::new().solve(&scaled, &topology, options).expect("memory");
            assert_eq!((one.gradient_norm, one.status), (other.gradient_norm, other.status), "{topology:?}");
            let stationary = one.gradient_norm <= 1e-10;
            assert_eq!(one.status, if stationary { Status::Converged } else { Status::IterationLimit }, "{topology:?}");
            stopped += usize::from(!stationary);
        }
        assert!(stopped > 5, "{stopped}");
    }
}

/// One defender that sees the attacker alone has one gain g, and Θ is a polynomial in it. The first trial of the paper's
/// descent is a tenth of g away. Games in which Θ there is what it was are found by bisection: such a step does not pay,
/// and a shorter one is to be taken, with a decrease in proportion to slope and length.
#[test]
fn the_papers_descent_takes_no_step_that_does_not_pay() {
    let mut numbers = Numbers(7);
    let (topology, mut met) = (Topology::from_key(1, 2, 1), 0);
    for _ in 0..40 {
        let p = numbers.vector(12);
        let symmetric: Vec<f64> = (0..12).map(|e| p[e] + p[e / 4 * 4 + [0, 2, 1, 3][e % 4]]).collect();
        // By the weight of ‖ΔQ_τ‖²: the first trial less the start, and the rise of Θ to there; where the descent goes
        // from the start, the fall of Θ to there; and the slope.
        let of = |share: f64| {
            let gamma = vec![1.0, share, 0.1, 0.1];
            let problem = Problem::from_parts(Interaction::I1, vec![1.0], gamma, &symmetric, &CancelToken::new())
                .expect("memory");
            let after = |iterations| {
                let options = Options { method: Method::Descent, max_iterations: iterations };
                Synthesizer::new().solve(&problem, &topology, options).expect("memory").rows[0]
            };
            let theta =
                |g: f64| problem.weigh(&problem.terms(&symmetric, &[g, 0.0], &CancelToken::new()).expect("memory"));
            let (g, next) = (after(0), after(1));
            let slope = (theta(g + 1e-5) - theta(g - 1e-5)) / 2e-5;
            let trial = -0.1 * g.abs() * slope.signum();
            ((trial, theta(g + trial) - theta(g)), (next - g, theta(g) - theta(next)), slope.abs())
        };
        let (mut low, mut high) = (1e-3, 1e3);
        if of(low).0.1 <= 0.0 || of(high).0.1 >= 0.0 {
            continue;
        }
        for _ in 0..80 {
            let middle = (low * high).sqrt();
            *(if of(middle).0.1 > 0.0 { &mut low } else { &mut high }) = middle;
        }
        let ((trial, rise), (step, fall), slope) = of(high);
        assert!(rise.abs() < 1e-9 * slope * trial.abs(), "{rise}");
        assert!(step / trial < 0.6 && fall >= 1e-4 * slope * step.abs(), "{trial} {step} {fall}");
        met += 1;
    }
    assert!(met >= 5, "{met}");
}

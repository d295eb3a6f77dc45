//! The start that is said to have won, against descents in its kind of gains alone.

use super::super::newton::{Limits, Owner, Tasks};
use super::super::search::{
    BASIN, Candidate, DOUBLED_ITERATIONS, Dispatcher, Kind, LONGEST_STEP, canonical, far_start, variables,
};
use super::*;
use crate::game::Criterion;

/// The lowest Θ that descents in complex gains, or in stacked ones, lead to from the far start.
fn alone(problem: &Problem, topology: &Topology, complex: bool) -> f64 {
    let (dispatcher, tasks) = (&mut Dispatcher::default(), &mut Tasks::default());
    let mut start = vec![0.0; problem.rows * problem.size];
    canonical(problem, topology, &mut start);
    let candidate = Candidate::new(variables(topology, Criterion::Paper).expect("memory"), start, problem.size, false)
        .expect("memory");
    let owners = [Owner { variables: &candidate.variables, incumbent: None }];
    let fine = Limits { iterations: 2_000, tolerance: 1e-12, acceptable: 1e-10, longest: f64::INFINITY };
    let scale = problem.theta.double.scale.fne;
    tasks.clear(candidate.initial.len(), 1);
    tasks.add(0, false, 0.0).expect("memory").copy_from_slice(&candidate.initial);
    dispatcher.run_sized::<0>(Kind::Real, &problem.theta, tasks, &owners, fine).expect("memory");
    let relative_to = tasks.reached(0).scale;

    tasks.clear(candidate.initial.len(), 2);
    far_start(&candidate, scale, tasks.add(0, complex, relative_to).expect("memory"));
    let coarse =
        Limits { iterations: DOUBLED_ITERATIONS, tolerance: BASIN, acceptable: BASIN, longest: LONGEST_STEP * scale };
    dispatcher.run_sized::<0>(Kind::Doubled, &problem.theta, tasks, &owners, coarse).expect("memory");
    let doubled = tasks.point(0).to_vec();
    tasks.clear(candidate.initial.len(), 1);
    let (a, b) = doubled.split_at(candidate.initial.len());
    for sign in [0.0, 1.0, -1.0] {
        for (x, (a, b)) in tasks.add(0, false, 0.0).expect("memory").iter_mut().zip(a.iter().zip(b)) {
            *x = a + sign * b;
        }
    }
    dispatcher.run_sized::<0>(Kind::Real, &problem.theta, tasks, &owners, fine).expect("memory");
    (0..3).map(|task| tasks.reached(task).value).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_start_that_won_is_the_one_that_leads_there() {
    let mut won = [0, 0];
    let (problem, _, _) = sample(Interaction::I2);
    let (m, n) = (problem.rows(), problem.size());
    for key in 0..1u64 << (m * n) {
        let topology = Topology::from_key(m, n, key);
        let found = Synthesizer::new().solve(&problem, &topology, Options::default()).expect("memory");
        let reaches =
            |complex| problem.in_scale_of_gamma(alone(&problem, &topology, complex)) <= found.theta * (1.0 + 1e-8);
        match found.start {
            Start::Complex => assert!(reaches(true), "{topology:?}"),
            Start::Stacked => assert!(reaches(false) && !reaches(true), "{topology:?}"),
            Start::Canonical | Start::Reversed | Start::Between => continue,
        }
        won[usize::from(found.start == Start::Stacked)] += 1;
    }
    assert!(won[0] >= 10 && won[1] >= 3, "{won:?}");
}

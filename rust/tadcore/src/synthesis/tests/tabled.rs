//! Θ by tables of one network's unknowns, against Θ over all gains.

use super::super::newton::{Layout, Objective, packed};
use super::super::search::{canonical, variables};
use super::super::theta::{RealGains, Scratch, Tabled};
use super::*;
use crate::cancel::CancelToken;
use crate::game::{Criterion, bank};
use crate::riccati;

/// Some point: the start, moved along every variable.
fn moved(start: &[f64], layout: &Layout<f64>, by: f64) -> Vec<f64> {
    let mut g = start.to_vec();
    let step: Vec<f64> = (0..layout.len()).map(|v| by * (1.7 * v as f64 + by).sin()).collect();
    layout.advance(&mut g, &step);
    g
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-11 * (1.0 + a.abs().max(b.abs()))
}

/// Value, gradient and Hessian at several points; the same for two rows alone, and beside a point.
#[test]
fn tables_hold_theta() {
    for interaction in [Interaction::I1, Interaction::I2] {
        let game = bank::varied_game(interaction, 9, 0.05, 0.05).expect("a game");
        let cancel = CancelToken::new();
        let equilibrium = riccati::solve(&game, &cancel).expect("an equilibrium");
        let problem = Problem::new(&game, equilibrium.node(0), &cancel).expect("memory");
        let (m, n) = (problem.rows(), problem.size());
        // Rows with and without the attacker, one that sees no one and one that sees all.
        let sees = |i: usize, j: usize| i != 4 && (i == 2 || (5 * i + 3 * j + i * j) % 4 == 1);
        let topology = Topology::from_fn(m, n, sees);
        let mut start = vec![0.0; m * n];
        canonical(&problem, &topology, &mut start);
        let variables = variables(&topology, Criterion::Paper).expect("memory");
        let mut layout = Layout::default();
        layout.begin(m * n, 1);
        layout.place(0, &variables);
        layout.list();
        let d = layout.len();
        let mut tabled = Tabled::new(&problem, &variables, &start, &cancel).expect("memory");
        let mut all = RealGains::<f64, 0>::new(&problem.theta.double, None).expect("memory");
        for by in [0.0, 0.3, -1.1] {
            let g = moved(&start, &layout, by);
            assert!(close(tabled.value(&g), all.value(&g)), "{interaction:?} {by}");
            let (mut ours, mut theirs) = (vec![0.0; m * n], vec![0.0; m * n]);
            tabled.gradient(&g, &mut ours);
            all.gradient(&g, &mut theirs);
            let (mut of_ours, mut of_theirs) = (vec![0.0; d], vec![0.0; d]);
            layout.restrict(&ours, &mut of_ours);
            layout.restrict(&theirs, &mut of_theirs);
            assert!(of_ours.iter().zip(&of_theirs).all(|(a, b)| close(*a, *b)), "{interaction:?} {by}");
            let (mut row, mut h, mut other) = (vec![0.0; m * n], vec![0.0; packed(d)], vec![0.0; packed(d)]);
            tabled.keep(true);
            tabled.prepare(&g);
            layout.restrict_form(&tabled, &g, &mut row, &mut h, None);
            all.keep(true);
            all.prepare(&g);
            layout.restrict_form(&all, &g, &mut row, &mut other, None);
            assert!(h.iter().zip(&other).all(|(a, b)| close(*a, *b)), "{interaction:?} {by}");
            let (a, b) = (tabled.gradient_scale(&g), all.gradient_scale(&g));
            assert!((a / b - 1.0).abs() < 1e-10, "{a} {b}");
        }

        let g = moved(&start, &layout, 0.4);
        let base = tabled.base(&g);
        let rows = [1, 5];
        let mut other = g.clone();
        for &at in rows.iter().flat_map(|&row| tabled.support_of(row)) {
            other[at] = -0.3 * g[at];
        }
        let expected = all.value(&other);
        assert!(close(tabled.beside(&base, Some((&other, &rows))), expected));
        tabled.beside(&base, None);
        let mut part = tabled.of_rows(&rows, Scratch::new(n, 2).expect("memory")).expect("memory");
        let mut alone = vec![0.0; 2 * n];
        for (i, &row) in rows.iter().enumerate() {
            tabled.support_of(row).iter().for_each(|&at| alone[i * n + at % n] = other[at]);
        }
        assert!(close(part.value(&alone), expected));
        let (mut slope, mut whole) = (vec![0.0; 2 * n], vec![0.0; m * n]);
        part.gradient(&alone, &mut slope);
        all.gradient(&other, &mut whole);
        for (i, &row) in rows.iter().enumerate() {
            assert!(tabled.support_of(row).iter().all(|&at| close(slope[i * n + at % n], whole[at])));
        }
        // What is given back serves other rows.
        tabled.beside(&base, None);
        let mut next = tabled.of_rows(&[0], part.recycle()).expect("memory");
        let mut of_next = vec![0.0; n];
        tabled.support_of(0).iter().for_each(|&at| of_next[at % n] = g[at]);
        assert!(close(next.value(&of_next), all.value(&g)));
    }
}

//! Factors of a matrix, in every width and by the library.

use tadcore_kernels::cancel::CancelToken;
use tadcore_kernels::simd::Width;
use tadcore_kernels::synthesis::newton::{
    BLOCK, BLOCKED_SIZE, Backend, GROUP, LIBRARY_SIZE, Layout, Variable, back, factorise, forward,
};

fn layout(d: usize) -> Layout<f64> {
    let variables: Vec<Variable> = (0..d).map(|entry| Variable { entry, own: 0, relative: false }).collect();
    let mut layout = Layout::default();
    layout.begin(d, 1);
    layout.place(0, &variables);
    layout.list();
    layout
}

/// The packed lower triangle of a matrix, filled up with empty rows.
fn lower(d: usize, entry: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let full = d.next_multiple_of(GROUP);
    (0..full).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|(i, j)| if i < d { entry(i, j) } else { 0.0 }).collect()
}

fn backends() -> Vec<Backend<'static>> {
    let alone = Width::all().into_iter().map(|width| Backend { library: false, width, cancel: None });
    alone.chain([Backend { library: true, width: Width::Baseline, cancel: None }]).collect()
}

#[test]
fn every_width_gives_the_same_factor() {
    for used in [1, 4, 7, 9, 12, 31, 58] {
        let (h, layout) =
            (lower(used, |i, j| ((i * 7 + j * 3) as f64).sin() + if i == j { 40.0 } else { 0.0 }), layout(used));
        let factors = Width::all().into_iter().map(|width| {
            let mut f = vec![0.0; layout.len() * layout.len()];
            let answer = factorise(&h, 0.125, &layout, Backend { library: false, width, cancel: None }, &mut f);
            (answer, f)
        });
        let factors: Vec<_> = factors.collect();
        assert!(factors.iter().all(|found| *found == factors[0]), "{used}");
    }
}

#[test]
fn both_factorisations_solve_the_same_system() {
    for (d, damping) in [1, 2, 5, 12, 95, 128, LIBRARY_SIZE, LIBRARY_SIZE + 2, BLOCKED_SIZE + BLOCK + 3]
        .into_iter()
        .flat_map(|d| [(d, 0.25), (d, 0.0)])
    {
        let entry = |i: usize, j: usize| 1.0 / (1.0 + (i - j) as f64) + if i == j { 2.0 } else { 0.0 };
        let damped = |i: usize, j: usize| entry(i.max(j), i.min(j)) + if i == j { damping } else { 0.0 };
        let (h, layout) = (lower(d, entry), layout(d));
        let full = layout.len();
        let mut b: Vec<f64> = (0..d).map(|i| (i as f64 + 1.0).sin()).collect();
        b.resize(full, 0.0);
        // Registers of one number without a fused product take half a minute for the large ones.
        for backend in backends().into_iter().filter(|b| d < LIBRARY_SIZE || b.library || b.width != Width::Baseline) {
            let (mut f, mut x) = (vec![f64::NAN; full * full], b.clone());
            assert!(factorise(&h, damping, &layout, backend, &mut f).0);
            let form = forward(&f, full, &mut x);
            back(&f, full, &mut x);
            for i in 0..d {
                let sum: f64 = (0..d).map(|j| damped(i, j) * x[j]).sum();
                assert!((sum - b[i]).abs() < 1e-13 * d as f64, "{d} {i}");
            }
            let product: f64 = b.iter().zip(&x).map(|(b, x)| b * x).sum();
            assert!((form - product).abs() < 1e-13 * d as f64, "{d}");
        }
    }
}

#[test]
fn an_indefinite_matrix_is_refused() {
    for (d, backend) in
        [2, 7, LIBRARY_SIZE].into_iter().flat_map(|d| backends().into_iter().map(move |backend| (d, backend)))
    {
        for second in [2.0, 1.0] {
            // Two pairs of rows, each with a pivot of 1 − x²; the first counts.
            let h = lower(d, |i, j| match (i, j) {
                (1, 0) => second,
                (3, 2) => 3.0,
                _ => f64::from(u8::from(i == j)),
            });
            let layout = layout(d);
            let mut f = vec![0.0; layout.len() * layout.len()];
            let (definite, lack) = factorise(&h, 0.0, &layout, backend, &mut f);
            assert!(!definite, "{d} {second}");
            assert!(backend.library && d >= LIBRARY_SIZE || lack == second * second - 1.0, "{d} {lack}");
        }
    }
}

#[test]
fn damping_lifts_a_negative_matrix() {
    for (d, backend) in
        [2, 7, LIBRARY_SIZE].into_iter().flat_map(|d| backends().into_iter().map(move |backend| (d, backend)))
    {
        let (h, layout) = (lower(d, |i, j| if i == j { -0.5 } else { 0.0 }), layout(d));
        let mut f = vec![0.0; layout.len() * layout.len()];
        assert!(!factorise(&h, 0.25, &layout, backend, &mut f).0, "{d}");
        assert!(factorise(&h, 1.0, &layout, backend, &mut f).0, "{d}");
    }
}

/// By blocks as by rows, also where the matrix is indefinite beyond the first block; a raised token is no factor.
#[test]
fn a_factor_by_blocks_can_be_stopped() {
    let d = BLOCKED_SIZE + 4;
    let cancel = CancelToken::new();
    let backend = Backend { library: true, width: Width::Baseline, cancel: Some(&cancel) };
    let (layout, mut f) = (layout(d), vec![0.0; d * d]);
    let matrix = |last: f64| {
        lower(d, |i, j| {
            if i != j {
                0.0
            } else if i == 2 * BLOCK {
                last
            } else {
                2.0
            }
        })
    };
    assert!(factorise(&matrix(1.0), 0.0, &layout, backend, &mut f).0);
    assert_eq!((f[0], f[2 * BLOCK * (d + 1)]), (0.5, 1.0));
    assert!(!factorise(&matrix(-1.0), 0.0, &layout, backend, &mut f).0);
    cancel.cancel();
    assert!(!factorise(&matrix(1.0), 0.0, &layout, backend, &mut f).0);
}

//! Variables as directions.

use tadcore_kernels::synthesis::newton::{Form, Layout, Slot, Variable, packed};

/// A quadratic form by its matrix.
struct Matrix(Vec<Vec<f64>>);

impl Form<f64> for Matrix {
    fn row(&self, _: &[f64], v: &Slot<f64>, out: &mut [f64]) {
        for (b, out) in out.iter_mut().enumerate() {
            *out = self.0[v.entry][b] - v.relative * self.0[v.own][b];
        }
    }
}

/// Vectors, forms and steps on the variables of two copies of 2 × 3 gains, against the directions as columns.
#[test]
fn variables_are_directions() {
    let own = |entry: usize| entry / 3 * 3 + entry / 3;
    let variable = |(entry, relative)| Variable { entry, own: own(entry), relative };
    let former: Vec<Variable> = [(0, false), (2, true), (5, true)].map(variable).to_vec();
    let now: Vec<Variable> = [(1, true), (3, false), (4, false), (5, false)].map(variable).to_vec();
    let mut layout = Layout::default();
    layout.begin(6, 2);
    layout.place(0, &former);
    layout.place(0, &now[..3]);
    layout.list();
    assert_eq!((layout.used(), layout.len()), (6, 8));
    layout.place(0, &now);
    layout.list();
    assert_eq!((layout.used(), layout.len()), (8, 8));
    layout.place(0, &now[..3]);
    layout.list();
    let directions: Vec<Vec<f64>> = [0, 6]
        .into_iter()
        .flat_map(|copy| {
            now[..3].iter().map(move |v| {
                let mut direction = vec![0.0; 12];
                direction[copy + v.entry] = 1.0;
                if v.relative {
                    direction[copy + v.own] = -1.0;
                }
                direction
            })
        })
        .collect();
    let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    // Small integers: every sum is exact.
    let slope: Vec<f64> = (0..12).map(|e| f64::from(e * e % 7 - 3)).collect();
    let form = Matrix((0..12).map(|a| (0..12).map(|b| f64::from((a * b + a + b) % 11 - 5)).collect()).collect());

    let mut restricted = vec![f64::NAN; 8];
    layout.restrict(&slope, &mut restricted);
    let mut expected: Vec<f64> = directions.iter().map(|v| product(v, &slope)).collect();
    expected.resize(8, 0.0);
    assert_eq!(restricted, expected);

    let step: Vec<f64> = (1..9).map(f64::from).collect();
    let mut moved = slope.clone();
    layout.advance(&mut moved, &step);
    let by = |e: usize| -> f64 { directions.iter().zip(&step).map(|(v, x)| v[e] * x).sum() };
    assert_eq!(moved, (0..12).map(|e| slope[e] + by(e)).collect::<Vec<f64>>());

    let mut lower = vec![f64::NAN; packed(8)];
    layout.restrict_form(&form, &slope, &mut [0.0; 12], &mut lower, None);
    let entry =
        |a: usize, b: usize| -> f64 { (0..12).map(|e| directions[a][e] * product(&form.0[e], &directions[b])).sum() };
    let mut rows = lower.iter();
    for a in 0..8 {
        for b in 0..=a {
            assert_eq!(rows.next(), Some(&if a < 6 { entry(a, b) } else { 0.0 }), "{a} {b}");
        }
    }
    assert_eq!(layout.largest(&lower), (0..6).map(|a| entry(a, a).abs()).fold(0.0, f64::max));
}

//! The states of all starts of a cell at one instant, enclosed: z = c + α s + A r + β on either axis.
//!
//! | symbol | here | meaning |
//! |---|---|---|
//! | c | `centre` | the state of the start in the middle, an axis each |
//! | α | `slope` | how much of the start's offset s, ‖s‖ ≤ h on each axis, is in each row: the same on both axes |
//! | A, ρ | `frame`, `reach` | what no offset explains: r in the box of half-widths ρ, in a frame that turns with the motion (Lohner) |
//! | b | `rest` | ‖β‖ ≤ b, row by row: what was added since the frame was last made orthogonal |
//! | E | `error` | Σ ‖A‖ρ + b, row by row |
//!
//! Every bound is rounded outward: docs/theory/maps.md derives the term that a step adds.

/// Relative rounding of a sum of N products and what is done with it, outward: 2 (N + 2) u, with u = 2⁻⁵³ the unit.
pub(super) fn unit(size: usize) -> f64 {
    (size as f64 + 2.0) * f64::EPSILON
}

/// An upper bound of a number that at most a few dozen roundings made from non-negative ones.
#[inline(always)]
pub(super) fn up(x: f64, unit: f64) -> f64 {
    (x * (1.0 + 4.0 * unit)).next_up()
}

/// Half-widths on both axes.
pub(super) type Half = [f64; 2];

/// A set of states; columns of `rows` numbers, whole vectors of four, as the table has them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Enclosure {
    pub(super) size: usize,
    pub(super) rows: usize,
    pub(super) centre: [Vec<f64>; 2],
    pub(super) slope: Vec<f64>,
    pub(super) frame: Vec<f64>,
    pub(super) reach: [Vec<f64>; 2],
    pub(super) rest: [Vec<f64>; 2],
    /// As [`Enclosure::measure`] left it.
    pub(super) error: [Vec<f64>; 2],
}

/// Σ_j column_j · v_j for columns of `out.len()` numbers.
#[inline(always)]
fn product(columns: &[f64], v: &[f64], out: &mut [f64]) {
    let rows = out.len();
    for (q, out) in out.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        let mut sum = [0.0; 4];
        for (column, &x) in columns.chunks_exact(rows).zip(v) {
            let column = &column.as_chunks::<4>().0[q];
            for l in 0..4 {
                sum[l] += column[l] * x;
            }
        }
        *out = sum;
    }
}

/// Σ_j ‖column_j‖ · v_j.
#[inline(always)]
fn absolute(columns: &[f64], v: &[f64], out: &mut [f64]) {
    let rows = out.len();
    for (q, out) in out.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        let mut sum = [0.0; 4];
        for (column, &x) in columns.chunks_exact(rows).zip(v) {
            let column = &column.as_chunks::<4>().0[q];
            for l in 0..4 {
                sum[l] += column[l].abs() * x;
            }
        }
        *out = sum;
    }
}

impl Enclosure {
    /// Room for N = `size` rows.
    pub(super) fn new(size: usize, rows: usize) -> Self {
        let row = || [vec![0.0; rows], vec![0.0; rows]];
        let mut frame = vec![0.0; size * rows];
        (0..size).for_each(|l| frame[l * rows + l] = 1.0);
        let reach = [vec![0.0; size], vec![0.0; size]];
        Self { size, rows, centre: row(), slope: vec![0.0; rows], frame, reach, rest: row(), error: row() }
    }

    /// Of a cell at the first instant: z is the rounded difference of positions, and so is c.
    pub(super) fn start(size: usize, rows: usize, centre: [&[f64]; 2], slope: &[f64], half: Half) -> Self {
        let mut new = Self::new(size, rows);
        new.slope[..size].copy_from_slice(slope);
        for x in 0..2 {
            new.centre[x][..size].copy_from_slice(centre[x]);
            for i in 0..size {
                let most = centre[x][i].abs() + slope[i].abs() * half[x];
                new.rest[x][i] = up(2.0 * f64::EPSILON * most, f64::EPSILON);
            }
        }
        new.measure();
        new
    }

    /// The part of it whose starts lie around an `offset` from its middle.
    pub(super) fn part(&self, offset: [f64; 2]) -> Self {
        let mut part = self.clone();
        let unit = f64::EPSILON;
        for x in 0..2 {
            for i in 0..self.size {
                let by = self.slope[i] * offset[x];
                part.centre[x][i] += by;
                let rounded = 4.0 * unit * (by.abs() + part.centre[x][i].abs());
                part.rest[x][i] = up(part.rest[x][i] + rounded + f64::MIN_POSITIVE, 8.0 * unit);
            }
        }
        part.measure();
        part
    }

    /// Writes E, which everything else here reads.
    pub(super) fn measure(&mut self) {
        let unit = unit(self.size);
        for x in 0..2 {
            absolute(&self.frame, &self.reach[x], &mut self.error[x]);
            for (error, rest) in self.error[x].iter_mut().zip(&self.rest[x]) {
                *error = up(*error + rest, unit);
            }
        }
    }

    /// How far e_i − e_j may be from 0, more closely than E_i + E_j.
    pub(super) fn apart(&self, i: usize, j: usize, x: usize) -> f64 {
        let columns = self.frame.chunks_exact(self.rows);
        let turned: f64 = columns.zip(&self.reach[x]).map(|(column, r)| (column[i] - column[j]).abs() * r).sum();
        up(turned + self.rest[x][i] + self.rest[x][j], unit(self.size))
    }

    /// Writes the states after a step with the matrix `m` (columns of `rows`) to `out`: what the engine computes, and what
    /// exact arithmetic would.
    pub(super) fn step(&self, m: &[f64], half: Half, out: &mut Self) {
        let unit = unit(self.size);
        product(m, &self.slope[..self.size], &mut out.slope);
        for (from, to) in self.frame.chunks_exact(self.rows).zip(out.frame.chunks_exact_mut(self.rows)) {
            product(m, &from[..self.size], to);
        }
        let mut moved = [0.0; 8];
        let mut large = Vec::new();
        let moved: &mut [f64] = if self.rows <= 8 {
            &mut moved[..self.rows]
        } else {
            large.resize(self.rows, 0.0);
            &mut large
        };
        for x in 0..2 {
            product(m, &self.centre[x][..self.size], &mut out.centre[x]);
            out.reach[x].copy_from_slice(&self.reach[x]);
            // Of what is rounded in the engine's step, in c, in α s and in A r, each bounded by ‖M‖ times a part of ‖z‖.
            for i in 0..self.size {
                let most = self.centre[x][i].abs() + self.slope[i].abs() * half[x] + self.error[x][i];
                moved[i] = self.rest[x][i] + unit * most;
            }
            absolute(m, &moved[..self.size], &mut out.rest[x]);
            let underflow = f64::MIN_POSITIVE * (1.0 + half[x] + self.reach[x].iter().sum::<f64>());
            for rest in &mut out.rest[x][..self.size] {
                *rest = up(*rest + underflow, unit);
            }
        }
        out.measure();
    }

    /// Puts b into the frame, made orthogonal.
    pub(super) fn turn(&mut self) {
        self.turned();
        self.measure();
    }

    /// The same without E; how far the frame is from orthogonal: d / (1 − d).
    fn turned(&mut self) -> f64 {
        let mut frame = self.orthogonal();
        let mut slack = slack(&frame, self.size, self.rows);
        if slack.is_nan() || slack >= 0.5 {
            frame.fill(0.0);
            (0..self.size).for_each(|l| frame[l * self.rows + l] = 1.0);
            slack = 0.0;
        }
        let slack = up(slack / (1.0 - slack), f64::EPSILON);
        self.reach = self.in_frame(&frame, slack);
        self.rest.iter_mut().for_each(|rest| rest.fill(0.0));
        self.frame = frame;
        slack
    }

    /// The frame made orthogonal, longest columns first (Gram and Schmidt, twice).
    fn orthogonal(&self) -> Vec<f64> {
        let (n, rows) = (self.size, self.rows);
        let length = |l: usize| -> f64 {
            let reach = self.reach[0][l] + self.reach[1][l];
            self.frame[l * rows..][..n].iter().map(|a| a * a).sum::<f64>() * reach * reach
        };
        let lengths: Vec<f64> = (0..n).map(length).collect();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]));
        let mut q = vec![0.0; n * rows];
        for (to, &from) in order.iter().enumerate() {
            let (done, rest) = q.split_at_mut(to * rows);
            let column = &mut rest[..n];
            column.copy_from_slice(&self.frame[from * rows..][..n]);
            for _ in 0..2 {
                for other in done.chunks_exact(rows) {
                    let part: f64 = other.iter().zip(&*column).map(|(a, b)| a * b).sum();
                    column.iter_mut().zip(other).for_each(|(x, a)| *x -= part * a);
                }
            }
            let length = column.iter().map(|a| a * a).sum::<f64>().sqrt();
            column.iter_mut().for_each(|x| *x /= length);
        }
        q
    }

    /// The half-widths of its errors in another frame: A r + β = Q (Q⁻¹ A r + Q⁻¹ β), with
    /// ‖Q⁻¹ v‖ ≤ ‖Qᵀv‖ + d / (1 − d) · max ‖Qᵀv‖ where d is the largest row of ‖QᵀQ − I‖.
    fn in_frame(&self, q: &[f64], slack: f64) -> [Vec<f64>; 2] {
        let (n, rows, unit) = (self.size, self.rows, unit(self.size));
        let mut reach = [vec![0.0; n], vec![0.0; n]];
        for (l, column) in q.chunks_exact(rows).enumerate() {
            for (k, of) in self.frame.chunks_exact(rows).enumerate() {
                let (sum, most) = dot(&column[..n], &of[..n]);
                let entry = up(sum.abs() + unit * most + f64::MIN_POSITIVE, unit);
                for x in 0..2 {
                    reach[x][l] += entry * self.reach[x][k];
                }
            }
            for x in 0..2 {
                reach[x][l] += column[..n].iter().zip(&self.rest[x]).map(|(a, b)| a.abs() * b).sum::<f64>();
            }
        }
        for reach in &mut reach {
            let most = reach.iter().fold(0.0, |most, &r| larger(most, r));
            for r in reach.iter_mut() {
                *r = up(*r + slack * most + f64::MIN_POSITIVE, 2.0 * unit);
            }
        }
        reach
    }

    /// How far the states of two enclosures lie apart, row by row at most, beyond their errors: c and α s.
    pub(super) fn gap(&self, other: &Self, half: Half) -> f64 {
        let mut gap: f64 = 0.0;
        for x in 0..2 {
            for i in 0..self.size {
                let d =
                    (self.centre[x][i] - other.centre[x][i]).abs() + (self.slope[i] - other.slope[i]).abs() * half[x];
                gap = if d > gap || d.is_nan() { d } else { gap };
            }
        }
        gap
    }

    /// The largest half-width of a row.
    pub(super) fn width(&self, half: Half) -> f64 {
        let mut width: f64 = 0.0;
        for x in 0..2 {
            for i in 0..self.size {
                width = width.max(self.slope[i].abs() * half[x] + self.error[x][i]);
            }
        }
        width
    }

    /// Takes the states of another in, too.
    pub(super) fn merge(&mut self, other: &Self, half: Half) {
        let slack = self.turned();
        let (n, unit) = (self.size, unit(self.size));
        let held = other.in_frame(&self.frame, slack);
        for x in 0..2 {
            for (reach, &held) in self.reach[x].iter_mut().zip(&held[x]) {
                *reach = larger(*reach, held);
            }
            for i in 0..n {
                let middle = 0.5 * (self.centre[x][i] + other.centre[x][i]);
                let slope = 0.5 * (self.slope[i] + other.slope[i]);
                let far = larger((self.centre[x][i] - middle).abs(), (other.centre[x][i] - middle).abs());
                let tilt = larger((self.slope[i] - slope).abs(), (other.slope[i] - slope).abs());
                self.centre[x][i] = middle;
                self.rest[x][i] = up(far + tilt * half[x] + f64::MIN_POSITIVE, unit);
            }
        }
        self.slope.iter_mut().zip(&other.slope).for_each(|(a, b)| *a = 0.5 * (*a + b));
        self.measure();
    }
}

/// The larger of two numbers; no number if either is none.
fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

/// aᵀb, and Σ ‖a_i b_i‖.
fn dot(a: &[f64], b: &[f64]) -> (f64, f64) {
    a.iter().zip(b).fold((0.0, 0.0), |(sum, most), (a, b)| (sum + a * b, most + (a * b).abs()))
}

/// The largest row of ‖QᵀQ − I‖, or more.
fn slack(q: &[f64], n: usize, rows: usize) -> f64 {
    let unit = unit(n);
    let row = |(l, a): (usize, &[f64])| {
        let entry = |(k, b): (usize, &[f64])| {
            let (sum, most) = dot(&a[..n], &b[..n]);
            (sum - f64::from(u8::from(k == l))).abs() + unit * most + f64::EPSILON
        };
        up(q.chunks_exact(rows).enumerate().map(entry).sum(), unit)
    };
    q.chunks_exact(rows).enumerate().map(row).fold(0.0, larger)
}

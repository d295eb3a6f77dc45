//! What Newton's method and the certificate ask of the tables: the value, its gradient, the rows of forms.

use super::{NONE, Tabled};
use crate::synthesis::newton::{Form, Objective, Slot};

impl Tabled {
    /// A unit entry's product with another, of the Hessian or without its Gauss–Newton part.
    #[inline(always)]
    fn unit(&self, x: &[f64], e: usize, f: usize, gauss_newton: bool) -> f64 {
        let (p, q) = (self.row[e] as usize, self.row[f] as usize);
        let mut h = self.quadratic[e * self.support.len() + f];
        if p == q {
            let row = &self.rows[p];
            let pair = row.pairs + (e - row.entries.start) * row.entries.len() + f - row.entries.start;
            h += 4.0 * self.first * self.r[p] * x[self.pairs[pair] as usize];
        }
        if gauss_newton {
            let (a, b) = (self.support[e] % self.size, self.support[f] % self.size);
            let factor = 4.0 * self.first * self.r[p] * self.r[q];
            // Entry b of row p times entry a of row q, where there are such.
            let (low, high) =
                (self.entry[self.rows[p].player * self.size + b], self.entry[self.rows[q].player * self.size + a]);
            if low != NONE && high != NONE {
                h += factor * self.held[low as usize] * self.held[high as usize];
            }
            if a == b {
                h += factor * self.gram[p * self.rows.len() + q];
            }
        }
        h
    }

    /// The product with the direction of a variable, at one position in the gains.
    #[inline(always)]
    fn along(&self, x: &[f64], v: &Slot<f64>, at: usize, gauss_newton: bool) -> f64 {
        let f = self.entry[at] as usize;
        let h = self.unit(x, self.entry[v.entry] as usize, f, gauss_newton);
        if v.differs { h - v.relative * self.unit(x, self.entry[v.own] as usize, f, gauss_newton) } else { h }
    }

    #[inline(always)]
    fn product(&self, x: &[f64], v: &Slot<f64>, out: &mut [f64], gauss_newton: bool) {
        for &at in self.support.iter().take_while(|&&at| at / self.size <= v.entry / self.size) {
            out[at] = self.along(x, v, at, gauss_newton);
        }
    }
}

impl Form<f64> for Tabled {
    #[inline(always)]
    fn row(&self, _: &[f64], v: &Slot<f64>, out: &mut [f64]) {
        self.product(&self.kept, v, out, true);
    }

    #[inline(always)]
    fn entry(&self, _: &[f64], v: &Slot<f64>, at: usize) -> Option<f64> {
        Some(self.along(&self.kept, v, at, true))
    }
}

/// The form whose definiteness certifies the point last evaluated.
pub(crate) struct TabledCertificate<'a>(pub &'a Tabled);

impl Form<f64> for TabledCertificate<'_> {
    #[inline(always)]
    fn row(&self, _: &[f64], v: &Slot<f64>, out: &mut [f64]) {
        self.0.product(&self.0.x, v, out, false);
    }

    #[inline(always)]
    fn entry(&self, _: &[f64], v: &Slot<f64>, at: usize) -> Option<f64> {
        Some(self.0.along(&self.0.x, v, at, false))
    }
}

/// The sizes of the parts that cancel in it: its diagonal, once [`Tabled::measure`] has put them in the place of X.
pub(crate) struct TabledParts<'a>(pub &'a Tabled);

impl Form<f64> for TabledParts<'_> {
    #[inline(always)]
    fn row(&self, _: &[f64], v: &Slot<f64>, out: &mut [f64]) {
        self.0.product(&self.0.kept, v, out, false);
    }

    #[inline(always)]
    fn entry(&self, _: &[f64], v: &Slot<f64>, at: usize) -> Option<f64> {
        Some(self.0.along(&self.0.kept, v, at, false))
    }
}

impl Tabled {
    /// Puts the sizes of the parts of X, its diagonal alone, in the place of the X kept.
    pub(crate) fn measure(&mut self) {
        for ((kept, &(a, b)), (x, t)) in self.kept.iter_mut().zip(&self.players).zip(self.x.iter().zip(&self.target)) {
            *kept = if a == b { x.abs() + 2.0 * t } else { 0.0 };
        }
    }
}

impl Objective<f64> for Tabled {
    #[inline(always)]
    fn width(&self) -> usize {
        self.width
    }

    #[inline(always)]
    fn value(&mut self, g: &[f64]) -> f64 {
        let s = self.support.len();
        self.point.iter_mut().zip(&self.support).for_each(|(x, &at)| *x = g[at]);
        self.linear.copy_from_slice(&self.slope);
        for (row, (g, g0)) in self.quadratic.chunks_exact(s.max(1)).zip(self.point.iter().zip(&self.origin)) {
            let step = g - g0;
            if step != 0.0 {
                self.linear.iter_mut().zip(row).for_each(|(l, q)| *l += step * q);
            }
        }
        self.square();
        self.theta()
    }

    #[inline(always)]
    fn gradient(&mut self, _: &[f64], out: &mut [f64]) {
        let mut part = std::mem::take(&mut self.part);
        self.slope_of_square(&mut part);
        for ((&at, l), p) in self.support.iter().zip(&self.linear).zip(&part) {
            out[at] = l + p;
        }
        self.part = part;
    }

    #[inline(always)]
    fn keep(&mut self, lanes: bool) {
        if lanes {
            self.kept.copy_from_slice(&self.x);
        }
    }

    #[inline(always)]
    fn prepare(&mut self, g: &[f64]) {
        self.held.iter_mut().zip(&self.support).for_each(|(x, &at)| *x = g[at]);
        let lines = self.rows.len();
        for (p, row) in self.rows.iter().enumerate() {
            for (q, other) in self.rows[..p + 1].iter().enumerate() {
                // Entries of the other row in the columns of this one.
                let sum: f64 = row
                    .entries
                    .clone()
                    .map(|e| match self.entry[other.player * self.size + self.support[e] % self.size] {
                        NONE => 0.0,
                        f => self.held[e] * self.held[f as usize],
                    })
                    .sum();
                (self.gram[p * lines + q], self.gram[q * lines + p]) = (sum, sum);
            }
        }
    }

    #[inline(always)]
    fn gradient_scale(&self, _: &[f64]) -> f64 {
        let norm = |numbers: &mut dyn Iterator<Item = f64>| numbers.sum::<f64>().sqrt();
        let size = norm(&mut self.point.iter().map(|g| g * g));
        let x = (self.outside + self.sum_of_squares()).sqrt();
        let (quartic, rest) = self.gradient_parts;
        quartic * size * (x + 2.0 * self.target_norm) + rest * (size + self.fne)
    }

    #[inline(always)]
    fn value_scale(&self) -> f64 {
        self.value_scale
    }
}

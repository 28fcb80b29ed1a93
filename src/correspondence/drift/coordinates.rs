//! The coordinates x, y, d of a candidate, in which drifts are smooth, and polynomials in them.
//!
//! x and y are the pixel of C1. d is the column in C2, counted from where the middle of the measurement volume is seen:
//! it is linear in inverse depth. Within image and volume each runs over about −1 to 1.

use nalgebra::{Matrix3, Vector3};

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::kernels::load;
use crate::correspondence::patches::PATCH_PX;

/// Highest total degree of the polynomials.
const DEGREE: usize = 5;
/// Number of terms: all monomials in x, y and d up to the degree.
pub(super) const TERMS: usize = 56;
/// |d| beyond which a polynomial continues linearly. It was fitted to |d| up to 2, and its powers explode far beyond.
/// Up to here they are more exact than a straight line, which matters for large calibration errors.
const EDGE: f32 = 3.0;
/// Distance of the pixels of C1, along both axes, to which the middle of the volume is fitted.
const STRIDE: usize = 8;

/// A polynomial in x, y and d.
pub(super) type Polynomial = [f64; TERMS];

/// The coordinates of one rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DriftCoordinates {
    /// Half the width of C1's image, pixels.
    half_px: f64,
    /// Half its height, pixels.
    half_height_px: f64,
    /// Column of the middle of the volume, pixels: constant, change with x, change with y.
    middle_px: [f64; 3],
    /// Mean half length of a segment, pixels.
    scale_px: f64,
}

impl DriftCoordinates {
    /// Number of numbers in [`Self::to_numbers`].
    pub(super) const NUMBERS: usize = 6;

    /// Fits the coordinates to the segments of the pixels of C1, given by their first and last columns. `None` if there
    /// are no segments.
    pub(super) fn fit([width, height]: [usize; 2], limits_px: impl Fn(usize) -> [f32; 2]) -> Option<Self> {
        let (half_px, half_height_px) = (width as f64 / 2.0, height as f64 / 2.0);
        let mut places = Self { half_px, half_height_px, middle_px: [0.0; 3], scale_px: 1.0 };
        let (mut normal, mut right, mut halves, mut count) = (Matrix3::zeros(), Vector3::zeros(), 0.0, 0.0);
        for (v, u) in (0..height).step_by(STRIDE).flat_map(|v| (0..width).step_by(STRIDE).map(move |u| (v, u))) {
            let [begin_px, end_px] = limits_px(v * width + u);
            if begin_px > end_px {
                continue;
            }
            let [x, y] = places.image(u as f64, v as f64);
            let row = Vector3::new(1.0, x, y);
            normal += row * row.transpose();
            right += row * (0.5 * f64::from(begin_px + end_px));
            halves += 0.5 * f64::from(end_px - begin_px);
            count += 1.0;
        }
        // A volume seen in a single line of pixels leaves the plane undetermined; it stays level there.
        normal += Matrix3::identity() * (1e-9 * (count + 1.0));
        let middle = normal.cholesky()?.solve(&right);
        (count > 0.0).then_some(())?;
        places.middle_px = middle.into();
        places.scale_px = (halves / count).max(1.0);
        Some(places)
    }

    pub(super) fn to_numbers(self) -> [f64; Self::NUMBERS] {
        let [a, b, c] = self.middle_px;
        [self.half_px, self.half_height_px, a, b, c, self.scale_px]
    }

    pub(super) fn from_numbers([half_px, half_height_px, a, b, c, scale_px]: [f64; Self::NUMBERS]) -> Self {
        Self { half_px, half_height_px, middle_px: [a, b, c], scale_px }
    }

    /// Mean half length of a segment, pixels.
    pub(super) fn scale_px(&self) -> f64 {
        self.scale_px
    }

    /// x and y of a pixel of C1.
    fn image(&self, u_px: f64, v_px: f64) -> [f64; 2] {
        [u_px / self.half_px - 1.0, (v_px - self.half_height_px) / self.half_px]
    }

    /// x, y and d of a pixel of C1 and a column of the epipolar frame.
    pub(super) fn place(&self, u_px: f64, v_px: f64, column_px: f64) -> [f64; 3] {
        let [x, y] = self.image(u_px, v_px);
        let d = (column_px - self.middle_at([x, y])) / self.scale_px;
        [x, y, d]
    }

    fn middle_at(&self, [x, y]: [f64; 2]) -> f64 {
        let [a, b, c] = self.middle_px;
        a + b * x + c * y
    }

    /// A polynomial in row `v` of C1.
    pub(super) fn in_row(&self, polynomial: &Polynomial, v: usize) -> RowPolynomial {
        let [_, y] = self.image(0.0, v as f64);
        let py = powers(y);
        let mut coefficients = [[0.0; DEGREE + 1]; DEGREE + 1];
        for (&coefficient, [i, j, k]) in polynomial.iter().zip(EXPONENTS) {
            coefficients[i][k] += coefficient * py[j];
        }
        // From here on single precision is exact enough, and twice as fast.
        RowPolynomial { places: *self, y, coefficients: coefficients.map(|of_power| of_power.map(|c| c as f32)) }
    }

    /// Evaluates a polynomial along the segments of pixels of row `v` of C1: of those in `wanted` blocks, or of all.
    pub(super) fn along_segments(
        &self,
        polynomial: &Polynomial,
        v: usize,
        width: usize,
        wanted: Option<&[bool]>,
        out: &mut DepthRow,
    ) {
        out.per_px = (1.0 / self.scale_px) as f32;
        if out.x.len() != width.next_multiple_of(BLOCK) || out.half_px != self.half_px {
            out.half_px = self.half_px;
            out.x.clear();
            out.x.extend((0..width.next_multiple_of(BLOCK)).map(|u| u as f64 / out.half_px - 1.0));
        }
        for array in out.coefficients.iter_mut().chain([&mut out.middle_px]) {
            array.resize(width.next_multiple_of(BLOCK), 0.0);
        }
        fringeflow_simd::run(Level::in_use(), DepthKernel { polynomial: self.in_row(polynomial, v), wanted, out });
    }
}

/// A polynomial in a row of C1, for a few of its pixels.
#[derive(Clone, Copy, Debug)]
pub(in crate::correspondence) struct RowPolynomial {
    places: DriftCoordinates,
    y: f64,
    /// Factor of xⁱ·dᵏ at `[i][k]`.
    coefficients: [[f32; DEGREE + 1]; DEGREE + 1],
}

impl RowPolynomial {
    /// The polynomial along the segment of the pixel in a column: the same bits as those of [`DepthRow::segment`].
    pub(in crate::correspondence) fn segment(&self, u: usize) -> DepthPolynomial {
        let [x, _] = self.places.image(u as f64, 0.0);
        let at = x as f32;
        let factor = |k: usize| (0..=DEGREE - k).rev().fold(0.0, |sum, power| sum * at + self.coefficients[power][k]);
        DepthPolynomial {
            coefficients: std::array::from_fn(factor),
            middle_px: self.places.middle_at([x, self.y]) as f32,
            per_px: (1.0 / self.places.scale_px) as f32,
        }
    }
}

/// Pixels handled at once.
const BLOCK: usize = PATCH_PX;

/// A field along the segments of a row of pixels: for each pixel a polynomial in d, one array per number. The length of
/// each array is a multiple of sixteen.
#[derive(Clone, Debug, Default)]
pub(in crate::correspondence) struct DepthRow {
    /// Factor of dᵏ of each pixel at `[k]`.
    coefficients: [Vec<f32>; DEGREE + 1],
    /// Column at which d is 0, pixels.
    middle_px: Vec<f32>,
    /// Change of d per pixel.
    per_px: f32,
    /// x of each pixel, and the half width that it was computed with.
    x: Vec<f64>,
    half_px: f64,
}

impl DepthRow {
    /// Makes room for the fields of a number of pixels, to be set one by one.
    pub(in crate::correspondence) fn make_room(&mut self, count: usize) {
        let room = self.middle_px.len().max(count);
        self.coefficients.iter_mut().chain([&mut self.middle_px]).for_each(|array| array.resize(room, 0.0));
    }

    /// Sets the field of a pixel.
    #[inline]
    pub(in crate::correspondence) fn set(&mut self, pixel: usize, field: &DepthPolynomial) {
        self.coefficients.iter_mut().zip(field.coefficients).for_each(|(of_pixels, c)| of_pixels[pixel] = c);
        (self.middle_px[pixel], self.per_px) = (field.middle_px, field.per_px);
    }

    /// The field along the segment of the pixel in a column.
    #[inline]
    pub(in crate::correspondence) fn segment(&self, u: usize) -> DepthPolynomial {
        let mut coefficients = [0.0; DEGREE + 1];
        coefficients.iter_mut().zip(&self.coefficients).for_each(|(c, of_pixels)| *c = of_pixels[u]);
        DepthPolynomial { coefficients, middle_px: self.middle_px[u], per_px: self.per_px }
    }
}

/// A field along the segments of a block of pixels.
pub(in crate::correspondence) struct DepthBlock<L: Lanes> {
    pub(in crate::correspondence) coefficients: [L::Floats; DEGREE + 1],
    pub(in crate::correspondence) middle_px: L::Floats,
    pub(in crate::correspondence) per_px: f32,
}

impl DepthRow {
    /// The block that begins with pixel `first`.
    #[inline(always)]
    pub(in crate::correspondence) fn block<L: Lanes>(&self, lanes: L, first: usize) -> DepthBlock<L> {
        // Written out: a closure would not be compiled for the SIMD level of the kernel.
        let c = &self.coefficients;
        let coefficients = [
            load(lanes, &c[0], first),
            load(lanes, &c[1], first),
            load(lanes, &c[2], first),
            load(lanes, &c[3], first),
            load(lanes, &c[4], first),
            load(lanes, &c[5], first),
        ];
        DepthBlock { coefficients, middle_px: load(lanes, &self.middle_px, first), per_px: self.per_px }
    }
}

impl<L: Lanes> DepthBlock<L> {
    /// The same polynomial for all pixels.
    #[inline(always)]
    pub(in crate::correspondence) fn splat(lanes: L, of_pixel: &DepthPolynomial) -> Self {
        // A loop, since a closure that is not inlined is not compiled for the SIMD level.
        let mut coefficients = [lanes.float(0.0); DEGREE + 1];
        for (all, &one) in coefficients.iter_mut().zip(&of_pixel.coefficients) {
            *all = lanes.float(one);
        }
        Self { coefficients, middle_px: lanes.float(of_pixel.middle_px), per_px: of_pixel.per_px }
    }

    /// Values at columns, computed as by [`DepthPolynomial::at`].
    #[inline(always)]
    pub(in crate::correspondence) fn at(&self, lanes: L, column_px: L::Floats) -> L::Floats {
        let place = lanes.times_float(lanes.sub_float(column_px, self.middle_px), lanes.float(self.per_px));
        let d = lanes.min_float(lanes.max_float(place, lanes.float(-EDGE)), lanes.float(EDGE));
        let then = |sum: L::Floats, c: L::Floats| lanes.add_float(lanes.times_float(sum, d), c);
        let [c0, c1, c2, c3, c4, c5] = self.coefficients;
        let (v4, r4) = (then(c5, c4), c5);
        let (v3, r3) = (then(v4, c3), then(r4, v4));
        let (v2, r2) = (then(v3, c2), then(r3, v3));
        let (v1, r1) = (then(v2, c1), then(r2, v2));
        let (value, rise) = (then(v1, c0), then(r1, v1));
        lanes.add_float(value, lanes.times_float(rise, lanes.sub_float(place, d)))
    }
}

/// Computes the polynomials of a row.
struct DepthKernel<'a> {
    polynomial: RowPolynomial,
    wanted: Option<&'a [bool]>,
    out: &'a mut DepthRow,
}

impl Kernel for DepthKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { polynomial: RowPolynomial { places, y, coefficients }, wanted, out } = self;
        let [a, b, c] = places.middle_px;
        let blocks = out.middle_px.as_chunks_mut::<BLOCK>().0.iter_mut().zip(out.x.as_chunks::<BLOCK>().0);
        for (block, (middle_px, x)) in blocks.enumerate() {
            if wanted.is_some_and(|wanted| !wanted[block]) {
                continue;
            }
            for i in 0..BLOCK {
                middle_px[i] = (a + b * x[i] + c * y) as f32;
            }
            let mut at = [0.0; BLOCK];
            for i in 0..BLOCK {
                at[i] = x[i] as f32;
            }
            for (k, of_power) in out.coefficients.iter_mut().enumerate() {
                let mut sums = [0.0; BLOCK];
                // Horner's rule; terms of a higher total degree do not exist.
                for power in (0..=DEGREE - k).rev() {
                    for i in 0..BLOCK {
                        sums[i] = sums[i] * at[i] + coefficients[power][k];
                    }
                }
                if let Some(of_block) = of_power.as_chunks_mut().0.get_mut(block) {
                    *of_block = sums;
                }
            }
        }
    }
}

/// A field along one segment: a polynomial in d.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::correspondence) struct DepthPolynomial {
    pub(in crate::correspondence) coefficients: [f32; DEGREE + 1],
    pub(in crate::correspondence) middle_px: f32,
    pub(in crate::correspondence) per_px: f32,
}

impl DepthPolynomial {
    /// Value at a column of the epipolar frame.
    #[inline]
    pub(in crate::correspondence) fn at(&self, column_px: f32) -> f32 {
        let place = (column_px - self.middle_px) * self.per_px;
        let d = place.clamp(-EDGE, EDGE);
        let (mut value, mut rise) = (self.coefficients[DEGREE], 0.0);
        for &c in self.coefficients[..DEGREE].iter().rev() {
            rise = rise * d + value;
            value = value * d + c;
        }
        value + rise * (place - d)
    }
}

/// The monomials at a place; linear in d far beyond the volume.
#[inline(always)]
pub(super) fn monomials([x, y, place]: [f64; 3]) -> Polynomial {
    let d = place.clamp(-f64::from(EDGE), f64::from(EDGE));
    let (px, py, within) = (powers(x), powers(y), powers(d));
    let mut pd = within;
    (1..=DEGREE).for_each(|k| pd[k] += k as f64 * within[k - 1] * (place - d));
    let mut values = [0.0; TERMS];
    for (value, [i, j, k]) in values.iter_mut().zip(EXPONENTS) {
        *value = px[i] * py[j] * pd[k];
    }
    values
}

#[inline(always)]
fn powers(value: f64) -> [f64; DEGREE + 1] {
    let mut powers = [1.0; DEGREE + 1];
    (1..=DEGREE).for_each(|i| powers[i] = powers[i - 1] * value);
    powers
}

/// Exponents of x, y and d of every term, the constant first.
const EXPONENTS: [[usize; 3]; TERMS] = {
    let mut exponents = [[0; 3]; TERMS];
    let (mut term, mut degree) = (0, 0);
    while degree <= DEGREE {
        let mut i = 0;
        while i <= degree {
            let mut j = 0;
            while i + j <= degree {
                exponents[term] = [i, j, degree - i - j];
                term += 1;
                j += 1;
            }
            i += 1;
        }
        degree += 1;
    }
    assert!(term == TERMS);
    exponents
};

#[cfg(test)]
mod tests {
    use super::*;

    fn places() -> DriftCoordinates {
        let limits_px = |i: usize| {
            let (u, v) = ((i % 64) as f32, (i / 64) as f32);
            let middle = 100.0 + 2.0 * u - v;
            [middle - 20.0, middle + 20.0]
        };
        DriftCoordinates::fit([64, 48], limits_px).unwrap()
    }

    #[test]
    fn the_middle_of_every_segment_is_zero_and_its_ends_are_one() {
        for (u, v) in [(0.0, 0.0), (63.0, 10.0), (20.0, 47.0)] {
            let middle = 100.0 + 2.0 * u - v;
            assert!(places().place(u, v, middle)[2].abs() < 1e-6);
            assert!((places().place(u, v, middle + 20.0)[2] - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn the_first_term_is_constant() {
        assert_eq!(monomials([0.3, -0.2, 0.9])[0], 1.0);
    }

    #[test]
    fn along_a_segment_a_polynomial_has_its_values() {
        let polynomial: Polynomial = std::array::from_fn(|i| ((i * 37 % 11) as f64 - 5.0) / 10.0);
        let mut row = DepthRow::default();
        places().along_segments(&polynomial, 30, 64, None, &mut row);
        let along = row.segment(17);
        for column_px in [30.0, 80.0, 104.0, 130.0, 260.0] {
            let monomials = monomials(places().place(17.0, 30.0, column_px));
            let exact: f64 = polynomial.iter().zip(monomials).map(|(c, m)| c * m).sum();
            assert!((f64::from(along.at(column_px as f32)) - exact).abs() < 1e-4 * exact.abs().max(1.0));
        }
        let few = places().in_row(&polynomial, 30);
        assert!((0..64).all(|u| few.segment(u) == row.segment(u)), "bit for bit");
    }

    #[test]
    fn numbers_make_the_same_coordinates() {
        assert_eq!(DriftCoordinates::from_numbers(places().to_numbers()), places());
    }
}

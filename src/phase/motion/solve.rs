//! Fits moving sinusoids of known motion to a run of images, 32 pixels at a time. In: samples and motions. Out: offset,
//! z and residual. Cost: some twenty operations per sample, and ten for each run that it belongs to.

use fringeflow_base::limits::{MAX_IMAGES, MIN_STEPS};
use fringeflow_simd::{LANES, Lanes};

use super::image_times::LEAST_FITTED;
use super::ripple::Turns;

/// Pixels solved together.
pub(super) const BATCH: usize = LANES;

/// One number per pixel.
type Plane = [f32; BATCH];

/// Offset, z and residual of each pixel, and whether its images determine them.
pub(super) struct Solutions<L: Lanes> {
    pub(super) offset: L::Reals,
    pub(super) z: [L::Reals; 2],
    /// Standard deviation of the samples about the moving sinusoid, grey levels.
    pub(super) residual: L::Reals,
    pub(super) determined: L::Mask,
}

/// Sums that the normal equations of a pixel consist of, with w = 1 for a sample that counts, otherwise 0, and
/// `c − i·s = e^(iθ)`: w, wc, ws, wc², wcs, ws², and w, wc and ws times the grey level.
const PRODUCTS: usize = 9;

/// Samples of a batch of pixels.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    greys: [Plane; MAX_IMAGES],
    /// 1 for samples that count, otherwise 0.
    kept: [Plane; MAX_IMAGES],
    /// Cosine and sine of the phase shift of each sample.
    shifts: [[Plane; 2]; MAX_IMAGES],
    /// Motion, rad per image.
    motion_rad: Plane,
    products: [[Plane; PRODUCTS]; MAX_IMAGES],
    /// Grey level that the others are counted from, so that they round less.
    reference: Plane,
}

impl Default for Batch {
    fn default() -> Self {
        let (plane, planes) = ([0.0; BATCH], [[0.0; BATCH]; MAX_IMAGES]);
        Self {
            greys: planes,
            kept: planes,
            shifts: [[plane; 2]; MAX_IMAGES],
            motion_rad: plane,
            products: [[plane; PRODUCTS]; MAX_IMAGES],
            reference: plane,
        }
    }
}

impl Batch {
    /// Sets the motion of a pixel beyond that in its phase shifts, rad per image.
    #[inline(always)]
    pub(super) fn set_motion(&mut self, pixel: usize, motion_rad: f32) {
        self.motion_rad[pixel] = motion_rad;
    }

    /// Sets the grey level of a sample, whether it counts, and cosine and sine of its phase shift.
    #[inline(always)]
    pub(super) fn set_sample(&mut self, [image, pixel]: [usize; 2], grey: f32, is_kept: bool, [cos, sin]: [f32; 2]) {
        self.greys[image][pixel] = grey;
        self.kept[image][pixel] = f32::from(u8::from(is_kept));
        (self.shifts[image][0][pixel], self.shifts[image][1][pixel]) = (cos, sin);
    }

    /// Multiplies what the fits to runs of `images` images consist of.
    #[inline(always)]
    pub(super) fn prepare<L: Lanes>(&mut self, lanes: L, images: usize, turns: &mut Turns<L>) {
        let l = lanes;
        turns.set(l, images, l.load_reals(&self.motion_rad));
        self.reference = self.greys[images / 2];
        let reference = l.load_reals(&self.reference);
        for image in 0..images {
            let [cos, sin] = &self.shifts[image];
            let [cos, sin] = turns.moved(l, [l.load_reals(cos), l.load_reals(sin)], [image, images]);
            let w = l.load_reals(&self.kept[image]);
            let s = l.sub_real(l.real(0.0), sin);
            let (wc, ws) = (l.times_real(w, cos), l.times_real(w, s));
            let grey = l.sub_real(l.load_reals(&self.greys[image]), reference);
            let products = [
                w,
                wc,
                ws,
                l.times_real(wc, cos),
                l.times_real(wc, s),
                l.times_real(ws, s),
                l.times_real(w, grey),
                l.times_real(wc, grey),
                l.times_real(ws, grey),
            ];
            let mut k = 0;
            while k < PRODUCTS {
                l.store_reals(products[k], &mut self.products[image][k]);
                k += 1;
            }
        }
    }

    /// Fits moving sinusoids to the images from `first` to `last`: `I_i = A + Re(z·e^(iθ_i))`.
    ///
    /// ```text
    /// for each pixel: sums of the normal equations over its kept samples
    ///     A, z = solution by cofactors; not determined if the determinant is zero or few samples are kept
    ///     residual = √( Σ kept·(I − A − Re(z·e^(iθ)))² / (kept samples − 3) )
    /// ```
    #[inline(always)]
    pub(super) fn solve<L: Lanes>(&self, lanes: L, [first, last]: [usize; 2]) -> Solutions<L> {
        let l = lanes;
        let mut sums = [l.real(0.0); PRODUCTS];
        for products in &self.products[first..=last] {
            let mut k = 0;
            while k < PRODUCTS {
                sums[k] = l.add_real(sums[k], l.load_reals(&products[k]));
                k += 1;
            }
        }
        let [n, c1, s1, cc, cs, ss, g, gc, gs] = sums;
        // Cofactors of the symmetric normal matrix.
        let a = minor(l, [cc, cs], [cs, ss]);
        let b = minor(l, [s1, c1], [ss, cs]);
        let c = minor(l, [c1, s1], [cc, cs]);
        let d = minor(l, [n, s1], [s1, ss]);
        let e = minor(l, [s1, n], [cs, c1]);
        let f = minor(l, [n, c1], [c1, cc]);
        let determinant = dot(l, [n, c1, s1], [a, b, c]);
        let is_regular = l.is_greater_real(determinant, l.real(0.0));
        let scale = l.over_real(l.real(1.0), l.select_real(is_regular, determinant, l.real(1.0)));
        let offset = l.times_real(dot(l, [a, b, c], [g, gc, gs]), scale);
        let re = l.times_real(dot(l, [b, d, e], [g, gc, gs]), scale);
        let im = l.times_real(dot(l, [c, e, f], [g, gc, gs]), scale);
        let mut squares = l.real(0.0);
        for [w, wc, ws, _, _, _, wg, _, _] in &self.products[first..=last] {
            let model = dot(l, [offset, re, im], [l.load_reals(w), l.load_reals(wc), l.load_reals(ws)]);
            let residual = l.sub_real(l.load_reals(wg), model);
            squares = l.add_real(squares, l.times_real(residual, residual));
        }
        let freedom = l.max_real(l.sub_real(n, l.real(MIN_STEPS as f32)), l.real(1.0));
        let is_enough = l.is_at_least_real(n, l.real(LEAST_FITTED as f32));
        Solutions {
            offset: l.add_real(offset, l.load_reals(&self.reference)),
            z: [re, im],
            residual: l.root_real(l.over_real(squares, freedom)),
            determined: l.and(is_regular, is_enough),
        }
    }
}

/// ad − bc.
#[inline(always)]
fn minor<L: Lanes>(lanes: L, [a, b]: [L::Reals; 2], [c, d]: [L::Reals; 2]) -> L::Reals {
    lanes.sub_real(lanes.times_real(a, d), lanes.times_real(b, c))
}

/// Scalar product.
#[inline(always)]
fn dot<L: Lanes>(lanes: L, [a, b, c]: [L::Reals; 3], [x, y, z]: [L::Reals; 3]) -> L::Reals {
    let l = lanes;
    l.add_real(l.add_real(l.times_real(a, x), l.times_real(b, y)), l.times_real(c, z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_simd::Arrays;

    #[test]
    fn a_moving_sinusoid_is_recovered() {
        let (lanes, mut batch) = (Arrays, Batch::default());
        for p in 0..BATCH {
            batch.set_motion(p, 0.02 * p as f32 - 0.3);
            for image in 0..6 {
                let (time, shift_rad) = (image as f32 - 2.5, 1.7 * image as f32);
                let angle = 0.4 * p as f32 + shift_rad + (0.02 * p as f32 - 0.3) * time;
                // In the second half of the pixels the third image is saturated and does not count.
                let grey = if image == 2 && p >= BATCH / 2 { 255.0 } else { 90.0 + 50.0 * angle.cos() };
                batch.set_sample([image, p], grey, grey < 255.0, [shift_rad.cos(), shift_rad.sin()]);
            }
        }
        batch.prepare(lanes, 6, &mut Turns::new(lanes));
        let Solutions { offset, z: [re, im], residual, determined } = batch.solve(lanes, [0, 5]);
        let determined = lanes.bits(determined);
        for p in 0..BATCH {
            let phase = 0.4 * p as f32;
            assert!(determined >> p & 1 == 1 && (offset[p] - 90.0).abs() < 1e-3 && residual[p] < 1e-3);
            assert!((re[p] - 50.0 * phase.cos()).abs() < 1e-3 && (im[p] - 50.0 * phase.sin()).abs() < 1e-3);
        }
        let four_images = lanes.bits(batch.solve(lanes, [0, 3]).determined);
        assert_eq!(four_images, u32::MAX >> (LANES / 2));
    }
}

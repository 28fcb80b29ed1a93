//! Pixels of known motion. In: fits and motions. Out: z without ripple, and the residual. Cost: four multiply-adds per
//! image for each response, ten for the residual.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::Lanes;

use crate::phase::sample::Sample;

use super::fit::{Complex, MotionFit, TurnedSum};
use super::image_times::{side, time};
use super::images::Images;

/// Smallest contrast |H|² − |G|² that separates z from its ripple.
const MIN_CONTRAST: f32 = 0.05;

/// Complex numbers of 32 pixels: real and imaginary parts.
pub(super) type Complexes<L> = [<L as Lanes>::Reals; 2];

/// `e^(iεt)` of the images after the centre of the window, starting with the nearest. Images before it have the
/// conjugates.
pub(super) struct Turns<L: Lanes>([Complexes<L>; MAX_IMAGES / 2]);

impl<L: Lanes> Turns<L> {
    /// Scratch memory for any window.
    #[inline(always)]
    pub(super) fn new(lanes: L) -> Self {
        Self([[lanes.real(0.0); 2]; MAX_IMAGES / 2])
    }

    /// Sets the turns for a window of `images` images and for motions (rad per image) that are not NaN.
    #[inline(always)]
    pub(super) fn set(&mut self, lanes: L, images: usize, motion_rad: L::Reals) {
        let l = lanes;
        // The times are 0, 1, 2 … for an odd number of images, 0.5, 1.5, 2.5 … for an even one.
        let start = if images.is_multiple_of(2) { 0.5 } else { 0.0 };
        let mut turn = cos_sin(l, l.times_real(l.real(start), motion_rad));
        let step = cos_sin(l, motion_rad);
        self.0[0] = turn;
        for turns in &mut self.0[1..images.div_ceil(2)] {
            turn = product(l, turn, step);
            *turns = turn;
        }
    }

    /// `e^(iε|t|)` of an image.
    #[inline(always)]
    fn for_image(&self, image: usize, images: usize) -> Complexes<L> {
        let middle = images / 2;
        self.0[match (image < middle, images.is_multiple_of(2)) {
            (true, true) => middle - 1 - image,
            (true, false) => middle - image,
            (false, _) => image - middle,
        }]
    }

    /// Evaluates sums over the images at these turns.
    #[inline(always)]
    pub(super) fn sums<const COUNT: usize>(&self, lanes: L, turned: [&TurnedSum; COUNT]) -> [Complexes<L>; COUNT] {
        let l = lanes;
        let images = turned[0].factors.len();
        let mut sums = [[l.real(0.0); 2]; COUNT];
        for image in 0..images {
            let [cos, sin] = self.for_image(image, images);
            let mut k = 0;
            while k < COUNT {
                let [re, signed_im, signed_re, im] = turned[k].factors[image];
                let along = l.sub_real(l.times_real(l.real(re), cos), l.times_real(l.real(signed_im), sin));
                let across = l.add_real(l.times_real(l.real(signed_re), sin), l.times_real(l.real(im), cos));
                sums[k] = [l.add_real(sums[k][0], along), l.add_real(sums[k][1], across)];
                k += 1;
            }
        }
        sums
    }

    /// Returns the offset of the samples of `count` pixels from `pixel` on, and the standard deviation of the samples
    /// about the moving sinusoids z; both in grey levels. The parameter `offset` is an estimate of the offset.
    #[inline(always)]
    pub(super) fn residual<S: Sample>(
        &self,
        lanes: L,
        images: &Images<'_, S>,
        fit: &MotionFit,
        [pixel, count]: [usize; 2],
        offset: L::Reals,
        [re, im]: Complexes<L>,
    ) -> [L::Reals; 2] {
        let l = lanes;
        let (mut sum, mut trend, mut squares) = (l.real(0.0), l.real(0.0), l.real(0.0));
        let mut times = 0.0;
        for (i, &[cos, sin]) in fit.turns.iter().enumerate() {
            let (sign, t) = (side(i, images.count), time(i, images.count) as f32);
            let [c, d] = self.for_image(i, images.count);
            let along = l.sub_real(l.times_real(l.real(cos), c), l.times_real(l.real(sign * sin), d));
            let across = l.add_real(l.times_real(l.real(sign * cos), d), l.times_real(l.real(sin), c));
            let model = l.sub_real(l.times_real(re, along), l.times_real(im, across));
            let grey = l.times_real(S::reals(l, &images.block(i, pixel, count)), l.real(images.grey_per_value[i]));
            let residual = l.sub_real(l.sub_real(grey, offset), model);
            sum = l.add_real(sum, residual);
            trend = l.add_real(trend, l.times_real(l.real(t), residual));
            squares = l.add_real(squares, l.times_real(residual, residual));
            times += t * t;
        }
        // Subtract the squares explained by a better offset and, if it is determined, by the trend A'.
        let count = l.real(images.count as f32);
        let per_time = l.real(if fit.has_trend { 1.0 / times } else { 0.0 });
        let explained = l.over_real(l.times_real(sum, sum), count);
        let left = l.sub_real(l.sub_real(squares, explained), l.times_real(l.times_real(trend, trend), per_time));
        let left = l.max_real(left, l.real(0.0));
        let residual = l.root_real(l.over_real(left, l.real(fit.freedom() as f32)));
        [l.add_real(offset, l.over_real(sum, count)), residual]
    }
}

/// z from the fitted w = H·z + G·z*, and a mask of pixels where it is determined.
#[inline(always)]
pub(super) fn without_ripple<L: Lanes>(
    lanes: L,
    [[a, b], [c, d]]: [Complexes<L>; 2],
    [x, y]: Complexes<L>,
) -> (Complexes<L>, L::Mask) {
    let l = lanes;
    let square = |v| l.times_real(v, v);
    let contrast = l.sub_real(l.sub_real(l.add_real(square(a), square(b)), square(c)), square(d));
    let scale = l.over_real(l.real(1.0), l.max_real(contrast, l.real(MIN_CONTRAST)));
    // (H*·w − G·w*) / (|H|² − |G|²)
    let re = l.add_real(l.times_real(a, x), l.times_real(b, y));
    let re = l.sub_real(l.sub_real(re, l.times_real(c, x)), l.times_real(d, y));
    let im = l.sub_real(l.times_real(a, y), l.times_real(b, x));
    let im = l.sub_real(l.add_real(im, l.times_real(c, y)), l.times_real(d, x));
    let z = [l.times_real(re, scale), l.times_real(im, scale)];
    (z, l.is_at_least_real(contrast, l.real(MIN_CONTRAST)))
}

#[inline(always)]
pub(super) fn product<L: Lanes>(lanes: L, [a, b]: Complexes<L>, [c, d]: Complexes<L>) -> Complexes<L> {
    let l = lanes;
    [l.sub_real(l.times_real(a, c), l.times_real(b, d)), l.add_real(l.times_real(a, d), l.times_real(b, c))]
}

/// The same number in all lanes.
#[inline(always)]
pub(super) fn splat<L: Lanes>(lanes: L, [re, im]: Complex) -> Complexes<L> {
    [lanes.real(re), lanes.real(im)]
}

/// Cosine and sine of angles up to 1.5 rad, exact to 2e-6 (Taylor). Only additions and multiplications, so that every
/// machine computes the same bits.
#[inline(always)]
fn cos_sin<L: Lanes>(lanes: L, angle: L::Reals) -> Complexes<L> {
    const COS: [f32; 6] = [1.0, 0.5, 1.0 / 24.0, 1.0 / 720.0, 1.0 / 40_320.0, 1.0 / 3_628_800.0];
    const SIN: [f32; 5] = [1.0, 1.0 / 6.0, 1.0 / 120.0, 1.0 / 5040.0, 1.0 / 362_880.0];
    let l = lanes;
    let x = l.times_real(angle, angle);
    [alternating(l, x, &COS), l.times_real(angle, alternating(l, x, &SIN))]
}

/// c0 − x·(c1 − x·(c2 − …)).
#[inline(always)]
fn alternating<L: Lanes, const DEGREE: usize>(lanes: L, x: L::Reals, coefficients: &[f32; DEGREE]) -> L::Reals {
    let mut sum = lanes.real(coefficients[DEGREE - 1]);
    let mut k = DEGREE - 1;
    while k > 0 {
        k -= 1;
        sum = lanes.sub_real(lanes.real(coefficients[k]), lanes.times_real(x, sum));
    }
    sum
}

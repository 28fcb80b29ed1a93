//! Surroundings of known motion. In: their motion. Out: the responses of the fits to it, and the phases of a sinusoid that
//! moves so. Cost: per cell two multiply-adds for each response and pair of images, six operations per image.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::Lanes;

use super::fit::TurnedSum;
use super::image_times::{pair, side};

/// Smallest contrast |H|² − |G|² that separates z from its ripple.
pub(super) const MIN_CONTRAST: f32 = 0.05;

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
        let half = cos_sin(l, l.times_real(l.real(0.5), motion_rad));
        let step = product(l, half, half);
        // The times are 0, 1, 2 … for an odd number of images, 0.5, 1.5, 2.5 … for an even one.
        let mut turn = if images.is_multiple_of(2) { half } else { [l.real(1.0), l.real(0.0)] };
        self.0[0] = turn;
        for turns in &mut self.0[1..images.div_ceil(2)] {
            turn = product(l, turn, step);
            *turns = turn;
        }
    }

    /// Evaluates sums over the images at these turns.
    #[inline(always)]
    pub(super) fn sums<const COUNT: usize>(&self, lanes: L, turned: [&TurnedSum; COUNT]) -> [Complexes<L>; COUNT] {
        let l = lanes;
        let mut sums = [[l.real(0.0); 2]; COUNT];
        for (pair, [cos, sin]) in self.0.iter().enumerate().take(turned[0].factors.len()) {
            let mut k = 0;
            while k < COUNT {
                let [re_cos, re_sin, im_cos, im_sin] = turned[k].factors[pair];
                let re = l.add_real(l.times_real(l.real(re_cos), *cos), l.times_real(l.real(re_sin), *sin));
                let im = l.add_real(l.times_real(l.real(im_cos), *cos), l.times_real(l.real(im_sin), *sin));
                sums[k] = [l.add_real(sums[k][0], re), l.add_real(sums[k][1], im)];
                k += 1;
            }
        }
        sums
    }

    /// Cosine and sine of the phase shift of an image of a window plus the phase moved until then.
    #[inline(always)]
    pub(super) fn moved(
        &self,
        lanes: L,
        [shift_cos, shift_sin]: Complexes<L>,
        [image, images]: [usize; 2],
    ) -> Complexes<L> {
        let [cos, sin] = self.0[pair(image, images)];
        let sin = lanes.times_real(lanes.real(side(image, images)), sin);
        product(lanes, [shift_cos, shift_sin], [cos, sin])
    }
}

/// Factors of x, y, y and −x in `z = (H*·w − G·w*) / (|H|² − |G|²)`, where w = x + iy, and a mask of the responses H and
/// G from which z can be told.
#[inline(always)]
pub(super) fn ripple_removal<L: Lanes>(lanes: L, [[a, b], [c, d]]: [Complexes<L>; 2]) -> ([L::Reals; 4], L::Mask) {
    let l = lanes;
    let square = |v| l.times_real(v, v);
    let contrast = l.sub_real(l.sub_real(l.add_real(square(a), square(b)), square(c)), square(d));
    let scale = l.over_real(l.real(1.0), l.max_real(contrast, l.real(MIN_CONTRAST)));
    let factors = [
        l.times_real(l.sub_real(a, c), scale),
        l.times_real(l.sub_real(b, d), scale),
        l.times_real(l.add_real(a, c), scale),
        l.times_real(l.add_real(b, d), scale),
    ];
    (factors, l.is_at_least_real(contrast, l.real(MIN_CONTRAST)))
}

#[inline(always)]
pub(super) fn product<L: Lanes>(lanes: L, [a, b]: Complexes<L>, [c, d]: Complexes<L>) -> Complexes<L> {
    let l = lanes;
    [l.sub_real(l.times_real(a, c), l.times_real(b, d)), l.add_real(l.times_real(a, d), l.times_real(b, c))]
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

//! Fits moving sinusoids of known motion to a run of images, 32 pixels at a time. In: samples and motions. Out: offset,
//! z and residual. Cost: some thirty operations in `f64` per sample.

use fringeflow_base::limits::{MAX_IMAGES, MIN_STEPS};

use super::image_times::LEAST_FITTED;

/// Pixels solved together.
pub(super) const BATCH: usize = 32;

/// One number per pixel.
type Plane = [f64; BATCH];

/// Offset, z and residual of each pixel, and whether its images determine them.
pub(super) struct Solutions {
    pub(super) offset: [f32; BATCH],
    pub(super) z: [[f32; BATCH]; 2],
    /// Standard deviation of the samples about the moving sinusoid, grey levels.
    pub(super) residual: [f32; BATCH],
    pub(super) determined: [bool; BATCH],
}

/// Samples of a batch of pixels.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    greys: [Plane; MAX_IMAGES],
    /// 1 for samples that count, otherwise 0.
    kept: [Plane; MAX_IMAGES],
    /// Cosine and sine of the angle of each sample.
    cos: [Plane; MAX_IMAGES],
    sin: [Plane; MAX_IMAGES],
}

impl Default for Batch {
    fn default() -> Self {
        let planes = [[0.0; BATCH]; MAX_IMAGES];
        Self { greys: planes, kept: planes, cos: planes, sin: planes }
    }
}

impl Batch {
    /// Sets the grey level of a sample, and whether it counts.
    #[inline(always)]
    pub(super) fn set_sample(&mut self, image: usize, pixel: usize, grey: f32, is_kept: bool) {
        self.greys[image][pixel] = f64::from(grey);
        self.kept[image][pixel] = f64::from(u8::from(is_kept));
    }

    /// Sets the angles of an image: its phase shift (rad) plus the motion (rad per image) times its time (images).
    #[inline(always)]
    pub(super) fn set_angles(&mut self, image: usize, [time, shift_rad]: [f32; 2], motion_rad: &[f32; BATCH]) {
        let (cos, sin) = (&mut self.cos[image], &mut self.sin[image]);
        for p in 0..BATCH {
            [cos[p], sin[p]] = cos_sin(f64::from(shift_rad + motion_rad[p] * time));
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
    pub(super) fn solve(&self, [first, last]: [usize; 2]) -> Solutions {
        let zero = [0.0; BATCH];
        // Sums of 1, c, s, c², cs, s² and of the grey levels times 1, c and s, with s = −sin θ.
        let [mut n, mut c1, mut s1, mut cc, mut cs, mut ss, mut g, mut gc, mut gs] = [zero; 9];
        for i in first..=last {
            let (kept, grey, cos, sin) = (&self.kept[i], &self.greys[i], &self.cos[i], &self.sin[i]);
            for p in 0..BATCH {
                let (w, c, s) = (kept[p], kept[p] * cos[p], -kept[p] * sin[p]);
                n[p] += w;
                c1[p] += c;
                s1[p] += s;
                cc[p] += c * c;
                cs[p] += c * s;
                ss[p] += s * s;
                g[p] += w * grey[p];
                gc[p] += c * grey[p];
                gs[p] += s * grey[p];
            }
        }
        let [mut offset, mut re, mut im, mut determinant, mut squares] = [zero; 5];
        for p in 0..BATCH {
            // Cofactors of the symmetric normal matrix.
            let a = cc[p] * ss[p] - cs[p] * cs[p];
            let b = s1[p] * cs[p] - c1[p] * ss[p];
            let c = c1[p] * cs[p] - s1[p] * cc[p];
            let d = n[p] * ss[p] - s1[p] * s1[p];
            let e = s1[p] * c1[p] - n[p] * cs[p];
            let f = n[p] * cc[p] - c1[p] * c1[p];
            determinant[p] = n[p] * a + c1[p] * b + s1[p] * c;
            let scale = 1.0 / determinant[p];
            offset[p] = (a * g[p] + b * gc[p] + c * gs[p]) * scale;
            re[p] = (b * g[p] + d * gc[p] + e * gs[p]) * scale;
            im[p] = (c * g[p] + e * gc[p] + f * gs[p]) * scale;
        }
        for i in first..=last {
            let (kept, grey, cos, sin) = (&self.kept[i], &self.greys[i], &self.cos[i], &self.sin[i]);
            for p in 0..BATCH {
                let residual = grey[p] - offset[p] - re[p] * cos[p] + im[p] * sin[p];
                squares[p] += kept[p] * residual * residual;
            }
        }
        let mut solutions = Solutions {
            offset: [0.0; BATCH],
            z: [[0.0; BATCH]; 2],
            residual: [0.0; BATCH],
            determined: [false; BATCH],
        };
        for p in 0..BATCH {
            let freedom = (n[p] - MIN_STEPS as f64).max(1.0);
            let [offset, re, im, residual] =
                [offset[p], re[p], im[p], (squares[p] / freedom).sqrt()].map(|value| value as f32);
            let is_finite = (offset + re + im + residual).is_finite();
            solutions.offset[p] = offset;
            (solutions.z[0][p], solutions.z[1][p]) = (re, im);
            solutions.residual[p] = residual;
            solutions.determined[p] = n[p] >= LEAST_FITTED as f64 && determinant[p] != 0.0 && is_finite;
        }
        solutions
    }
}

/// Cosine and sine of an angle of at most some thousand turns, exact to 2e-16. Only additions and multiplications, so
/// that every machine computes the same bits. Polynomials of fdlibm.
#[inline(always)]
fn cos_sin(angle: f64) -> [f64; 2] {
    const COS: [f64; 6] = [
        4.166_666_666_666_66e-2,
        -1.388_888_888_887_411e-3,
        2.480_158_728_947_673e-5,
        -2.755_731_435_139_066_3e-7,
        2.087_572_321_298_175e-9,
        -1.135_964_755_778_819_5e-11,
    ];
    const SIN: [f64; 6] = [
        -1.666_666_666_666_663_2e-1,
        8.333_333_333_322_49e-3,
        -1.984_126_982_985_795e-4,
        2.755_731_370_707_007e-6,
        -2.505_076_025_340_686_3e-8,
        1.589_690_995_211_55e-10,
    ];
    /// A quarter turn in two parts. The first has so few bits that its product with a whole number is exact.
    const QUARTER: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];
    /// 1.5 · 2^52: adding it rounds to a whole number, whose last bits are then the last bits of the sum.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let shifted = angle * std::f64::consts::FRAC_2_PI + WHOLE;
    let (quarters, quadrant) = (shifted - WHOLE, shifted.to_bits() & 3);
    let r = angle - quarters * QUARTER[0] - quarters * QUARTER[1];
    let x = r * r;
    let [c0, c1, c2, c3, c4, c5] = COS;
    let cos = 1.0 - 0.5 * x + x * x * (c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))));
    let [s0, s1, s2, s3, s4, s5] = SIN;
    let sin = r + r * x * (s0 + x * (s1 + x * (s2 + x * (s3 + x * (s4 + x * s5)))));
    let (along, across) = if quadrant & 1 == 0 { (cos, sin) } else { (sin, cos) };
    let sign = |is_negative: bool| if is_negative { -1.0 } else { 1.0 };
    [along * sign(quadrant == 1 || quadrant == 2), across * sign(quadrant >= 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cosine_and_sine_are_exact_to_rounding() {
        for k in -40_000..40_000 {
            let angle = f64::from(k) * 0.001_37;
            let [cos, sin] = cos_sin(angle);
            assert!((cos - angle.cos()).abs() < 3e-16 && (sin - angle.sin()).abs() < 3e-16, "{angle}: {cos} {sin}");
        }
    }

    #[test]
    fn a_moving_sinusoid_is_recovered() {
        let mut batch = Batch::default();
        let motion_rad = std::array::from_fn(|p| 0.02 * p as f32 - 0.3);
        for image in 0..6 {
            let (time, shift_rad) = (image as f32 - 2.5, 1.7 * image as f32);
            batch.set_angles(image, [time, shift_rad], &motion_rad);
            for (p, motion) in motion_rad.iter().enumerate() {
                let angle = 0.4 * p as f32 + shift_rad + motion * time;
                // In the second half of the pixels the third image is saturated and does not count.
                let grey = if image == 2 && p >= BATCH / 2 { 255.0 } else { 90.0 + 50.0 * angle.cos() };
                batch.set_sample(image, p, grey, grey < 255.0);
            }
        }
        let Solutions { offset, z: [re, im], residual, determined } = batch.solve([0, 5]);
        for p in 0..BATCH {
            let phase = 0.4 * p as f32;
            assert!(determined[p] && (offset[p] - 90.0).abs() < 1e-3 && residual[p] < 1e-3);
            assert!((re[p] - 50.0 * phase.cos()).abs() < 1e-3 && (im[p] - 50.0 * phase.sin()).abs() < 1e-3);
        }
        let four_images = batch.solve([0, 3]);
        assert!((0..BATCH).all(|p| four_images.determined[p] == (p < BATCH / 2)));
    }
}

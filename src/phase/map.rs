//! The result of decoding: phase map and statistics (paper, section 2.1). Five bytes and a bool per pixel.

/// Wrapped phase of one camera, row by row.
///
/// The phase is a `u16` fraction of a turn (65536 = 2π), so wrapping subtraction yields the wrapped phase difference.
/// Its step of 1e-4 rad is far below the noise of any camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhaseMap {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Wrapped phase, turns · 65536.
    pub phase: Vec<u16>,
    /// Modulation B.
    pub modulation: Vec<Modulation>,
    /// Mean grey level A of the fringes: the texture of the scene.
    pub mean: Vec<u8>,
    /// Whether the phase is reliable, by modulation, saturation and fit residual.
    pub valid: Vec<bool>,
    /// How well sinusoids fit the images.
    pub fit: FitStatistics,
    /// Whether the image is well exposed.
    pub exposure: Exposure,
    /// Higher harmonics of the fringes.
    pub harmonics: Harmonics,
    /// Motion of the scene during the images; `None` from a single cycle, which cannot measure it.
    pub motion: Option<Motion>,
}

/// Distance of the pixels at which the brightness is sampled, pixels.
const BRIGHTNESS_STRIDE_PX: usize = 8;
/// Share of these pixels that may be brighter than the brightest grey level: hot pixels and highlights.
const BRIGHTER_SHARE: f64 = 1e-3;

impl PhaseMap {
    /// Share of the pixels without fringes: their modulation is too low for a phase, and no sample is saturated.
    #[must_use]
    pub fn unlit_share(&self) -> f64 {
        1.0 - self.exposure.lit_pixels as f64 / (self.width * self.height).max(1) as f64
    }

    /// Share of the range of grey levels above the brightest grey level of the fringes. Almost 1 if the values have
    /// fewer bits than their format.
    #[must_use]
    pub fn unused_range_share(&self) -> f64 {
        let rows = (0..self.height).step_by(BRIGHTNESS_STRIDE_PX);
        let pixels = rows.flat_map(|v| (0..self.width).step_by(BRIGHTNESS_STRIDE_PX).map(move |u| v * self.width + u));
        let mut greys: Vec<f32> = pixels.map(|i| f32::from(self.mean[i]) + self.modulation[i].grey()).collect();
        let brighter = (greys.len() as f64 * BRIGHTER_SHARE) as usize;
        let Some(index) = greys.len().checked_sub(brighter + 1) else { return 0.0 };
        let (_, brightest_grey, _) = greys.select_nth_unstable_by(index, f32::total_cmp);
        (1.0 - f64::from(*brightest_grey) / f64::from(u8::MAX)).max(0.0)
    }

    /// Changes the size. The contents of the planes are then meaningless.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        let pixels = width * height;
        self.phase.resize(pixels, 0);
        self.modulation.resize(pixels, Modulation::default());
        self.mean.resize(pixels, 0);
        self.valid.resize(pixels, false);
    }
}

/// Modulation of a pixel, in steps of 1/128 grey level up to 512 grey levels: far finer than its noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Modulation(pub(super) u16);

impl Modulation {
    /// Steps per grey level.
    pub(super) const PER_GREY: f32 = 128.0;

    /// From grey levels, rounded down and limited to the range.
    #[must_use]
    #[inline]
    pub fn from_grey(grey: f32) -> Self {
        Self((grey * Self::PER_GREY) as u16)
    }

    /// From steps.
    #[must_use]
    #[inline]
    pub fn from_steps(steps: u16) -> Self {
        Self(steps)
    }

    /// As steps.
    #[must_use]
    #[inline]
    pub fn steps(self) -> u16 {
        self.0
    }

    /// As grey levels.
    #[must_use]
    #[inline]
    pub fn grey(self) -> f32 {
        f32::from(self.0) / Self::PER_GREY
    }
}

/// Statistics of the sinusoid fit over the valid pixels of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitStatistics {
    /// Number of valid pixels.
    pub valid_pixels: u64,
    /// Median of fit residual ÷ modulation; `None` for three steps, which any three images fit exactly.
    pub residual_share: Option<f32>,
    /// Standard deviation of the grey levels about the fit, not less than the rounding of the samples.
    pub noise_grey: f32,
    /// Standard deviation of the phase per unit of noise ÷ modulation; √(2/N) for N evenly spaced shifts.
    pub noise_gain: f32,
}

/// Motion of the scene during a window, over the valid pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Median of the phase motion per image, rad, signed.
    pub median_rad: f32,
    /// 95 % quantile of its magnitude, rad.
    pub fast_rad: f32,
    /// Largest deviation of the brightness of an image from the mean, relative to it. It is compensated.
    pub brightness_share: f32,
    /// Pixels whose images show more than one surface, decoded from the images of one of them.
    pub one_surface_pixels: u64,
    /// Lit pixels without a phase: too few of their images show one surface, or the phase moves too fast.
    pub lost_pixels: u64,
}

/// Exposure of an image over its lit pixels: those with enough modulation to be valid, and those with saturated
/// samples. Pixels outside the light of the projector or outside the object count nowhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exposure {
    /// Lit pixels.
    pub lit_pixels: u64,
    /// Lit pixels with a saturated sample.
    pub saturated_pixels: u64,
    /// Lit pixels without a saturated sample whose modulation is less than three times the minimum of a valid pixel.
    pub dim_pixels: u64,
}

/// A pixel is dim below this multiple of the minimum modulation. There, with four steps, one grey level of noise causes
/// a δ of 0.05 rad, as much as a usual calibration error.
pub(super) const DIM: f32 = 3.0;

impl Exposure {
    /// Counts a pixel.
    pub(super) fn add(&mut self, is_saturated: bool, modulation_grey: f32, least_grey: f32) {
        self.lit_pixels += u64::from(is_saturated || modulation_grey >= least_grey);
        self.saturated_pixels += u64::from(is_saturated);
        self.dim_pixels += u64::from(!is_saturated && (least_grey..DIM * least_grey).contains(&modulation_grey));
    }

    /// Sum of both counts.
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            lit_pixels: self.lit_pixels + other.lit_pixels,
            saturated_pixels: self.saturated_pixels + other.saturated_pixels,
            dim_pixels: self.dim_pixels + other.dim_pixels,
        }
    }
}

/// Amplitudes of the higher harmonics of the fringes, relative to the fundamental. `None` if the shifts do not
/// determine them: three steps determine neither, four only the second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harmonics {
    /// Amplitude of the second harmonic.
    pub second_share: Option<f32>,
    /// Amplitude of the third harmonic.
    pub third_share: Option<f32>,
}

//! What decoding yields.

/// Wrapped phase of one camera, row by row.
///
/// The phase is a `u16` fraction of a turn (65536 = 2π): wrapping subtraction of two of them is the wrapped phase
/// difference, and its step of 1e-4 rad lies far below the noise of any camera.
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
    /// Mean grey level A of the fringes, the texture of the scene.
    pub mean: Vec<u8>,
    /// Whether the phase can be trusted: modulation, saturation and fit residual.
    pub valid: Vec<bool>,
    /// How well sinusoids fit the images.
    pub fit: FitStatistics,
    /// Whether it was lit as it should be.
    pub exposure: Exposure,
    /// What the fringes have beside their sinusoid.
    pub harmonics: Harmonics,
    /// How the scene moved while the images were taken; `None` where N images alone cannot tell.
    pub motion: Option<Motion>,
}

impl PhaseMap {
    /// Gives it another size; what its planes hold is of no meaning then.
    pub(super) fn resize(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        let pixels = width * height;
        self.phase.resize(pixels, 0);
        self.modulation.resize(pixels, Modulation::default());
        self.mean.resize(pixels, 0);
        self.valid.resize(pixels, false);
    }
}

/// Modulation of a pixel, in steps of 1/128 grey level, 512 grey levels at most: far finer than its noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Modulation(pub(super) u16);

impl Modulation {
    /// Steps of a grey level.
    pub(super) const PER_GREY: f32 = 128.0;

    /// That of so many grey levels, rounded down; what is more than it can say is its most.
    #[must_use]
    #[inline]
    pub fn from_grey(grey: f32) -> Self {
        Self((grey * Self::PER_GREY) as u16)
    }

    /// That of so many steps.
    #[must_use]
    #[inline]
    pub fn from_steps(steps: u16) -> Self {
        Self(steps)
    }

    /// In steps.
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
    /// Median of fit residual ÷ modulation; `None` for three steps, which fit any three images.
    pub residual_share: Option<f32>,
    /// Standard deviation of the grey levels about the fit; at least that of rounding to whole grey levels.
    pub noise_grey: f32,
    /// Standard deviation of the phase per unit of noise ÷ modulation; √(2/N) for N evenly spaced shifts.
    pub noise_gain: f32,
}

/// How the scene of a window moved, over the valid pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Median phase moved from image to image, rad; its sign is that of the phase.
    pub median_rad: f32,
    /// What the amount of it exceeds at one pixel in twenty, rad.
    pub fast_rad: f32,
    /// Greatest departure of the brightness of an image from the mean of all, as a share of it; it is compensated.
    pub brightness_share: f32,
    /// Pixels whose images show more than one surface, decoded from those that show one.
    pub one_surface_pixels: u64,
    /// Pixels left out: lit, but of their images too few show one surface, or the phase moves too fast.
    pub lost_pixels: u64,
}

/// How the lit pixels of an image were lit: those with the least modulation of a valid pixel, and those with saturated samples.
/// What the projector does not reach, or an object does not fill, is not lit, and counts nowhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exposure {
    /// Lit pixels.
    pub lit_pixels: u64,
    /// Of these, pixels with a saturated sample.
    pub saturated_pixels: u64,
    /// Of these, pixels without one that are modulated by less than three times what a valid pixel needs.
    pub dim_pixels: u64,
}

/// Modulation of a pixel that is not dim, in that of one that is barely valid: there a grey level of noise makes as much δ, 0.05
/// rad with four steps, as the error of a usual calibration.
pub(super) const DIM: f32 = 3.0;

impl Exposure {
    /// Counts a pixel.
    pub(super) fn add(&mut self, is_saturated: bool, modulation_grey: f32, least_grey: f32) {
        self.lit_pixels += u64::from(is_saturated || modulation_grey >= least_grey);
        self.saturated_pixels += u64::from(is_saturated);
        self.dim_pixels += u64::from(!is_saturated && (least_grey..DIM * least_grey).contains(&modulation_grey));
    }

    /// These pixels and others.
    pub(super) fn plus(self, other: Self) -> Self {
        Self {
            lit_pixels: self.lit_pixels + other.lit_pixels,
            saturated_pixels: self.saturated_pixels + other.saturated_pixels,
            dim_pixels: self.dim_pixels + other.dim_pixels,
        }
    }
}

/// Amplitudes of the harmonics of the fringes beside the sinusoid, in its own; `None` where the shifts do not tell: of the
/// second with three steps, of the third with four.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harmonics {
    /// Of the second.
    pub second_share: Option<f32>,
    /// Of the third.
    pub third_share: Option<f32>,
}

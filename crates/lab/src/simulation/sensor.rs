//! The sensor of a camera: converts light to grey levels, with noise.
//!
//! In: a [`View`] and a projected pattern. Out: an image of 8 to 16 bits. Noise is drawn per image and row from a seed,
//! so the result does not depend on the number of threads.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use fringeflow_base::grey::PixelFormat;
use fringeflow_dataset::GreyImage;
use fringeflow_patterns::Pattern;

use super::SimulationError;
use super::colour_filter::ColourFilter;
use super::normal::standard_normal;
use super::view::View;

/// Noise of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Electrons at grey level 255. Their number has Poisson noise.
    pub full_well_e: f64,
    /// Standard deviation of the read noise, electrons.
    pub read_noise_e: f64,
    /// Standard deviation of the sensitivity of the pixels, relative.
    pub prnu: f64,
}

/// Named noise levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoiseLevel {
    /// Rounding to whole values only.
    None,
    /// A good industrial camera, well lit.
    Low,
    /// An industrial camera at the short exposures of a moving scanner.
    Normal,
    /// Too little light.
    High,
}

/// Light and electronics of the virtual scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Grey level of a white surface that faces the fully lit projector.
    pub gain: f64,
    /// Ambient light, relative to the light of the projector.
    pub ambient: f64,
    /// Light that the projector leaks where it shows black, relative.
    pub leak: f64,
    /// Exponent of the projector: light = brightness^gamma.
    pub gamma: f64,
    /// Grey level without light.
    pub black_level: f64,
    /// Noise; `None` for rounding only.
    pub noise: Option<Noise>,
    /// Storage format, which determines the rounding.
    pub format: PixelFormat,
    /// Colour filters on the pixels.
    pub filter: ColourFilter,
}

/// Seeds of the random numbers of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSeed {
    /// Seed of the whole sequence.
    pub seed: u64,
    /// Number of the camera. Each camera has its own sensitivity pattern.
    pub camera: u8,
    /// Number of the image in the sequence.
    pub image: u32,
}

impl Noise {
    /// The noise of the sum of `side` × `side` pixels: their electrons and the squares of their deviations add up.
    #[must_use]
    pub fn binned(self, side: usize) -> Self {
        let side = side as f64;
        Self {
            full_well_e: self.full_well_e * side * side,
            read_noise_e: self.read_noise_e * side,
            prnu: self.prnu / side,
        }
    }
}

impl NoiseLevel {
    /// All levels, from low to high noise.
    pub const ALL: [Self; 4] = [Self::None, Self::Low, Self::Normal, Self::High];

    /// Name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Low => "low",
            Self::Normal => "normal",
            Self::High => "high",
        }
    }

    /// The noise of this level.
    #[must_use]
    pub fn noise(self) -> Option<Noise> {
        match self {
            Self::None => None,
            Self::Low => Some(Noise { full_well_e: 60_000.0, read_noise_e: 10.0, prnu: 0.002 }),
            Self::Normal => Some(Noise { full_well_e: 20_000.0, read_noise_e: 25.0, prnu: 0.004 }),
            Self::High => Some(Noise { full_well_e: 6_000.0, read_noise_e: 40.0, prnu: 0.008 }),
        }
    }
}

impl std::str::FromStr for NoiseLevel {
    type Err = SimulationError;

    fn from_str(name: &str) -> Result<Self, SimulationError> {
        let known = Self::ALL.into_iter().find(|level| level.name() == name);
        known.ok_or_else(|| SimulationError::UnknownNoise { name: name.to_owned() })
    }
}

impl Sensor {
    /// Creates an 8-bit sensor, exposed so that bright parts have a modulation of 80 to 100 grey levels and nothing
    /// saturates.
    #[must_use]
    pub fn exposed(noise: Option<Noise>, gamma: f64) -> Self {
        Self {
            gain: 262.0,
            ambient: 0.03,
            leak: 0.015,
            gamma,
            black_level: 2.0,
            noise,
            format: PixelFormat::Grey,
            filter: ColourFilter::None,
        }
    }

    /// Returns the image of a pattern.
    #[must_use]
    pub fn image(&self, view: &View, pattern: &Pattern, seed: ImageSeed) -> GreyImage {
        let sensitivity = self.sensitivity([view.width, view.height], seed);
        self.exposure((view, &[]), pattern, &sensitivity, seed)
    }

    /// Returns the sensitivity of the pixels of a camera, which is the same in all its images.
    pub(super) fn sensitivity(&self, [width, height]: [usize; 2], seed: ImageSeed) -> Sensitivity {
        let prnu = self.noise.map_or(0.0, |noise| noise.prnu);
        let rows = if prnu > 0.0 { height } else { 0 };
        let deviations = (0..rows).into_par_iter().flat_map_iter(|row| {
            let mut rng = row_generator(seed, self.filter.sensor_number(), SENSITIVITY, row);
            (0..width).map(move |_| prnu * standard_normal(&mut rng))
        });
        Sensitivity { deviations: deviations.collect() }
    }

    /// Returns the image of a pattern on a scene that moves while the shutter is open. The light is the mean over the
    /// view in the middle of the exposure and the other views of the same camera, before noise and rounding.
    pub(super) fn exposure(
        &self,
        (middle, others): (&View, &[View]),
        pattern: &Pattern,
        sensitivity: &Sensitivity,
        seed: ImageSeed,
    ) -> GreyImage {
        let (view, bytes) = (middle, self.format.bytes());
        let mut pixels = vec![0; view.width * view.height * bytes];
        pixels.par_chunks_mut((view.width * bytes).max(1)).enumerate().for_each(|(v, row)| {
            let mut rng = row_generator(seed, self.filter.sensor_number(), seed.image, v);
            for (u, pixel) in row.chunks_exact_mut(bytes).enumerate() {
                let grey = |view: &View| self.grey(view, pattern, v * view.width + u);
                let grey = (grey(middle) + others.iter().map(grey).sum::<f64>()) / (1 + others.len()) as f64;
                let noisy = self.noise.map_or(grey, |noise| {
                    noise.applied(grey, sensitivity.deviation(v * view.width + u), standard_normal(&mut rng))
                });
                pixel.copy_from_slice(&self.value(noisy).to_le_bytes()[..bytes]);
            }
        });
        GreyImage { width: view.width, height: view.height, format: self.format, pixels }
    }

    /// Returns the stored value nearest to a grey level.
    fn value(&self, grey: f64) -> u16 {
        let value = grey / f64::from(self.format.grey_per_value());
        value.round().clamp(0.0, self.format.max_value().into()) as u16
    }

    /// Grey level of a pixel before noise and rounding. `index` counts row by row and is below `width · height`.
    #[must_use]
    pub fn grey(&self, view: &View, pattern: &Pattern, index: usize) -> f64 {
        let samples = view.pixel(index);
        let light = |sample: &super::view::Sample| {
            let ambient = f64::from(sample.albedo) * self.ambient;
            if sample.reflected <= 0.0 {
                return ambient;
            }
            let shown = pattern.brightness(f64::from(sample.column_px), f64::from(sample.row_px));
            let shown = if self.gamma == 1.0 { shown } else { shown.powf(self.gamma) };
            ambient + f64::from(sample.reflected) * (self.leak + (1.0 - self.leak) * shown)
        };
        let (u, v) = (index % view.width.max(1), index / view.width.max(1));
        let gain = self.gain * self.filter.passed(u, v);
        self.black_level + gain * samples.iter().map(light).sum::<f64>() / samples.len().max(1) as f64
    }
}

/// Sensitivity of the pixels of a camera.
pub(super) struct Sensitivity {
    /// Relative deviations from the mean, row by row; empty if there are none.
    deviations: Vec<f64>,
}

impl Sensitivity {
    pub(super) fn deviation(&self, index: usize) -> f64 {
        self.deviations.get(index).copied().unwrap_or_default()
    }
}

/// Stands for the number of the image where the sensitivity is drawn.
const SENSITIVITY: u32 = u32::MAX;

/// Returns the generator for a row of an image.
fn row_generator(seed: ImageSeed, sensor: u8, image: u32, row: usize) -> ChaCha8Rng {
    let mut key = [0; 32];
    key[..8].copy_from_slice(&seed.seed.to_le_bytes());
    key[8] = seed.camera;
    key[9] = sensor;
    key[12..16].copy_from_slice(&image.to_le_bytes());
    key[16..24].copy_from_slice(&(row as u64).to_le_bytes());
    ChaCha8Rng::from_seed(key)
}

impl Noise {
    /// Returns a grey level with shot and read noise, at a pixel whose sensitivity deviates by a share. `normal` is a
    /// standard normal number.
    pub(super) fn applied(&self, grey: f64, deviation: f64, normal: f64) -> f64 {
        let per_electron = 255.0 / self.full_well_e;
        let electrons = grey / per_electron * (1.0 + deviation);
        // With hundreds of electrons or more, the Poisson distribution is close to a normal distribution.
        let sd = (electrons.max(0.0) + self.read_noise_e * self.read_noise_e).sqrt();
        (electrons + sd * normal) * per_electron
    }
}

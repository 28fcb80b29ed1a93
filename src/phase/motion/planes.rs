//! The images of a window, and the planes of numbers that are computed from them, row by row in parallel.

use rayon::prelude::*;

use crate::grey::{GreyLevels, PixelFormat};
use crate::phase::Validity;
use crate::phase::harmonics::{self, Samples};
use crate::phase::map::{FitStatistics, Harmonics, Modulation, Motion, PhaseMap};
use crate::phase::residuals::{Residuals, quantile};
use crate::phase::sample::Sample;
use crate::simd::{self, Kernel, Lanes, Level};

use super::brightness;
use super::estimate;
use super::fit::{MotionFit, time};
use super::moved::Moved;
use super::one_surface::{OneSurface, Repaired};

/// Pixels of a row that are computed together: what they need stays in the first-level cache.
pub(super) const TILE: usize = 256;
/// Bins of the histogram of motions, and the range to either side that they cover, rad.
const MOTION_BINS: usize = 1024;
const MOTION_RANGE_RAD: f32 = 1.5;

/// The images of a window, by what they store for a pixel.
pub(super) enum Stack<'a> {
    /// 8 bits.
    Bytes(Window<'a, u8>),
    /// More.
    Words(Window<'a, [u8; 2]>),
}

/// The images of a window.
pub(super) struct Window<'a, S> {
    pub(super) images: Vec<&'a [S]>,
    pub(super) width: usize,
    height: usize,
    format: PixelFormat,
    /// Value from which on a sample is saturated.
    saturation: S,
    /// Grey levels of a value, image by image: what differs is the brightness that is compensated.
    pub(super) grey_per_value: Vec<f32>,
}

/// What the fit leaves at every pixel.
pub(super) struct Fitted {
    /// Offset A, grey levels.
    pub(super) offset: Vec<f32>,
    /// z and z' as they are fitted without A', ripple and all.
    pub(super) z: [Vec<f32>; 2],
    pub(super) slope: [Vec<f32>; 2],
    /// How much a pixel says of the motion, 0 to 1: those at edges, whose images show two surfaces, say little.
    pub(super) weight: Vec<f32>,
    /// z as it is fitted with A', ripple and all.
    pub(super) phase_z: [Vec<f32>; 2],
}

/// What is known of every pixel before those are seen to whose images show more than one surface.
pub(super) struct Decoded {
    pub(super) map: PhaseMap,
    /// Motion, rad an image; NaN where it is not known.
    pub(super) motion_rad: Vec<f32>,
    /// Standard deviation of the samples about the fit, grey levels.
    pub(super) residual: Vec<f32>,
}

impl<'a> Stack<'a> {
    pub(super) fn of(images: &[GreyLevels<'a>], width: usize, height: usize, validity: &Validity) -> Option<Self> {
        let format = images.first()?.format;
        let fits =
            |image: &GreyLevels<'_>| image.format == format && image.bytes.len() == width * height * format.bytes();
        if !images.iter().all(fits) {
            return None;
        }
        let bytes = images.iter().map(|image| image.bytes);
        let grey = validity.saturation_grey;
        Some(match format {
            PixelFormat::Grey => Self::Bytes(Window::new(bytes.collect(), width, height, format, grey)),
            _ => {
                let words = bytes.map(|bytes| bytes.as_chunks().0).collect();
                Self::Words(Window::new(words, width, height, format, grey))
            }
        })
    }
}

impl<'a, S: Sample> Window<'a, S> {
    fn new(images: Vec<&'a [S]>, width: usize, height: usize, format: PixelFormat, saturation_grey: u8) -> Self {
        let grey_per_value = vec![format.grey_per_value(); images.len()];
        let saturation = S::from_grey(saturation_grey, format);
        Self { images, width, height, format, saturation, grey_per_value }
    }

    pub(super) fn decode(mut self, fit: &MotionFit, validity: &Validity) -> PhaseMap {
        let brightness_share = brightness::compensate(&mut self, fit, validity);
        let fitted = self.fit(fit, validity);
        let motion_rad = estimate::motion(fit, &fitted, [self.width, self.height]);
        let (mut decoded, residuals) = self.without_ripple(fit, &fitted, motion_rad, validity);
        let statistics = residuals.statistics(fit.freedom(), self.format, fit.noise_gain());
        let one_surface = OneSurface::new(&self, fit, validity, &statistics);
        let Repaired { one_surface_pixels, lost_pixels, exposure } = one_surface.repair(&mut decoded);
        decoded.map.exposure = exposure;
        decoded.map.harmonics = self.harmonics(fit, &decoded);
        decoded.finish(statistics, Motion { brightness_share, one_surface_pixels, lost_pixels, ..Motion::default() })
    }

    pub(super) fn height(&self) -> usize {
        self.height
    }

    /// Grey level of a pixel in an image, its brightness compensated.
    pub(super) fn grey(&self, image: usize, pixel: usize) -> f32 {
        self.images[image][pixel].grey(self.grey_per_value[image])
    }

    /// Whether a sample is saturated.
    pub(super) fn is_saturated(&self, image: usize, pixel: usize) -> bool {
        !self.images[image][pixel].is_below(self.saturation)
    }

    /// Whether any sample of a pixel is saturated, pixel by pixel.
    pub(super) fn find_saturated(&self, pixels: std::ops::Range<usize>, saturated: &mut Vec<bool>) {
        saturated.clear();
        saturated.resize(pixels.len(), false);
        for image in &self.images {
            for (saturated, sample) in saturated.iter_mut().zip(&image[pixels.clone()]) {
                *saturated |= !sample.is_below(self.saturation);
            }
        }
    }

    /// The harmonics of the fringes, the motion taken off.
    fn harmonics(&self, fit: &MotionFit, decoded: &Decoded) -> Harmonics {
        let (shifts, images) = (fit.shifts_rad(), self.images.len());
        harmonics::measure(shifts, self.width * self.height, |pixel, out: &mut Samples| {
            let motion_rad = f64::from(decoded.motion_rad[pixel]);
            let sample = |image: usize| {
                let t = time(image, images);
                [f64::from(self.grey(image, pixel)), shifts[image] + motion_rad * t, t]
            };
            out.extend((0..images).map(sample));
            decoded.map.valid[pixel]
                && motion_rad.is_finite()
                && !(0..images).any(|image| self.is_saturated(image, pixel))
        })
    }

    /// Offset, z and the motion's parts of every pixel.
    fn fit(&self, fit: &MotionFit, validity: &Validity) -> Fitted {
        let pixels = self.width * self.height;
        let plane = || vec![0.0; pixels];
        let mut fitted = Fitted {
            offset: plane(),
            z: [plane(), plane()],
            slope: [plane(), plane()],
            weight: plane(),
            phase_z: [plane(), plane()],
        };
        let ([re, im], [re_slope, im_slope], [phase_re, phase_im]) =
            (&mut fitted.z, &mut fitted.slope, &mut fitted.phase_z);
        let tiles = fitted
            .offset
            .par_chunks_mut(TILE)
            .zip(re.par_chunks_mut(TILE))
            .zip(im.par_chunks_mut(TILE))
            .zip(re_slope.par_chunks_mut(TILE))
            .zip(im_slope.par_chunks_mut(TILE))
            .zip(phase_re.par_chunks_mut(TILE))
            .zip(phase_im.par_chunks_mut(TILE))
            .zip(fitted.weight.par_chunks_mut(TILE))
            .enumerate();
        tiles.for_each(|(tile, (((((((offset, re), im), re_slope), im_slope), phase_re), phase_im), weight))| {
            let planes = [offset, re, im, re_slope, im_slope, phase_re, phase_im];
            let tile = FitTile { window: self, fit, validity, first: tile * TILE, planes, weight };
            simd::run(Level::in_use(), tile);
        });
        fitted
    }

    /// Takes the ripple off that the motion makes, and sees how well the images fit then.
    fn without_ripple(
        &self,
        fit: &MotionFit,
        fitted: &Fitted,
        motion_rad: Vec<f32>,
        validity: &Validity,
    ) -> (Decoded, Residuals) {
        let pixels = self.width * self.height;
        let mut map = PhaseMap::empty(self.width, self.height);
        let mut residual = vec![0.0; pixels];
        let width = self.width.max(1);
        let rows = map
            .phase
            .par_chunks_mut(width)
            .zip(map.modulation.par_chunks_mut(width))
            .zip(map.mean.par_chunks_mut(width))
            .zip(map.valid.par_chunks_mut(width))
            .zip(motion_rad.par_chunks(width))
            .zip(residual.par_chunks_mut(width))
            .enumerate();
        let residuals = rows
            .fold(
                Residuals::default,
                |mut residuals, (v, (((((phase, modulation), mean), valid), motion), residual))| {
                    for first in (0..width).step_by(TILE) {
                        let tile = first..(first + TILE).min(width);
                        let kernel = MovedTile {
                            window: self,
                            fit,
                            fitted,
                            validity,
                            pixels: v * width + tile.start..v * width + tile.end,
                            motion_rad: &motion[tile.clone()],
                            phase: &mut phase[tile.clone()],
                            modulation: &mut modulation[tile.clone()],
                            mean: &mut mean[tile.clone()],
                            valid: &mut valid[tile.clone()],
                            residual: &mut residual[tile],
                        };
                        simd::run(Level::in_use(), kernel);
                    }
                    for u in (0..width).filter(|&u| valid[u]) {
                        residuals.add(residual[u], modulation[u].grey());
                    }
                    residuals
                },
            )
            .reduce(Residuals::default, Residuals::merge);
        (Decoded { map, motion_rad, residual }, residuals)
    }
}

impl Decoded {
    fn finish(mut self, statistics: FitStatistics, motion: Motion) -> PhaseMap {
        let (mut signed, mut amount) = (vec![0_u64; MOTION_BINS], vec![0_u64; MOTION_BINS]);
        let bin = |share: f32| ((share * MOTION_BINS as f32) as usize).min(MOTION_BINS - 1);
        for (motion, _) in self.motion_rad.iter().zip(&self.map.valid).filter(|(m, valid)| **valid && m.is_finite()) {
            signed[bin(0.5 + 0.5 * motion / MOTION_RANGE_RAD)] += 1;
            amount[bin(motion.abs() / MOTION_RANGE_RAD)] += 1;
        }
        let valid_pixels = self.map.valid.iter().filter(|valid| **valid).count() as u64;
        self.map.fit = FitStatistics { valid_pixels, ..statistics };
        let [median_rad, fast_rad] = if signed.iter().all(|&n| n == 0) {
            [0.0; 2]
        } else {
            [(quantile(&signed, 0.5) - 0.5) * 2.0 * MOTION_RANGE_RAD, quantile(&amount, 0.95) * MOTION_RANGE_RAD]
        };
        self.map.motion = Some(Motion { median_rad, fast_rad, ..motion });
        self.map
    }
}

/// Fits the pixels of a tile, from `first` on.
struct FitTile<'a, 'b, S> {
    window: &'a Window<'b, S>,
    fit: &'a MotionFit,
    validity: &'a Validity,
    first: usize,
    /// Where the values of the fit go.
    planes: [&'a mut [f32]; 7],
    weight: &'a mut [f32],
}

impl<S: Sample> Kernel for FitTile<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let count = self.weight.len();
        let sums = LinearFit::of(self.window, self.fit, self.first..self.first + count);
        for (plane, values) in self.planes.into_iter().zip(&sums.values) {
            plane.copy_from_slice(&values[..count]);
        }
        sums.weigh(self.validity, self.weight);
    }
}

/// Decodes the pixels of a tile whose motion is known.
struct MovedTile<'a, 'b, S> {
    window: &'a Window<'b, S>,
    fit: &'a MotionFit,
    fitted: &'a Fitted,
    validity: &'a Validity,
    pixels: std::ops::Range<usize>,
    motion_rad: &'a [f32],
    phase: &'a mut [u16],
    modulation: &'a mut [Modulation],
    mean: &'a mut [u8],
    valid: &'a mut [bool],
    residual: &'a mut [f32],
}

impl<S: Sample> Kernel for MovedTile<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let mut moved = Moved::of(&self.fit.fine, &self.fitted.phase_z, self.pixels, self.motion_rad);
        moved.fit_images(self.window, self.fit, self.fitted);
        moved.finish(self.validity, self.phase, self.modulation, self.mean, self.valid);
        self.residual.copy_from_slice(&moved.residual[..self.residual.len()]);
    }
}

/// The linear fit of a tile: A, Re z, Im z, Re z', Im z' without A', Re z, Im z with it, and the squares of what the former
/// leaves.
struct LinearFit {
    values: [[f32; TILE]; 7],
    squares: [f32; TILE],
    /// Whether a sample is saturated.
    saturated: [bool; TILE],
}

impl LinearFit {
    #[inline(always)]
    fn of<S: Sample>(window: &Window<'_, S>, fit: &MotionFit, pixels: std::ops::Range<usize>) -> Self {
        let mut sums = Self { values: [[0.0; TILE]; 7], squares: [0.0; TILE], saturated: [false; TILE] };
        for (i, image) in window.images.iter().enumerate() {
            let (samples, grey_per_value) = (&image[pixels.clone()], window.grey_per_value[i]);
            for (values, weights) in sums.values.iter_mut().zip(fit.weights.iter().chain(&fit.phase_weights)) {
                for (value, sample) in values.iter_mut().zip(samples) {
                    *value += weights[i] * sample.grey(grey_per_value);
                }
            }
            for (saturated, sample) in sums.saturated.iter_mut().zip(samples) {
                *saturated |= !sample.is_below(window.saturation);
            }
        }
        for weights in &fit.residuals {
            let mut left = [0.0_f32; TILE];
            for ((image, weight), grey_per_value) in window.images.iter().zip(weights).zip(&window.grey_per_value) {
                for (left, sample) in left.iter_mut().zip(&image[pixels.clone()]) {
                    *left += weight * sample.grey(*grey_per_value);
                }
            }
            sums.squares.iter_mut().zip(&left).for_each(|(sum, left)| *sum += left * left);
        }
        sums
    }

    /// How much the pixels say of the motion.
    #[inline(always)]
    fn weigh(&self, validity: &Validity, weight: &mut [f32]) {
        /// Residual ÷ modulation at which the weight has fallen to a half.
        const HALF_WEIGHT_SHARE: f32 = 0.1;
        /// Clipping distorts z' more than z: such pixels are asked where there are no others.
        const SATURATED_WEIGHT: f32 = 1e-3;
        let [_, re, im, ..] = &self.values;
        let least = validity.min_modulation_grey * validity.min_modulation_grey;
        for (p, weight) in weight.iter_mut().enumerate() {
            let square = re[p] * re[p] + im[p] * im[p];
            let half = HALF_WEIGHT_SHARE * HALF_WEIGHT_SHARE * square;
            let trusted = if self.saturated[p] { SATURATED_WEIGHT } else { 1.0 };
            *weight = if square >= least { trusted * half / (half + self.squares[p]) } else { 0.0 };
        }
    }
}

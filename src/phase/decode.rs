//! N-step decoding: sums of sines and cosines first, one arctangent a pixel.

use rayon::prelude::*;

use crate::grey::{GreyLevels, PixelFormat};

use super::arctangent::turn_fraction;
use super::harmonics::{self, Samples};
use super::map::{Exposure, PhaseMap};
use super::residuals::Residuals;
use super::sample::Sample;
use super::shifts::{MAX_STEPS, MIN_STEPS, PhaseShifts};

/// Pixels decoded together: the sums of a tile stay in the first-level cache, and few input streams are open at once.
const TILE: usize = 512;

/// What makes a phase trustworthy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validity {
    /// Least modulation, grey levels.
    pub min_modulation_grey: f32,
    /// Grey level from which on a sample is saturated and left out of the fit. Of deeper images 255 is 255 · 2^(bits − 8)
    /// and more, such as 4080 to 4095 of 12 bits: what 8 bits of the same light would show as 255.
    pub saturation_grey: u8,
    /// Largest fit residual (standard deviation of the grey levels about the sinusoid) ÷ modulation.
    ///
    /// Gamma and clipping leave residuals of 0.2 to 0.6 with a phase that is still useful; a lost or swapped image, or an
    /// edge that moved, leaves more.
    pub max_residual_share: f32,
}

impl Default for Validity {
    fn default() -> Self {
        Self { min_modulation_grey: 5.0, saturation_grey: 255, max_residual_share: 1.0 }
    }
}

/// Decodes the N images of one camera, each `width · height` grey levels row by row.
///
/// `None` if there are not as many images as shifts, or an image has another size or depth.
///
/// Formula: with the least-squares sums A, C = B·cos φ and S = B·sin φ of [`PhaseShifts`], φ = atan2(S, C) and
/// B = hypot(S, C); for equal spacing this is `atan2(−Σ I_k sin s_k, Σ I_k cos s_k)`. Saturated samples are left
/// out where three or more others remain.
#[must_use]
pub fn decode(
    images: &[GreyLevels<'_>],
    width: usize,
    height: usize,
    shifts: &PhaseShifts,
    validity: &Validity,
) -> Option<PhaseMap> {
    let pixels = width * height;
    let format = images.first()?.format;
    let fits = |image: &GreyLevels<'_>| image.format == format && image.bytes.len() == pixels * format.bytes();
    if images.len() != shifts.steps() || !images.iter().all(fits) {
        return None;
    }
    let mut map = PhaseMap::empty(width, height);
    let bytes = images.iter().map(|image| image.bytes);
    let residuals = match format {
        PixelFormat::Grey => decode_images(&bytes.collect::<Vec<&[u8]>>(), format, shifts, validity, &mut map),
        _ => {
            let samples: Vec<&[[u8; 2]]> = bytes.map(|bytes| bytes.as_chunks().0).collect();
            decode_images(&samples, format, shifts, validity, &mut map)
        }
    };
    map.fit = residuals.statistics(shifts.steps() - MIN_STEPS, format, shifts.noise_gain() as f32);
    Some(map)
}

/// Decodes all tiles, and measures what all of them tell together.
fn decode_images<S: Sample>(
    images: &[&[S]],
    format: PixelFormat,
    shifts: &PhaseShifts,
    validity: &Validity,
    map: &mut PhaseMap,
) -> Residuals {
    let (residuals, exposure) = decode_tiles(images, format, shifts, validity, map);
    let (grey_per_value, saturation) = (format.grey_per_value(), S::from_grey(validity.saturation_grey, format));
    map.exposure = exposure;
    map.harmonics = harmonics::measure(shifts.shifts_rad(), map.phase.len(), |pixel, out: &mut Samples| {
        let samples = || images.iter().map(|image| image[pixel]).zip(shifts.shifts_rad());
        out.extend(samples().map(|(value, shift)| [f64::from(value.grey(grey_per_value)), *shift, 0.0]));
        map.valid[pixel] && samples().all(|(value, _)| value.is_below(saturation))
    });
    residuals
}

/// Decodes all tiles in parallel and merges their counts; whole numbers add up the same in any order.
fn decode_tiles<S: Sample>(
    images: &[&[S]],
    format: PixelFormat,
    shifts: &PhaseShifts,
    validity: &Validity,
    map: &mut PhaseMap,
) -> (Residuals, Exposure) {
    let (grey_per_value, saturation) = (format.grey_per_value(), S::from_grey(validity.saturation_grey, format));
    let tiles = map
        .phase
        .par_chunks_mut(TILE)
        .zip(map.modulation.par_chunks_mut(TILE))
        .zip(map.mean.par_chunks_mut(TILE))
        .zip(map.valid.par_chunks_mut(TILE))
        .enumerate();
    tiles
        .fold(
            <(Residuals, Exposure)>::default,
            |(mut residuals, mut exposure), (i, (((phase, modulation), mean), valid))| {
                let range = i * TILE..i * TILE + phase.len();
                let mut samples: [&[S]; MAX_STEPS] = [&[]; MAX_STEPS];
                for (sample, image) in samples.iter_mut().zip(images) {
                    *sample = &image[range.clone()];
                }
                let samples = &samples[..images.len()];
                let mut sums = Sums::new();
                sums.accumulate(samples, grey_per_value, shifts);
                sums.leave_out_saturated(samples, grey_per_value, saturation, shifts);
                sums.finish(shifts.steps(), validity, phase, modulation, mean, valid);
                residuals.add(&sums.residual, modulation, valid);
                for (&saturated, &modulation) in sums.saturated.iter().zip(&*modulation) {
                    exposure.add(saturated, modulation, validity.min_modulation_grey);
                }
                (residuals, exposure)
            },
        )
        .reduce(Default::default, |(residuals, exposure), others| (residuals.merge(others.0), exposure.plus(others.1)))
}

/// Least-squares sums of a tile, and the residual about them.
struct Sums {
    offset: [f32; TILE],
    cosine: [f32; TILE],
    sine: [f32; TILE],
    /// Standard deviation of the samples about the fit; infinite where too few samples are unsaturated.
    residual: [f32; TILE],
    /// Whether a sample is saturated.
    saturated: [bool; TILE],
}

impl Sums {
    fn new() -> Self {
        Self {
            offset: [0.0; TILE],
            cosine: [0.0; TILE],
            sine: [0.0; TILE],
            residual: [0.0; TILE],
            saturated: [false; TILE],
        }
    }

    fn accumulate<S: Sample>(&mut self, samples: &[&[S]], grey_per_value: f32, shifts: &PhaseShifts) {
        let [w_offset, w_cosine, w_sine] = shifts.weights();
        for (k, sample) in samples.iter().enumerate() {
            let (wo, wc, ws) = (w_offset[k], w_cosine[k], w_sine[k]);
            let sums = self.offset.iter_mut().zip(&mut self.cosine).zip(&mut self.sine);
            for (((offset, cosine), sine), value) in sums.zip(*sample) {
                let grey = value.grey(grey_per_value);
                *offset += wo * grey;
                *cosine += wc * grey;
                *sine += ws * grey;
            }
        }
        let freedom = samples.len() - MIN_STEPS;
        if freedom == 0 {
            return;
        }
        for (k, sample) in samples.iter().enumerate() {
            let (sin, cos) = shifts.shifts_rad()[k].sin_cos();
            let (sin, cos) = (sin as f32, cos as f32);
            let sums = self.offset.iter().zip(&self.cosine).zip(&self.sine).zip(&mut self.residual);
            for ((((offset, cosine), sine), residual), value) in sums.zip(*sample) {
                let off = value.grey(grey_per_value) - offset - cosine * cos + sine * sin;
                *residual += off * off;
            }
        }
        for residual in &mut self.residual {
            *residual = (*residual / freedom as f32).sqrt();
        }
    }

    /// Solves pixels with saturated samples again without these.
    fn leave_out_saturated<S: Sample>(
        &mut self,
        samples: &[&[S]],
        grey_per_value: f32,
        saturation: S,
        shifts: &PhaseShifts,
    ) {
        if samples.iter().all(|sample| sample.iter().all(|value| value.is_below(saturation))) {
            return;
        }
        for i in 0..samples[0].len() {
            if samples.iter().all(|s| s[i].is_below(saturation)) {
                continue;
            }
            self.saturated[i] = true;
            let kept = (0..samples.len()).filter(|&k| samples[k][i].is_below(saturation));
            let (greys, angles): (Vec<f64>, Vec<f64>) =
                kept.map(|k| (f64::from(samples[k][i].grey(grey_per_value)), shifts.shifts_rad()[k])).unzip();
            match solve(&greys, &angles) {
                Some(solution) => [self.offset[i], self.cosine[i], self.sine[i], self.residual[i]] = solution,
                None => self.residual[i] = f32::INFINITY,
            }
        }
    }

    fn finish(
        &self,
        steps: usize,
        validity: &Validity,
        phase: &mut [u16],
        modulation: &mut [f32],
        mean: &mut [u8],
        valid: &mut [bool],
    ) {
        let max_share = if steps == MIN_STEPS { f32::MAX } else { validity.max_residual_share };
        for ((phase, &cosine), &sine) in phase.iter_mut().zip(&self.cosine).zip(&self.sine) {
            *phase = turn_fraction(sine, cosine);
        }
        for ((modulation, cosine), sine) in modulation.iter_mut().zip(&self.cosine).zip(&self.sine) {
            *modulation = (cosine * cosine + sine * sine).sqrt();
        }
        for (mean, offset) in mean.iter_mut().zip(&self.offset) {
            *mean = (offset + 0.5) as u8;
        }
        for ((valid, &modulation), residual) in valid.iter_mut().zip(&*modulation).zip(&self.residual) {
            *valid = modulation >= validity.min_modulation_grey && *residual <= max_share * modulation;
        }
    }
}

/// Offset, cosine sum, sine sum and residual from the samples that are left; `None` if they do not determine them.
fn solve(greys: &[f64], shifts_rad: &[f64]) -> Option<[f32; 4]> {
    let kept = PhaseShifts::new(shifts_rad).ok()?;
    let [offset, cosine, sine] =
        kept.weights().map(|w| w.iter().zip(greys).map(|(&w, g)| f64::from(w) * g).sum::<f64>());
    let squares = greys.iter().zip(shifts_rad).map(|(g, s)| (g - offset - cosine * s.cos() + sine * s.sin()).powi(2));
    let freedom = (greys.len() - MIN_STEPS).max(1);
    let residual = (squares.sum::<f64>() / freedom as f64).sqrt();
    Some([offset as f32, cosine as f32, sine as f32, residual as f32])
}

#[cfg(test)]
mod tests {
    use super::super::map::FitStatistics;
    use super::*;
    use std::f64::consts::TAU;

    /// Rows of `steps` one-row images of a ramp of phases, each with offset 100 and modulation 60.
    fn ramp(shifts_rad: &[f64], gain: f64, pixels: usize) -> Vec<Vec<u8>> {
        let grey = |i: usize, s: f64| gain * (100.0 + 60.0 * (phase_of(i, pixels) + s).cos());
        shifts_rad.iter().map(|&s| (0..pixels).map(|i| grey(i, s).round() as u8).collect()).collect()
    }

    fn phase_of(i: usize, pixels: usize) -> f64 {
        TAU * i as f64 / pixels as f64
    }

    fn decode_rows(rows: &[Vec<u8>], shifts_rad: &[f64]) -> PhaseMap {
        let images: Vec<GreyLevels<'_>> = rows.iter().map(|row| GreyLevels::eight_bit(row)).collect();
        let shifts = PhaseShifts::new(shifts_rad).unwrap();
        decode(&images, rows[0].len(), 1, &shifts, &Validity::default()).unwrap()
    }

    /// The same, with values of more bits, each made by `value` from its grey level, which need not be whole.
    fn decode_deep(
        format: PixelFormat,
        rows: &[Vec<f64>],
        shifts_rad: &[f64],
        value: impl Fn(f64) -> u16,
        validity: &Validity,
    ) -> PhaseMap {
        let bytes = |row: &Vec<f64>| row.iter().flat_map(|&grey| value(grey).to_le_bytes()).collect::<Vec<u8>>();
        let rows: Vec<Vec<u8>> = rows.iter().map(bytes).collect();
        let images: Vec<GreyLevels<'_>> = rows.iter().map(|bytes| GreyLevels { format, bytes }).collect();
        decode(&images, images[0].pixels(), 1, &PhaseShifts::new(shifts_rad).unwrap(), validity).unwrap()
    }

    fn largest_error_rad(map: &PhaseMap) -> f64 {
        let error = |i: usize| {
            let off = f64::from(map.phase[i]) / 65536.0 * TAU - phase_of(i, map.width);
            (off + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0
        };
        (0..map.width).map(|i| error(i).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn any_known_shifts_give_back_the_phase() {
        let mut sequences: Vec<Vec<f64>> =
            (MIN_STEPS..=MAX_STEPS).map(|n| (0..n).map(|k| TAU * k as f64 / n as f64).collect()).collect();
        sequences.push(vec![0.0, 1.4, 3.3, 4.6]);
        sequences.push(vec![-0.2, 0.9, 2.0, 2.9, 4.4, 5.0, 11.0]);
        for shifts in sequences {
            let map = decode_rows(&ramp(&shifts, 1.0, 1500), &shifts);
            // Rounding moves each grey level by at most 0.5 of 60; its worst case over all samples bounds the phase.
            assert!(largest_error_rad(&map) < 0.02, "{shifts:?}: {}", largest_error_rad(&map));
            assert!(map.modulation.iter().all(|b| (b - 60.0).abs() < 1.2));
            assert!(map.valid.iter().all(|&v| v));
        }
    }

    #[test]
    fn saturated_samples_are_left_out() {
        let shifts: Vec<f64> = (0..8).map(|k| TAU * f64::from(k) / 8.0).collect();
        // Peaks of 1.8·160 = 288 are clipped by the cast to 255.
        let map = decode_rows(&ramp(&shifts, 1.8, 1000), &shifts);
        assert!(largest_error_rad(&map) < 0.02);
        assert!(map.valid.iter().all(|&v| v));
    }

    #[test]
    fn pixels_without_a_sinusoid_are_invalid() {
        let shifts: Vec<f64> = (0..6).map(|k| TAU * f64::from(k) / 6.0).collect();
        let dark = vec![vec![10_u8; 4]; 6];
        assert!(decode_rows(&dark, &shifts).valid.iter().all(|&v| !v));
        let spike: Vec<Vec<u8>> = [0, 0, 200, 0, 200, 200].iter().map(|&g| vec![g; 4]).collect();
        assert!(decode_rows(&spike, &shifts).valid.iter().all(|&v| !v));
        let white = vec![vec![255_u8; 4]; 6];
        assert!(decode_rows(&white, &shifts).valid.iter().all(|&v| !v));
    }

    #[test]
    fn the_noise_is_measured() {
        let shifts: Vec<f64> = (0..8).map(|k| TAU * f64::from(k) / 8.0).collect();
        let mut rows = ramp(&shifts, 1.0, 20_000);
        // Twelve coin tosses a sample: nearly normal, standard deviation √3.
        let mut state = 1_u32;
        for grey in rows.iter_mut().flatten() {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *grey = *grey + (state >> 20).count_ones() as u8 - 6;
        }
        let fit = decode_rows(&rows, &shifts).fit;
        assert!((fit.noise_grey - 3.0_f32.sqrt()).abs() < 0.1, "{}", fit.noise_grey);
        assert!((fit.residual_share.unwrap() - 0.029).abs() < 0.003);
    }

    #[test]
    fn eight_bits_in_the_high_bits_of_more_are_the_same_image() {
        for (steps, gain) in [(4, 1.0), (8, 1.8), (16, 1.4)] {
            let shifts: Vec<f64> = (0..steps).map(|k| TAU * f64::from(k) / f64::from(steps)).collect();
            // Gains above 1.5 saturate.
            let rows = ramp(&shifts, gain, 1500);
            let greys: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(|&g| f64::from(g)).collect()).collect();
            for saturation_grey in [255, 200] {
                let validity = Validity { saturation_grey, ..Validity::default() };
                let images: Vec<GreyLevels<'_>> = rows.iter().map(|row| GreyLevels::eight_bit(row)).collect();
                let map = decode(&images, 1500, 1, &PhaseShifts::new(&shifts).unwrap(), &validity).unwrap();
                for format in [PixelFormat::Y10, PixelFormat::Y12, PixelFormat::Y14, PixelFormat::Y16] {
                    let shifted = |grey| (grey as u16) << (format.bits() - 8);
                    let deep = decode_deep(format, &greys, &shifts, shifted, &validity);
                    // The noise of rounding, its floor, is that of the depth.
                    let noise_grey = map.fit.noise_grey;
                    assert!(deep.fit.noise_grey <= noise_grey);
                    let fit = FitStatistics { noise_grey, ..deep.fit };
                    assert_eq!(PhaseMap { fit, ..deep }, map, "{steps} steps, gain {gain}, {format:?}");
                }
            }
        }
    }

    #[test]
    fn deeper_images_have_finer_phases() {
        let shifts: Vec<f64> = (0..4).map(|k| TAU * f64::from(k) / 4.0).collect();
        let grey = |i: usize, s: f64| 100.0 + 6.0 * (phase_of(i, 3000) + s).cos();
        let greys: Vec<Vec<f64>> = shifts.iter().map(|&s| (0..3000).map(|i| grey(i, s)).collect()).collect();
        let mut limit_rad = 0.12;
        for format in [PixelFormat::Y10, PixelFormat::Y12, PixelFormat::Y14] {
            let round = |grey: f64| (grey / f64::from(format.grey_per_value())).round() as u16;
            let map = decode_deep(format, &greys, &shifts, round, &Validity::default());
            // Half a value of each sample, of 6 grey levels; the phase itself has steps of 1e-4.
            limit_rad /= 4.0;
            assert!(largest_error_rad(&map) < limit_rad + 2e-4, "{format:?}: {}", largest_error_rad(&map));
            assert!(map.modulation.iter().all(|b| (b - 6.0).abs() < 0.2) && map.mean.iter().all(|&m| m == 100));
            assert!((map.fit.noise_grey - 0.288_675 * format.grey_per_value()).abs() < 0.05);
        }
    }

    #[test]
    fn full_scale_of_every_depth_is_saturated() {
        let shifts: Vec<f64> = (0..8).map(|k| TAU * f64::from(k) / 8.0).collect();
        let greys: Vec<Vec<f64>> = shifts
            .iter()
            .map(|&s| (0..1000).map(|i| 1.8 * (100.0 + 60.0 * (phase_of(i, 1000) + s).cos())).collect())
            .collect();
        for format in [PixelFormat::Y10, PixelFormat::Y12, PixelFormat::Y14, PixelFormat::Y16] {
            let clipped =
                |grey: f64| (grey / f64::from(format.grey_per_value())).min(f64::from(format.max_value())) as u16;
            let map = decode_deep(format, &greys, &shifts, clipped, &Validity::default());
            assert!(largest_error_rad(&map) < 0.02, "{format:?}: {}", largest_error_rad(&map));
            assert!(map.valid.iter().all(|&v| v));
        }
    }

    #[test]
    fn images_of_different_depth_are_no_sequence() {
        let shifts = PhaseShifts::new(&[0.0, 2.0, 4.0]).unwrap();
        let bytes = [9; 8];
        let deep = GreyLevels { format: PixelFormat::Y12, bytes: &bytes };
        let decoded = |images: &[GreyLevels<'_>]| decode(images, 4, 1, &shifts, &Validity::default()).is_some();
        assert!(decoded(&[deep; 3]) && decoded(&[GreyLevels::eight_bit(&bytes[..4]); 3]));
        assert!(!decoded(&[deep, deep, GreyLevels { format: PixelFormat::Y10, ..deep }]));
        assert!(!decoded(&[GreyLevels::eight_bit(&bytes); 3]));
    }
}

//! N-step decoding: sums of sines and cosines first, one arctangent a pixel.

use rayon::prelude::*;

use super::arctangent::turn_fraction;
use super::map::{FitStatistics, PhaseMap};
use super::shifts::{MAX_STEPS, MIN_STEPS, PhaseShifts};

/// Pixels decoded together: the sums of a tile stay in the first-level cache, and few input streams are open at once.
const TILE: usize = 512;
/// Standard deviation of rounding to whole grey levels, 1/√12.
const ROUNDING_NOISE_GREY: f32 = 0.288_675;
/// Bins of the histograms of residual and residual share.
const BINS: usize = 1024;
/// Residual shares up to this are told apart; worse ones share the last bin.
const SHARE_RANGE: f32 = 2.0;
/// Residuals up to this many grey levels are told apart.
const RESIDUAL_RANGE_GREY: f32 = 64.0;

/// What makes a phase trustworthy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validity {
    /// Least modulation, grey levels.
    pub min_modulation_grey: f32,
    /// Grey level from which on a sample is saturated and left out of the fit.
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
/// `None` if there are not as many images as shifts or an image has another size.
///
/// Formula: with the least-squares sums A, C = B·cos φ and S = B·sin φ of [`PhaseShifts`], φ = atan2(S, C) and
/// B = hypot(S, C); for equal spacing this is `atan2(−Σ I_k sin s_k, Σ I_k cos s_k)`. Saturated samples are left
/// out where three or more others remain.
#[must_use]
pub fn decode(
    images: &[&[u8]],
    width: usize,
    height: usize,
    shifts: &PhaseShifts,
    validity: &Validity,
) -> Option<PhaseMap> {
    let pixels = width * height;
    if images.len() != shifts.steps() || images.iter().any(|i| i.len() != pixels) {
        return None;
    }
    let mut map = PhaseMap {
        width,
        height,
        phase: vec![0; pixels],
        modulation: vec![0.0; pixels],
        mean: vec![0; pixels],
        valid: vec![false; pixels],
        fit: FitStatistics::default(),
    };
    let histograms = decode_tiles(images, shifts, validity, &mut map);
    map.fit = histograms.statistics(shifts.steps());
    Some(map)
}

/// Decodes all tiles in parallel and merges their histograms; whole numbers add up the same in any order.
fn decode_tiles(images: &[&[u8]], shifts: &PhaseShifts, validity: &Validity, map: &mut PhaseMap) -> Histograms {
    let tiles = map
        .phase
        .par_chunks_mut(TILE)
        .zip(map.modulation.par_chunks_mut(TILE))
        .zip(map.mean.par_chunks_mut(TILE))
        .zip(map.valid.par_chunks_mut(TILE))
        .enumerate();
    tiles
        .fold(Histograms::default, |mut histograms, (i, (((phase, modulation), mean), valid))| {
            let range = i * TILE..i * TILE + phase.len();
            let mut samples: [&[u8]; MAX_STEPS] = [&[]; MAX_STEPS];
            for (sample, image) in samples.iter_mut().zip(images) {
                *sample = &image[range.clone()];
            }
            let samples = &samples[..images.len()];
            let mut sums = Sums::new();
            sums.accumulate(samples, shifts);
            sums.leave_out_saturated(samples, shifts, validity.saturation_grey);
            sums.finish(shifts.steps(), validity, phase, modulation, mean, valid);
            histograms.add(&sums, modulation, valid);
            histograms
        })
        .reduce(Histograms::default, Histograms::merge)
}

/// Least-squares sums of a tile, and the residual about them.
struct Sums {
    offset: [f32; TILE],
    cosine: [f32; TILE],
    sine: [f32; TILE],
    /// Standard deviation of the samples about the fit; infinite where too few samples are unsaturated.
    residual: [f32; TILE],
}

impl Sums {
    fn new() -> Self {
        Self { offset: [0.0; TILE], cosine: [0.0; TILE], sine: [0.0; TILE], residual: [0.0; TILE] }
    }

    fn accumulate(&mut self, samples: &[&[u8]], shifts: &PhaseShifts) {
        let [w_offset, w_cosine, w_sine] = shifts.weights();
        for (k, sample) in samples.iter().enumerate() {
            let (wo, wc, ws) = (w_offset[k], w_cosine[k], w_sine[k]);
            let sums = self.offset.iter_mut().zip(&mut self.cosine).zip(&mut self.sine);
            for (((offset, cosine), sine), &grey) in sums.zip(*sample) {
                let grey = f32::from(grey);
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
            for ((((offset, cosine), sine), residual), &grey) in sums.zip(*sample) {
                let off = f32::from(grey) - offset - cosine * cos + sine * sin;
                *residual += off * off;
            }
        }
        for residual in &mut self.residual {
            *residual = (*residual / freedom as f32).sqrt();
        }
    }

    /// Solves pixels with saturated samples again without these.
    fn leave_out_saturated(&mut self, samples: &[&[u8]], shifts: &PhaseShifts, saturation_grey: u8) {
        if samples.iter().all(|sample| sample.iter().all(|&grey| grey < saturation_grey)) {
            return;
        }
        for i in 0..samples[0].len() {
            if samples.iter().all(|s| s[i] < saturation_grey) {
                continue;
            }
            let kept = (0..samples.len()).filter(|&k| samples[k][i] < saturation_grey);
            let (greys, angles): (Vec<f64>, Vec<f64>) =
                kept.map(|k| (f64::from(samples[k][i]), shifts.shifts_rad()[k])).unzip();
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

/// Histograms of the residual over the valid pixels, absolute and as a share of the modulation.
struct Histograms {
    share: Vec<u64>,
    residual: Vec<u64>,
}

impl Default for Histograms {
    fn default() -> Self {
        Self { share: vec![0; BINS], residual: vec![0; BINS] }
    }
}

impl Histograms {
    fn add(&mut self, sums: &Sums, modulation: &[f32], valid: &[bool]) {
        let bin = |value: f32, range: f32| ((value / range * BINS as f32) as usize).min(BINS - 1);
        for i in (0..valid.len()).filter(|&i| valid[i]) {
            self.share[bin(sums.residual[i] / modulation[i], SHARE_RANGE)] += 1;
            self.residual[bin(sums.residual[i], RESIDUAL_RANGE_GREY)] += 1;
        }
    }

    fn merge(mut self, other: Self) -> Self {
        let pairs = [(&mut self.share, other.share), (&mut self.residual, other.residual)];
        for (mine, theirs) in pairs {
            mine.iter_mut().zip(theirs).for_each(|(m, t)| *m += t);
        }
        self
    }

    fn statistics(&self, steps: usize) -> FitStatistics {
        let valid_pixels = self.share.iter().sum();
        if steps == MIN_STEPS || valid_pixels == 0 {
            return FitStatistics { valid_pixels, residual_share: None, noise_grey: ROUNDING_NOISE_GREY };
        }
        // Median of a χ distribution over its standard deviation, Wilson and Hilferty's approximation.
        let freedom = (steps - MIN_STEPS) as f32;
        let median_of_unit_noise = (1.0 - 2.0 / (9.0 * freedom)).powi(3).sqrt();
        let noise_grey = median(&self.residual) * RESIDUAL_RANGE_GREY / median_of_unit_noise;
        FitStatistics {
            valid_pixels,
            residual_share: Some(median(&self.share) * SHARE_RANGE),
            noise_grey: noise_grey.max(ROUNDING_NOISE_GREY),
        }
    }
}

/// Median of a histogram, as a fraction of its range.
fn median(histogram: &[u64]) -> f32 {
    let half = histogram.iter().sum::<u64>().div_ceil(2);
    let mut below = 0;
    let bin = histogram.iter().position(|n| {
        below += n;
        below >= half
    });
    (bin.unwrap_or(0) as f32 + 0.5) / histogram.len() as f32
}

#[cfg(test)]
mod tests {
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
        let images: Vec<&[u8]> = rows.iter().map(Vec::as_slice).collect();
        let shifts = PhaseShifts::new(shifts_rad).unwrap();
        decode(&images, rows[0].len(), 1, &shifts, &Validity::default()).unwrap()
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
}

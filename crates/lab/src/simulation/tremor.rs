//! The tremor of a hand: a sum of waves with periods of ten to forty images, which is 1.5 to 6 Hz at sixty images per
//! second.
//!
//! In: its strength and a seed. Out: translation and rotation at any time of a round. The tremor repeats after a round
//! without a jump.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use fringeflow::geometry::Vector3;

use super::normal::standard_normal;
use super::{SimulationError, check_range};

/// A tremor.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tremor {
    /// Number of images per round.
    round: usize,
    /// Waves along x, y and z (metres) and about them (rad).
    waves: [Vec<Wave>; 6],
}

/// A wave: its number of periods per round, and its cosine and sine amplitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wave {
    periods: usize,
    cosine: f64,
    sine: f64,
}

/// Shortest and longest period, images.
const PERIOD_IMAGES: [usize; 2] = [10, 40];
/// Largest root mean square along an axis, millimetres, and about it, degrees.
const MAX_RMS: f64 = 1.0;

impl Tremor {
    /// Creates a tremor with the root mean square `rms_mm` along each axis and `rms_deg` about it. A round has `round`
    /// images, at least one.
    pub(super) fn new(round: usize, rms_mm: f64, rms_deg: f64, seed: u64) -> Result<Self, SimulationError> {
        check_range("the tremor", rms_mm, 0.0, MAX_RMS, "mm")?;
        check_range("the rotational tremor", rms_deg, 0.0, MAX_RMS, "°")?;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let waves = std::array::from_fn(|axis| {
            let rms = if axis < 3 { rms_mm * 1e-3 } else { rms_deg.to_radians() };
            waves(&mut rng, round, rms)
        });
        Ok(Self { round, waves })
    }

    /// Returns translation (metres) and rotation (axis times angle, rad) at a time, counted in images.
    pub(super) fn at(&self, image: f64) -> [Vector3; 2] {
        let value = |axis: usize| {
            let wave_value = |wave: &Wave| {
                let angle = angle(image, wave.periods, self.round);
                wave.cosine * angle.cos() + wave.sine * angle.sin()
            };
            self.waves[axis].iter().map(wave_value).sum()
        };
        [0, 3].map(|first| Vector3::from_fn(|i, _| value(first + i)))
    }
}

/// Returns the angle of a wave with `periods` per round at a time, rad. It is reduced before rounding, so that every
/// round has the same bits.
pub(super) fn angle(image: f64, periods: usize, round: usize) -> f64 {
    let round = round as f64;
    TAU * (image.rem_euclid(round) * periods as f64).rem_euclid(round) / round
}

/// Draws waves with random amplitudes and a total root mean square of `rms`.
fn waves(rng: &mut ChaCha8Rng, round: usize, rms: f64) -> Vec<Wave> {
    let [shortest, longest] = PERIOD_IMAGES;
    let fewest = round.div_ceil(longest);
    let drawn = (fewest..=(round / shortest).max(fewest)).map(|periods| Wave {
        periods,
        cosine: standard_normal(rng),
        sine: standard_normal(rng),
    });
    let drawn: Vec<Wave> = drawn.collect();
    let power: f64 = drawn.iter().map(|w| (w.cosine * w.cosine + w.sine * w.sine) / 2.0).sum();
    let scale = rms / power.sqrt();
    drawn.into_iter().map(|w| Wave { cosine: w.cosine * scale, sine: w.sine * scale, ..w }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_its_strength_and_frequency_band() {
        let round = 240;
        let tremor = Tremor::new(round, 0.2, 0.1, 1).unwrap();
        for axis in 0..3 {
            let shift_mm = |n: usize| tremor.at(n as f64)[0][axis] * 1e3;
            let rms = ((0..round).map(|n| shift_mm(n).powi(2)).sum::<f64>() / round as f64).sqrt();
            assert!((rms - 0.2).abs() < 1e-9, "axis {axis}: {rms} mm");
            let power = |periods: usize| {
                let wave = |f: fn(f64) -> f64| {
                    (0..round).map(|n| shift_mm(n) * f(angle(n as f64, periods, round))).sum::<f64>()
                };
                wave(f64::sin).hypot(wave(f64::cos)) * 2.0 / round as f64
            };
            assert!((0..6).chain(25..round / 2).all(|periods| power(periods) < 1e-9), "axis {axis}");
            assert!((6..=24).any(|periods| power(periods) > 0.03), "axis {axis}");
        }
    }

    #[test]
    fn every_round_has_the_same_bits() {
        let tremor = Tremor::new(240, 0.2, 0.1, 1).unwrap();
        assert_eq!(tremor.at(17.0), tremor.at(17.0 + 5.0 * 240.0));
    }
}

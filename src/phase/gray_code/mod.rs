//! Absolute phase from Gray code, only for the reference methods CGC and EGC (paper, Table 2).
//!
//! In: the wrapped phase of a camera and its Gray-code images, most significant first. Out: the absolute phase in
//! turns, counted as in [`FringePattern::phase_turns`]. Cost: up to four readings of the code per pixel.
//!
//! The binary-reflected code counts cells of `cell_periods` fringe periods from the left edge of projector column 0
//! towards increasing columns. A cell determines the absolute phase to half its width, the wrapped phase up to whole
//! turns; both together determine it. If a bit is too close to its threshold, the possible readings vote (see `cells`).
//! Undecided pixels are invalid; no order is guessed.

mod cells;

use rayon::prelude::*;

use fringeflow_base::grey::GreyLevels;

use crate::geometry::FringePattern;

use self::cells::{Bits, Cells};
use super::PhaseMap;

/// A bit is unsure within this many standard deviations of noise from its threshold.
const MARGIN_IN_SD: f32 = 2.0;

/// A Gray code: cells of `cell_periods` fringe periods, binary-reflected code, most significant image first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrayCode {
    /// Number of images per camera.
    pub images: usize,
    /// Width of a cell in fringe periods: 0.5 or 1.
    pub cell_periods: f64,
}

/// Absolute phase of one camera, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AbsolutePhase {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Absolute phase, turns (1 turn = 2π); zero where not valid.
    pub turns: Vec<f32>,
    /// Whether the wrapped phase is valid and the code determines its fringe order.
    pub valid: Vec<bool>,
}

/// Threshold between dark and lit in the images of a Gray code.
#[derive(Clone, Copy, Debug)]
pub enum Threshold<'a> {
    /// The mean of a fully lit and an unlit image.
    WhiteAndBlack(GreyLevels<'a>, GreyLevels<'a>),
    /// The mean of the phase images, from the phase map.
    MeanOfPhaseImages,
}

/// Why Gray-code images cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GrayCodeError {
    /// The number of images is not the number of bits.
    #[error("{found} Gray-code images for a code of {expected}; give all of them, the most significant first")]
    Count {
        /// Images given.
        found: usize,
        /// Images of the code.
        expected: usize,
    },
    /// An image does not have the size of the phase map.
    #[error(
        "image {index} of the Gray code and its thresholds has {found} pixels, the phase map {width} × {height}; they \
         must come from the same camera"
    )]
    Size {
        /// Index of the image; white and black follow the images of the code.
        index: usize,
        /// Its number of pixels.
        found: usize,
        /// Width of the phase map, pixels.
        width: usize,
        /// Height of the phase map, pixels.
        height: usize,
    },
}

/// Decodes the Gray code of a camera from the grey levels of its images, row by row.
///
/// `noise_grey` is the standard deviation of the camera noise in grey levels.
///
/// # Errors
/// Wrong number or size of images.
pub fn decode_gray_code(
    phase: &PhaseMap,
    pattern: &FringePattern,
    code: &GrayCode,
    images: &[GreyLevels<'_>],
    threshold: Threshold<'_>,
    noise_grey: f32,
) -> Result<AbsolutePhase, GrayCodeError> {
    check(phase, code, images, threshold)?;
    let cells = Cells::new(pattern, code.cell_periods);
    let margin = MARGIN_IN_SD * noise_grey;
    let decode = |i: usize| {
        let level = threshold.level(phase, i);
        let bits = Bits::read(images.iter().map(|image| image.grey(i) - level), margin);
        let turns = phase.valid[i].then(|| cells.absolute_turns(&bits, f64::from(phase.phase[i]) / 65536.0)).flatten();
        (turns.map_or(0.0, |t| t as f32), turns.is_some())
    };
    let (turns, valid) = (0..phase.phase.len()).into_par_iter().map(decode).unzip();
    Ok(AbsolutePhase { width: phase.width, height: phase.height, turns, valid })
}

fn check(
    phase: &PhaseMap,
    code: &GrayCode,
    images: &[GreyLevels<'_>],
    threshold: Threshold<'_>,
) -> Result<(), GrayCodeError> {
    if images.len() != code.images {
        return Err(GrayCodeError::Count { found: images.len(), expected: code.images });
    }
    let (width, height) = (phase.width, phase.height);
    for (index, image) in images.iter().copied().chain(threshold.images()).enumerate() {
        if image.pixels() != width * height {
            return Err(GrayCodeError::Size { index, found: image.pixels(), width, height });
        }
    }
    Ok(())
}

impl<'a> Threshold<'a> {
    fn images(self) -> impl Iterator<Item = GreyLevels<'a>> {
        let pair = match self {
            Self::WhiteAndBlack(white, black) => [Some(white), Some(black)],
            Self::MeanOfPhaseImages => [None; 2],
        };
        pair.into_iter().flatten()
    }

    /// Grey level between dark and lit at a pixel.
    fn level(self, phase: &PhaseMap, pixel: usize) -> f32 {
        match self {
            Self::WhiteAndBlack(white, black) => (white.grey(pixel) + black.grey(pixel)) / 2.0,
            Self::MeanOfPhaseImages => f32::from(phase.mean[pixel]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BITS: usize = 6;

    fn slices(images: &[Vec<u8>]) -> Vec<GreyLevels<'_>> {
        images.iter().map(|image| GreyLevels::eight_bit(image)).collect()
    }

    /// Grey levels of the code images at projector columns, dark 40 and lit 160, blurred over `blur_px` columns.
    fn encode(columns: &[f64], cell_px: f64, blur_px: f64) -> Vec<Vec<u8>> {
        let lit = |k: usize, column: f64| {
            let cell = ((column + 0.5) / cell_px).floor().clamp(0.0, 63.0) as u32;
            f64::from((cell ^ cell >> 1) >> (BITS - 1 - k) & 1)
        };
        let level = |k: usize, column: f64| {
            let samples = 32;
            let offsets = (0..samples).map(|s| (f64::from(s) + 0.5) / f64::from(samples) - 0.5);
            let mean = offsets.map(|o| lit(k, column + o * blur_px)).sum::<f64>() / f64::from(samples);
            (40.0 + 120.0 * mean).round() as u8
        };
        (0..BITS).map(|k| columns.iter().map(|&c| level(k, c)).collect()).collect()
    }

    fn phase_map(pattern: &FringePattern, columns: &[f64], error_turns: f64) -> PhaseMap {
        let wrapped = |c: &f64| ((pattern.phase_turns(*c) + error_turns).rem_euclid(1.0) * 65536.0) as u16;
        PhaseMap {
            width: columns.len(),
            height: 1,
            phase: columns.iter().map(wrapped).collect(),
            modulation: vec![crate::phase::Modulation::from_grey(60.0); columns.len()],
            mean: vec![100; columns.len()],
            valid: vec![true; columns.len()],
            ..PhaseMap::default()
        }
    }

    /// Shares of correct and of wrong pixels of a decoded ramp.
    fn decoded(pattern: &FringePattern, cell_periods: f64, blur_px: f64, error_turns: f64) -> (f64, f64) {
        let (code, cell_px) = (GrayCode { images: BITS, cell_periods }, pattern.period_px * cell_periods);
        let count = 1500;
        let columns: Vec<f64> =
            (0..count).map(|i| (64.0 * cell_px - 20.0) * f64::from(i) / f64::from(count) + 10.0).collect();
        let (map, images) = (phase_map(pattern, &columns, error_turns), encode(&columns, cell_px, blur_px));
        let found =
            decode_gray_code(&map, pattern, &code, &slices(&images), Threshold::MeanOfPhaseImages, 4.0).unwrap();
        let (mut correct, mut wrong) = (0.0, 0.0);
        for (i, column) in columns.iter().enumerate().filter(|&(i, _)| found.valid[i]) {
            let off = (f64::from(found.turns[i]) - pattern.phase_turns(*column)).abs();
            if off < 0.2 { correct += 1.0 } else { wrong += 1.0 }
        }
        (correct / f64::from(count), wrong / f64::from(count))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn half_period_cells_survive_blur_and_phase_errors_at_their_borders(
            offset_rad in 0.0..6.2, negative: bool, blur_px in 0.0..5.0, error_turns in -0.08..0.08,
        ) {
            let pattern = FringePattern { period_px: 18.0, sign: if negative { -1.0 } else { 1.0 }, offset_rad };
            let (correct, wrong) = decoded(&pattern, 0.5, blur_px, error_turns);
            prop_assert!(wrong == 0.0 && correct == 1.0, "{} {}", correct, wrong);
        }

        #[test]
        fn whole_period_cells_are_corrected_where_the_bit_at_the_border_is_unsure(
            offset_rad in 0.0..6.2, negative: bool,
        ) {
            let pattern = FringePattern { period_px: 18.0, sign: if negative { -1.0 } else { 1.0 }, offset_rad };
            let (correct, wrong) = decoded(&pattern, 1.0, 3.0, 0.0);
            prop_assert!(wrong == 0.0 && correct == 1.0, "{} {}", correct, wrong);
            // The bit is unsure within 0.2 columns of the border, and the phase error is 0.1 columns: less than that.
            let (correct, wrong) = decoded(&pattern, 1.0, 3.0, 0.1 / 18.0);
            prop_assert!(wrong == 0.0 && correct == 1.0, "{} {}", correct, wrong);
        }
    }

    /// A code of one pixel with bit `which` on the threshold.
    fn with_unsure_bit(cell_periods: f64, which: usize, column: f64) -> (AbsolutePhase, FringePattern) {
        let pattern = FringePattern { period_px: 18.0, sign: 1.0, offset_rad: 1.0 };
        let code = GrayCode { images: BITS, cell_periods };
        let mut images = encode(&[column], pattern.period_px * cell_periods, 0.0);
        images[which][0] = 101;
        let map = phase_map(&pattern, &[column], 0.0);
        (decode_gray_code(&map, &pattern, &code, &slices(&images), Threshold::MeanOfPhaseImages, 4.0).unwrap(), pattern)
    }

    #[test]
    fn an_unsure_bit_amid_a_cell_is_settled_by_half_period_cells_alone() {
        for which in 0..BITS {
            // The middle of cell 21: columns 189 − 0.5 to 198 − 0.5.
            let (found, pattern) = with_unsure_bit(0.5, which, 193.0);
            assert!(found.valid[0], "bit {which}");
            assert!((f64::from(found.turns[0]) - pattern.phase_turns(193.0)).abs() < 1e-3);
            let (found, _) = with_unsure_bit(1.0, which, 386.5);
            assert!(!found.valid[0], "bit {which}");
        }
    }

    #[test]
    fn an_unsure_bit_never_yields_a_wrong_order_with_half_period_cells() {
        for (which, step) in (0..BITS).flat_map(|w| (0..200).map(move |s| (w, s))) {
            let column = 30.0 + 0.9 * f64::from(step);
            let (found, pattern) = with_unsure_bit(0.5, which, column);
            let off = (f64::from(found.turns[0]) - pattern.phase_turns(column)).abs();
            assert!(!found.valid[0] || off < 0.01, "column {column}, bit {which}: {off}");
        }
    }

    #[test]
    fn a_cell_that_contradicts_the_phase_is_refused() {
        let pattern = FringePattern { period_px: 18.0, sign: 1.0, offset_rad: 1.0 };
        let images = encode(&[193.0], 9.0, 0.0);
        let map = phase_map(&pattern, &[193.0], 0.5);
        let code = GrayCode { images: BITS, cell_periods: 0.5 };
        let found =
            decode_gray_code(&map, &pattern, &code, &slices(&images), Threshold::MeanOfPhaseImages, 1.0).unwrap();
        assert!(!found.valid[0]);
    }

    #[test]
    fn white_and_black_set_the_threshold() {
        let pattern = FringePattern { period_px: 18.0, sign: 1.0, offset_rad: 1.0 };
        let map = PhaseMap { mean: vec![0], ..phase_map(&pattern, &[193.0], 0.0) };
        let (images, code) = (encode(&[193.0], 9.0, 0.0), GrayCode { images: BITS, cell_periods: 0.5 });
        let threshold = Threshold::WhiteAndBlack(GreyLevels::eight_bit(&[160]), GreyLevels::eight_bit(&[40]));
        let found = decode_gray_code(&map, &pattern, &code, &slices(&images), threshold, 1.0).unwrap();
        assert!((f64::from(found.turns[0]) - pattern.phase_turns(193.0)).abs() < 1e-3);
    }

    #[test]
    fn missing_and_wrongly_sized_images_are_refused() {
        let pattern = FringePattern { period_px: 18.0, sign: 1.0, offset_rad: 1.0 };
        let (map, code) = (phase_map(&pattern, &[193.0], 0.0), GrayCode { images: BITS, cell_periods: 0.5 });
        let mut images = encode(&[193.0], 9.0, 0.0);
        let decode = |images: &[Vec<u8>]| {
            decode_gray_code(&map, &pattern, &code, &slices(images), Threshold::MeanOfPhaseImages, 1.0).unwrap_err()
        };
        assert_eq!(decode(&images[1..]), GrayCodeError::Count { found: 5, expected: 6 });
        images[2] = vec![0, 0];
        assert!(matches!(decode(&images), GrayCodeError::Size { index: 2, found: 2, .. }));
    }
}

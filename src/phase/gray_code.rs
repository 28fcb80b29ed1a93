//! Absolute phase from Gray code, for the reference methods CGC and EGC alone (paper, Table 2).
//!
//! In: the wrapped phase of a camera and its Gray-code images, most significant first. Out: the absolute phase in turns,
//! counted as [`FringePattern::phase_turns`] counts it.
//!
//! The binary-reflected code counts cells of `cell_periods` fringe periods from the left edge of projector column 0 on,
//! in the sense of increasing columns. A cell states the absolute phase to half its width; the wrapped phase states it
//! up to whole turns; together they yield it. A bit too close to its threshold is read both ways, and each reading
//! votes for the absolute phases that agree with its cell:
//!
//! - At a border between two cells exactly one bit is unsure. Both readings agree with the wrapped phase there, on the
//!   same absolute phase, and that one wins with two votes.
//! - Elsewhere, with half-period cells, the wrong reading lands half a turn off, contradicts the wrapped phase and has
//!   no vote. With whole-period cells it has one, as the right reading has: a tie, and the pixel is invalid.
//!
//! A sure cell that contradicts the wrapped phase leaves the pixel invalid too. No order is guessed.

use rayon::prelude::*;

use super::PhaseMap;
use crate::dataset::{GrayCode, GreyImage};
use crate::geometry::FringePattern;

/// Turns by which the wrapped phase may overstep the border of its cell: blur and phase error there.
const BORDER_TOLERANCE_TURNS: f64 = 0.1;
/// A bit is unsure closer to its threshold than this many standard deviations of the noise.
const MARGIN_IN_SD: f32 = 2.0;
/// More unsure bits than this leave nothing to decide.
const MAX_UNSURE_BITS: usize = 2;

/// Absolute phase of one camera, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AbsolutePhase {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Absolute phase, turns (1 turn = 2π); zero where not valid.
    pub turns: Vec<f32>,
    /// Whether the wrapped phase was valid and the code decided its order.
    pub valid: Vec<bool>,
}

/// What the images of a Gray code are compared with.
#[derive(Clone, Copy, Debug)]
pub enum Threshold<'a> {
    /// The mean of a fully lit and an unlit image.
    WhiteAndBlack(&'a GreyImage, &'a GreyImage),
    /// The mean of the phase images, as the phase map has it.
    MeanOfPhaseImages,
}

/// Why Gray-code images cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GrayCodeError {
    /// Not as many images as the code has bits.
    #[error("{found} Gray-code images for a code of {expected}; give all of them, the most significant first")]
    Count {
        /// Images given.
        found: usize,
        /// Images of the code.
        expected: usize,
    },
    /// An image has another size than the phase map.
    #[error(
        "image {index} of the Gray code and its thresholds is {width} × {height} pixels, the phase map {map_width} × \
         {map_height}; they must come from the same camera"
    )]
    Size {
        /// Which one: first those of the code, then white and black.
        index: usize,
        /// Its width, pixels.
        width: usize,
        /// Its height, pixels.
        height: usize,
        /// Width of the phase map, pixels.
        map_width: usize,
        /// Height of the phase map, pixels.
        map_height: usize,
    },
}

/// Decodes the Gray code of a camera; `noise_grey` is the standard deviation of its noise in grey levels.
///
/// # Errors
/// Images of a wrong number or size.
pub fn decode_gray_code(
    phase: &PhaseMap,
    pattern: &FringePattern,
    code: &GrayCode,
    images: &[GreyImage],
    threshold: Threshold<'_>,
    noise_grey: f32,
) -> Result<AbsolutePhase, GrayCodeError> {
    check(phase, code, images, threshold)?;
    let cells = Cells::new(pattern, code.cell_periods);
    let margin = MARGIN_IN_SD * noise_grey;
    let decode = |i: usize| {
        let level = threshold.level(phase, i);
        let bits = Bits::read(images.iter().map(|image| f32::from(image.pixels[i]) - level), margin);
        let turns = phase.valid[i].then(|| cells.absolute_turns(&bits, f64::from(phase.phase[i]) / 65536.0)).flatten();
        (turns.map_or(0.0, |t| t as f32), turns.is_some())
    };
    let (turns, valid) = (0..phase.phase.len()).into_par_iter().map(decode).unzip();
    Ok(AbsolutePhase { width: phase.width, height: phase.height, turns, valid })
}

fn check(
    phase: &PhaseMap,
    code: &GrayCode,
    images: &[GreyImage],
    threshold: Threshold<'_>,
) -> Result<(), GrayCodeError> {
    if images.len() != code.images {
        return Err(GrayCodeError::Count { found: images.len(), expected: code.images });
    }
    let (map_width, map_height) = (phase.width, phase.height);
    let misfit = images.iter().chain(threshold.images()).enumerate();
    for (index, &GreyImage { width, height, .. }) in misfit {
        if [width, height] != [map_width, map_height] {
            return Err(GrayCodeError::Size { index, width, height, map_width, map_height });
        }
    }
    Ok(())
}

impl<'a> Threshold<'a> {
    fn images(self) -> impl Iterator<Item = &'a GreyImage> {
        let pair = match self {
            Self::WhiteAndBlack(white, black) => [Some(white), Some(black)],
            Self::MeanOfPhaseImages => [None; 2],
        };
        pair.into_iter().flatten()
    }

    /// Grey level between dark and lit at a pixel.
    fn level(self, phase: &PhaseMap, pixel: usize) -> f32 {
        match self {
            Self::WhiteAndBlack(white, black) => {
                (f32::from(white.pixels[pixel]) + f32::from(black.pixels[pixel])) / 2.0
            }
            Self::MeanOfPhaseImages => f32::from(phase.mean[pixel]),
        }
    }
}

/// The Gray-code word of a pixel, and which of its bits could be read the other way.
struct Bits {
    word: u32,
    unsure: [u32; MAX_UNSURE_BITS],
    unsure_count: usize,
}

impl Bits {
    /// Reads grey levels above (lit) and below (dark) the threshold, most significant bit first.
    fn read(above_threshold: impl ExactSizeIterator<Item = f32>, margin: f32) -> Self {
        let mut bits = Self { word: 0, unsure: [0; MAX_UNSURE_BITS], unsure_count: 0 };
        let top = above_threshold.len();
        for (k, level) in above_threshold.enumerate() {
            let bit = 1_u32 << (top - 1 - k);
            if level > 0.0 {
                bits.word |= bit;
            }
            if level.abs() < margin {
                if let Some(slot) = bits.unsure.get_mut(bits.unsure_count) {
                    *slot = bit;
                }
                bits.unsure_count += 1;
            }
        }
        bits
    }

    /// All readings; empty if too many bits are unsure.
    fn readings(&self) -> impl Iterator<Item = u32> + '_ {
        let count = if self.unsure_count > MAX_UNSURE_BITS { 0 } else { 1 << self.unsure_count };
        (0..count).map(|which: usize| {
            let flipped = self.unsure.iter().enumerate().filter(|&(k, _)| which >> k & 1 == 1);
            flipped.fold(self.word, |word, (_, bit)| word ^ bit)
        })
    }
}

/// Where the cells of a code lie in the absolute phase.
struct Cells {
    sign: f64,
    /// Column phase at the left edge of column 0, turns.
    origin_turns: f64,
    width_turns: f64,
}

impl Cells {
    fn new(pattern: &FringePattern, width_turns: f64) -> Self {
        // Pixel centres are at integers, so the first cell begins at column −0.5.
        let origin_turns = pattern.sign * pattern.phase_turns(-0.5);
        Self { sign: pattern.sign, origin_turns, width_turns }
    }

    /// Absolute phase from a code word and a wrapped phase, both turns; `None` if they do not decide it.
    fn absolute_turns(&self, bits: &Bits, wrapped_turns: f64) -> Option<f64> {
        if bits.unsure_count == 0 {
            return self.nearest(bits.word, wrapped_turns);
        }
        let mut votes = Votes::default();
        for word in bits.readings() {
            for turns in self.consistent(word, wrapped_turns).into_iter().flatten() {
                votes.add(turns);
            }
        }
        votes.winner()
    }

    /// Absolute phase of the middle of the cell of a code word, turns.
    fn centre(&self, word: u32) -> f64 {
        self.sign * ((f64::from(binary_of_gray(word)) + 0.5) * self.width_turns + self.origin_turns)
    }

    /// The absolute phase closest to the middle of a cell, if that lies in the cell or just beyond its border.
    fn nearest(&self, word: u32, wrapped_turns: f64) -> Option<f64> {
        let centre = self.centre(word);
        let turns = wrapped_turns + (centre - wrapped_turns).round();
        ((turns - centre).abs() <= self.width_turns / 2.0 + BORDER_TOLERANCE_TURNS).then_some(turns)
    }

    /// The absolute phases, at most two, in a cell or just beyond its borders.
    fn consistent(&self, word: u32, wrapped_turns: f64) -> [Option<f64>; 2] {
        let reach = self.width_turns / 2.0 + BORDER_TOLERANCE_TURNS;
        let centre = self.centre(word);
        let below = wrapped_turns + (centre - wrapped_turns).floor();
        [below, below + 1.0].map(|turns| ((turns - centre).abs() <= reach).then_some(turns))
    }
}

/// Votes of the readings of a word for absolute phases.
#[derive(Default)]
struct Votes {
    /// Absolute phase, turns, and its votes; two a reading at most.
    entries: [(f64, u32); 2 << MAX_UNSURE_BITS],
    count: usize,
}

impl Votes {
    fn add(&mut self, turns: f64) {
        // All are whole turns apart.
        match self.entries[..self.count].iter_mut().find(|(t, _)| (*t - turns).abs() < 0.5) {
            Some((_, votes)) => *votes += 1,
            None => {
                self.entries[self.count] = (turns, 1);
                self.count += 1;
            }
        }
    }

    /// The absolute phase with most votes; `None` on a tie.
    fn winner(&self) -> Option<f64> {
        let entries = &self.entries[..self.count];
        let most = entries.iter().map(|&(_, votes)| votes).max()?;
        let mut winners = entries.iter().filter(|&&(_, votes)| votes == most);
        let winner = winners.next()?;
        winners.next().is_none().then_some(winner.0)
    }
}

/// The number that a binary-reflected Gray code stands for.
fn binary_of_gray(word: u32) -> u32 {
    [16, 8, 4, 2, 1].into_iter().fold(word, |n, shift| n ^ n >> shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BITS: usize = 6;

    fn image(pixels: Vec<u8>) -> GreyImage {
        GreyImage { width: pixels.len(), height: 1, pixels }
    }

    /// Grey levels of the code images at projector columns, dark 40 and lit 160, blurred over `blur_px` columns.
    fn encode(columns: &[f64], cell_px: f64, blur_px: f64) -> Vec<GreyImage> {
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
        (0..BITS).map(|k| image(columns.iter().map(|&c| level(k, c)).collect())).collect()
    }

    fn phase_map(pattern: &FringePattern, columns: &[f64], error_turns: f64) -> PhaseMap {
        let wrapped = |c: &f64| ((pattern.phase_turns(*c) + error_turns).rem_euclid(1.0) * 65536.0) as u16;
        PhaseMap {
            width: columns.len(),
            height: 1,
            phase: columns.iter().map(wrapped).collect(),
            modulation: vec![60.0; columns.len()],
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
        let found = decode_gray_code(&map, pattern, &code, &images, Threshold::MeanOfPhaseImages, 4.0).unwrap();
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
            // The bit is unsure within 0.2 columns of the border, the phase off by 0.1: the rest is as good as sure.
            let (correct, wrong) = decoded(&pattern, 1.0, 3.0, 0.1 / 18.0);
            prop_assert!(wrong == 0.0 && correct == 1.0, "{} {}", correct, wrong);
        }
    }

    /// A code of one pixel, whose `which` bit lies on the threshold.
    fn with_unsure_bit(cell_periods: f64, which: usize, column: f64) -> (AbsolutePhase, FringePattern) {
        let pattern = FringePattern { period_px: 18.0, sign: 1.0, offset_rad: 1.0 };
        let code = GrayCode { images: BITS, cell_periods };
        let mut images = encode(&[column], pattern.period_px * cell_periods, 0.0);
        images[which].pixels[0] = 101;
        let map = phase_map(&pattern, &[column], 0.0);
        (decode_gray_code(&map, &pattern, &code, &images, Threshold::MeanOfPhaseImages, 4.0).unwrap(), pattern)
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
        let found = decode_gray_code(&map, &pattern, &code, &images, Threshold::MeanOfPhaseImages, 1.0).unwrap();
        assert!(!found.valid[0]);
    }

    #[test]
    fn white_and_black_set_the_threshold() {
        let pattern = FringePattern { period_px: 18.0, sign: 1.0, offset_rad: 1.0 };
        let map = PhaseMap { mean: vec![0], ..phase_map(&pattern, &[193.0], 0.0) };
        let (images, code) = (encode(&[193.0], 9.0, 0.0), GrayCode { images: BITS, cell_periods: 0.5 });
        let (white, black) = (image(vec![160]), image(vec![40]));
        let threshold = Threshold::WhiteAndBlack(&white, &black);
        let found = decode_gray_code(&map, &pattern, &code, &images, threshold, 1.0).unwrap();
        assert!((f64::from(found.turns[0]) - pattern.phase_turns(193.0)).abs() < 1e-3);
    }

    #[test]
    fn missing_and_misfit_images_are_refused() {
        let pattern = FringePattern { period_px: 18.0, sign: 1.0, offset_rad: 1.0 };
        let (map, code) = (phase_map(&pattern, &[193.0], 0.0), GrayCode { images: BITS, cell_periods: 0.5 });
        let mut images = encode(&[193.0], 9.0, 0.0);
        let decode = |images: &[GreyImage]| {
            decode_gray_code(&map, &pattern, &code, images, Threshold::MeanOfPhaseImages, 1.0).unwrap_err()
        };
        assert_eq!(decode(&images[1..]), GrayCodeError::Count { found: 5, expected: 6 });
        images[2] = image(vec![0, 0]);
        assert!(matches!(decode(&images), GrayCodeError::Size { index: 2, width: 2, .. }));
    }
}

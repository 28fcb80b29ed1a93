//! A pattern: the brightness of each projector pixel. In: a position. Out: the light. Cost: a cosine.

use std::f64::consts::{PI, TAU};

use fringeflow::geometry::FringePattern;

use crate::chart;

/// Direction in which a pattern changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From column to column.
    Columns,
    /// From row to row.
    Rows,
}

impl Direction {
    /// Both directions.
    pub const BOTH: [Self; 2] = [Self::Columns, Self::Rows];

    /// The name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Columns => "columns",
            Self::Rows => "rows",
        }
    }

    /// Extent of an image of `size_px` (width, height) along this direction, pixels.
    #[must_use]
    pub const fn extent_px(self, [width, height]: [usize; 2]) -> usize {
        match self {
            Self::Columns => width,
            Self::Rows => height,
        }
    }
}

/// An image of the projector. Brightness is from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// Sinusoidal fringes, `(1 + cos(φ + shift)) / 2`.
    Fringes {
        /// The direction in which the phase grows.
        direction: Direction,
        /// Phase as a function of the projector pixel.
        pattern: FringePattern,
        /// Phase shift, rad.
        shift_rad: f64,
    },
    /// One bit of the binary-reflected Gray code of half periods, counted from the border of pixel 0.
    Gray {
        /// The direction in which the code counts.
        direction: Direction,
        /// Period of the fringes whose halves are counted, pixels.
        period_px: f64,
        /// Number of the bit; 0 is the least significant.
        bit: u32,
    },
    /// Fully bright.
    White,
    /// Fully dark.
    Black,
    /// Chart for focus and alignment.
    Chart {
        /// Width and height of the image that it fills, pixels.
        size_px: [usize; 2],
    },
}

impl Pattern {
    /// Returns the brightness at a projector pixel, 0 to 1.
    #[must_use]
    pub fn brightness(&self, column_px: f64, row_px: f64) -> f64 {
        let position_px = |direction| match direction {
            Direction::Columns => column_px,
            Direction::Rows => row_px,
        };
        match *self {
            Self::Fringes { direction, pattern, shift_rad } => {
                0.5 + 0.5 * (TAU * pattern.phase_turns(position_px(direction)) + shift_rad).cos()
            }
            Self::Gray { direction, period_px, bit } => {
                let cell = (2.0 * (position_px(direction) + 0.5) / period_px).max(0.0) as u32;
                f64::from((cell ^ (cell >> 1)) >> bit & 1)
            }
            Self::White => 1.0,
            Self::Black => 0.0,
            Self::Chart { size_px } => chart::brightness(size_px, column_px, row_px),
        }
    }
}

/// The usual fringes of a period: phase zero at the left border of column 0, half a pixel before its centre.
#[must_use]
pub fn usual_fringes(period_px: f64) -> FringePattern {
    FringePattern { period_px, sign: 1.0, offset_rad: PI / period_px }
}

/// Returns the phase shifts of `steps` images, evenly spaced over a period, rad.
#[must_use]
pub fn even_shifts_rad(steps: usize) -> Vec<f64> {
    (0..steps).map(|k| TAU * k as f64 / steps as f64).collect()
}

/// Returns the number of bits of a Gray code that counts the half periods of an image.
#[must_use]
pub fn gray_bits(extent_px: usize, period_px: f64) -> u32 {
    let cells = (2.0 * extent_px as f64 / period_px).ceil() as usize;
    cells.next_power_of_two().trailing_zeros().max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fringes_are_cosines_of_the_phase_and_its_shift() {
        let pattern = FringePattern { period_px: 20.0, sign: -1.0, offset_rad: 0.3 };
        for direction in Direction::BOTH {
            let fringes = Pattern::Fringes { direction, pattern, shift_rad: 0.7 };
            let phase = -(TAU * 33.0 / 20.0 + 0.3);
            let at = match direction {
                Direction::Columns => fringes.brightness(33.0, 5.0),
                Direction::Rows => fringes.brightness(5.0, 33.0),
            };
            assert!((at - (1.0 + (phase + 0.7).cos()) / 2.0).abs() < 1e-12);
        }
        assert_eq!((Pattern::White.brightness(3.0, 4.0), Pattern::Black.brightness(3.0, 4.0)), (1.0, 0.0));
    }

    #[test]
    fn usual_fringes_begin_at_the_border_of_the_image() {
        let pattern = usual_fringes(16.0);
        assert!(pattern.phase_turns(-0.5).abs() < 1e-12);
        assert!((pattern.phase_turns(15.5) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn gray_code_counts_half_periods_and_changes_one_bit_per_cell() {
        let code = |column: usize| {
            let bit = |bit| {
                let gray = Pattern::Gray { direction: Direction::Columns, period_px: 16.0, bit };
                gray.brightness(column as f64, 0.0) as u32
            };
            (0..gray_bits(1024, 16.0)).map(|k| bit(k) << k).sum::<u32>()
        };
        assert_eq!(gray_bits(1024, 16.0), 7);
        for column in 0..1024 {
            let cell = column as u32 / 8;
            assert_eq!(code(column), cell ^ (cell >> 1), "column {column}");
            assert_eq!((code(column) ^ code((column + 8) % 1024)).count_ones(), 1);
        }
    }

    #[test]
    fn a_code_has_a_word_for_each_cell() {
        for (extent_px, period_px, bits) in [(1024, 16.0, 7), (1025, 16.0, 8), (912, 18.0, 7), (4, 16.0, 1)] {
            assert_eq!(gray_bits(extent_px, period_px), bits, "{extent_px} {period_px}");
        }
    }
}

//! Patterns that the projector shows.

use std::f64::consts::TAU;

use fringeflow::geometry::FringePattern;

use super::view::Sample;

/// Direction in which a pattern changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From column to column.
    Columns,
    /// From row to row.
    Rows,
}

/// An image of the projector. Brightness is from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projected {
    /// Sinusoidal fringes, `(1 + cos(φ + shift)) / 2`.
    Fringes {
        /// The direction in which the phase grows.
        direction: Direction,
        /// Phase as a function of the projector pixel.
        pattern: FringePattern,
        /// Phase shift, rad.
        shift_rad: f64,
    },
    /// One bit of the binary-reflected Gray code of half periods, counted from phase 0 at or before pixel 0.
    Gray {
        /// The direction in which the code counts.
        direction: Direction,
        /// The fringes whose half periods are counted.
        pattern: FringePattern,
        /// Number of the bit; 0 is the least significant.
        bit: u32,
    },
    /// Fully bright.
    White,
    /// Fully dark.
    Black,
}

impl Projected {
    /// Returns the brightness at the projector pixel that lights a sample, 0 to 1.
    #[must_use]
    pub fn brightness(&self, sample: &Sample) -> f64 {
        let position_px = |direction| match direction {
            Direction::Columns => f64::from(sample.column_px),
            Direction::Rows => f64::from(sample.row_px),
        };
        match *self {
            Self::Fringes { direction, pattern, shift_rad } => {
                0.5 + 0.5 * (TAU * pattern.phase_turns(position_px(direction)) + shift_rad).cos()
            }
            Self::Gray { direction, pattern, bit } => {
                let cell = (2.0 * pattern.sign * pattern.phase_turns(position_px(direction))).max(0.0) as u32;
                f64::from((cell ^ (cell >> 1)) >> bit & 1)
            }
            Self::White => 1.0,
            Self::Black => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gray_code_counts_half_periods_and_changes_one_bit_per_cell() {
        let pattern = FringePattern { period_px: 16.0, sign: 1.0, offset_rad: TAU / 32.0 };
        let code = |column: usize| {
            let sample = Sample { column_px: column as f32, ..Sample::default() };
            let bit = |bit| Projected::Gray { direction: Direction::Columns, pattern, bit }.brightness(&sample) as u32;
            (0..7).map(|k| bit(k) << k).sum::<u32>()
        };
        for column in 0..1024 {
            let cell = column as u32 / 8;
            assert_eq!(code(column), cell ^ (cell >> 1), "column {column}");
            assert_eq!((code(column) ^ code((column + 8) % 1024)).count_ones(), 1);
        }
    }
}

//! Where the images of each kind stand in a pattern set.

use fringeflow::geometry::FringePattern;
use fringeflow::phase::{GrayCode, PhaseShifts, ShiftError};
use fringeflow_patterns::{Direction, Pattern, PatternSet};

/// Name of the images with fringes in messages.
const FRINGES: &str = "fringes";

/// Widths of the cells of a Gray code, fringe periods.
const CELLS: [f64; 2] = [0.5, 1.0];

/// The fringes of one direction and their Gray code.
#[derive(Clone, Debug)]
pub(crate) struct CodedFringes {
    pub(super) pattern: FringePattern,
    pub(super) shifts: PhaseShifts,
    /// Indices of the fringe images.
    pub(super) fringes: Vec<usize>,
    pub(super) code: GrayCode,
    /// Indices of the images of the code, the most significant bit first.
    pub(super) bits: Vec<usize>,
}

/// Indices of the images of a pattern set, by what they show.
#[derive(Clone, Debug)]
pub struct PatternOrder {
    /// Width and height of the image of the projector, pixels.
    pub projector_px: [usize; 2],
    /// Number of images.
    pub images: usize,
    pub(super) white: Vec<usize>,
    pub(super) black: Option<usize>,
    columns: CodedFringes,
    /// `None` in a set that serves only to find a projector from columns.
    rows: Option<CodedFringes>,
}

/// A pattern set does not serve for calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatternOrderError {
    /// A direction has no fringes, or no Gray code.
    #[error("has no {what} along the {direction}; `fringeflow patterns --calibration` makes a set that has all images")]
    Missing {
        /// What is missing.
        what: &'static str,
        /// Name of the direction.
        direction: &'static str,
    },
    /// Images of one direction have different fringes.
    #[error("has fringes of several periods along the {direction}; one period is supported")]
    SeveralPeriods {
        /// Name of the direction.
        direction: &'static str,
    },
    /// The Gray code counts cells of another width.
    #[error(
        "has a Gray code along the {direction} whose cells are {cell_periods} fringe periods wide; they must be half a \
         period or a period"
    )]
    Cells {
        /// Name of the direction.
        direction: &'static str,
        /// Width of a cell, fringe periods.
        cell_periods: f64,
    },
    /// The phase shifts do not determine a phase.
    #[error(transparent)]
    Shifts(#[from] ShiftError),
}

impl PatternOrder {
    /// Finds the images of a set.
    ///
    /// # Errors
    /// [`PatternOrderError`]: a kind of image is missing.
    pub fn of(set: &PatternSet) -> Result<Self, PatternOrderError> {
        let of_kind =
            |pattern: Pattern| set.images.iter().enumerate().filter(move |(_, p)| **p == pattern).map(|(i, _)| i);
        let rows = match CodedFringes::of(set, Direction::Rows) {
            Err(PatternOrderError::Missing { what: FRINGES, .. }) => None,
            rows => Some(rows?),
        };
        Ok(Self {
            projector_px: set.projector_px,
            images: set.images.len(),
            white: of_kind(Pattern::White).collect(),
            black: of_kind(Pattern::Black).next(),
            columns: CodedFringes::of(set, Direction::Columns)?,
            rows,
        })
    }

    /// Period of the fringes along the columns, pixels of the projector.
    #[must_use]
    pub fn period_px(&self) -> f64 {
        self.columns.pattern.period_px
    }

    /// The fringes along the columns.
    pub(crate) fn columns(&self) -> &CodedFringes {
        &self.columns
    }

    /// The fringes of both directions.
    ///
    /// # Errors
    /// [`PatternOrderError::Missing`]: there are none along the rows.
    pub(super) fn directions(&self) -> Result<[&CodedFringes; 2], PatternOrderError> {
        let missing = PatternOrderError::Missing { what: FRINGES, direction: Direction::Rows.name() };
        Ok([&self.columns, self.rows.as_ref().ok_or(missing)?])
    }
}

impl CodedFringes {
    fn of(set: &PatternSet, wanted: Direction) -> Result<Self, PatternOrderError> {
        let direction_name = wanted.name();
        let missing = |what| PatternOrderError::Missing { what, direction: direction_name };
        let (mut fringes, mut shifts_rad, mut bits) = (Vec::new(), Vec::new(), Vec::new());
        let (mut first, mut cell_px) = (None::<FringePattern>, 0.0);
        for (index, image) in set.images.iter().enumerate() {
            match *image {
                Pattern::Fringes { direction, pattern, shift_rad } if direction == wanted => {
                    if *first.get_or_insert(pattern) != pattern {
                        return Err(PatternOrderError::SeveralPeriods { direction: direction_name });
                    }
                    fringes.push(index);
                    shifts_rad.push(shift_rad);
                }
                Pattern::Gray { direction, bit, period_px } if direction == wanted => {
                    bits.push((bit, index));
                    cell_px = period_px / 2.0;
                }
                _ => {}
            }
        }
        let pattern = first.ok_or_else(|| missing(FRINGES))?;
        if bits.is_empty() {
            return Err(missing("Gray code"));
        }
        let cell_periods = cell_px / pattern.period_px;
        if !CELLS.iter().any(|cell| (cell_periods - cell).abs() < 1e-6) {
            return Err(PatternOrderError::Cells { direction: direction_name, cell_periods });
        }
        bits.sort_unstable_by(|a, b| b.cmp(a));
        Ok(Self {
            pattern,
            shifts: PhaseShifts::new(&shifts_rad)?,
            fringes,
            code: GrayCode { images: bits.len(), cell_periods },
            bits: bits.into_iter().map(|(_, index)| index).collect(),
        })
    }
}

//! A set of patterns: the images of a calibration, or a cycle for scanning.

use fringeflow::geometry::FringePattern;
use fringeflow_base::limits::{MAX_STEPS, MIN_STEPS};

use crate::dither::dithered;
use crate::{Depth, Direction, Output, Pattern, PatternProblem, even_shifts_rad, gray_bits, usual_fringes};

/// Name of the list of the patterns in its folder.
pub const PATTERNS_FILE: &str = "patterns.toml";

/// Smallest and largest side of the image of a projector, pixels.
const SIDES_PX: std::ops::RangeInclusive<usize> = 16..=8192;
/// Shortest period: a bright and a dark pixel.
const MIN_PERIOD_PX: f64 = 2.0;

/// Images that a projector shows one after the other.
#[derive(Clone, Debug, PartialEq)]
pub struct PatternSet {
    /// Width and height of the upright image of the projector, pixels.
    pub projector_px: [usize; 2],
    /// The images, in their order.
    pub images: Vec<Pattern>,
    /// How they are handed to the projector.
    pub output: Output,
}

/// Fringes and their phase shifts.
#[derive(Clone, Debug, PartialEq)]
pub struct FringeCycle {
    /// Phase as a function of the projector pixel.
    pub pattern: FringePattern,
    /// Phase shift of each image, rad.
    pub shifts_rad: Vec<f64>,
}

impl FringeCycle {
    /// Evenly shifted fringes that begin with phase zero at the border of the image.
    #[must_use]
    pub fn even(steps: usize, period_px: f64) -> Self {
        Self { pattern: usual_fringes(period_px), shifts_rad: even_shifts_rad(steps) }
    }

    /// The images of the fringes in one direction.
    fn images(&self, direction: Direction) -> impl Iterator<Item = Pattern> + '_ {
        let pattern = self.pattern;
        self.shifts_rad.iter().map(move |&shift_rad| Pattern::Fringes { direction, pattern, shift_rad })
    }

    fn check(&self) -> Result<(), PatternProblem> {
        let steps = self.shifts_rad.len();
        if !(MIN_STEPS..=MAX_STEPS).contains(&steps) {
            return Err(PatternProblem::value("the number of steps", &steps, "it must lie between 3 and 16"));
        }
        if let Some(shift) = self.shifts_rad.iter().find(|shift| !shift.is_finite()) {
            return Err(PatternProblem::value("a phase shift", &shift, "it must be a finite number of rad"));
        }
        check_period("the period", self.pattern.period_px)
    }
}

/// An image as the projector is sent it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PatternImage {
    /// Width and height, pixels.
    pub size_px: [usize; 2],
    /// Grey levels of 8 bits, row by row. Images of 1 bit have only 0 and 255.
    pub levels: Vec<u8>,
}

/// A set is no cycle for scanning.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotACycle {
    /// An image is no fringe image along the columns.
    #[error("image {index} is {kind}; a cycle for scanning has only fringes along the columns")]
    Kind {
        /// Index of the image.
        index: usize,
        /// What it shows.
        kind: String,
    },
    /// Two images have other fringes.
    #[error("image {index} has another period, sign or offset than image 0; a cycle has one kind of fringes")]
    Fringes {
        /// Index of the image.
        index: usize,
    },
    /// The number of images is out of range.
    #[error("it has {steps} images; a cycle for scanning has 3 to 16")]
    Steps {
        /// Number of images.
        steps: usize,
    },
}

impl PatternSet {
    /// The images of a calibration: white, black, and for columns and rows the fringes and their Gray code; then white
    /// again, which differs from the first where something moved meanwhile.
    ///
    /// # Errors
    /// A size, period or number of steps is out of range.
    pub fn calibration(projector_px: [usize; 2], cycle: &FringeCycle) -> Result<Self, PatternProblem> {
        let coded = Self::fringes(projector_px, &Direction::BOTH, cycle, true)?;
        let images = [Pattern::White, Pattern::Black].into_iter().chain(coded.images).chain([Pattern::White]).collect();
        Ok(Self { images, ..coded })
    }

    /// Fringes in some directions, each perhaps with its Gray code after it. With columns alone and without code it is a
    /// cycle for scanning.
    ///
    /// # Errors
    /// As [`Self::calibration`].
    pub fn fringes(
        projector_px: [usize; 2],
        directions: &[Direction],
        cycle: &FringeCycle,
        gray: bool,
    ) -> Result<Self, PatternProblem> {
        cycle.check()?;
        let mut images = Vec::new();
        for &direction in directions {
            images.extend(cycle.images(direction));
            let period_px = cycle.pattern.period_px;
            let bits = if gray { gray_bits(direction.extent_px(projector_px), period_px) } else { 0 };
            images.extend((0..bits).rev().map(|bit| Pattern::Gray { direction, period_px, bit }));
        }
        Self::new(projector_px, images)
    }

    /// The chart for focus and alignment.
    ///
    /// # Errors
    /// As [`Self::calibration`].
    pub fn chart(projector_px: [usize; 2]) -> Result<Self, PatternProblem> {
        Self::new(projector_px, vec![Pattern::Chart { size_px: projector_px }])
    }

    fn new(projector_px: [usize; 2], images: Vec<Pattern>) -> Result<Self, PatternProblem> {
        check_size(projector_px)?;
        Ok(Self { projector_px, images, output: Output::default() })
    }

    /// Size of the image that the projector is sent, after rotation, pixels.
    #[must_use]
    pub fn output_px(&self) -> [usize; 2] {
        self.output.orientation.oriented_px(self.projector_px)
    }

    /// Returns an image as the projector is sent it; `None` beyond the last one.
    #[must_use]
    pub fn image(&self, index: usize) -> Option<PatternImage> {
        let pattern = self.images.get(index)?;
        let [width, height] = self.projector_px;
        let light = |i: usize| pattern.brightness((i % width) as f64, (i / width) as f64);
        let upright: Vec<u8> = match &self.output.depth {
            Depth::Eight(response) => (0..width * height).map(|i| response.level(light(i))).collect(),
            Depth::One => {
                let light: Vec<f64> = (0..width * height).map(light).collect();
                let on = dithered(&light, self.projector_px, pattern.direction());
                on.into_iter().map(|on| if on { u8::MAX } else { 0 }).collect()
            }
        };
        let size_px = self.output_px();
        let levels = (0..width * height).map(|i| {
            let [column, row] = self.output.orientation.upright(self.projector_px, [i % size_px[0], i / size_px[0]]);
            upright[row * width + column]
        });
        Some(PatternImage { size_px, levels: levels.collect() })
    }

    /// Returns the set as a cycle for scanning.
    ///
    /// # Errors
    /// [`NotACycle`]: an image is not of a cycle.
    pub fn cycle(&self) -> Result<FringeCycle, NotACycle> {
        let (mut cycle, steps) = (None, self.images.len());
        for (index, image) in self.images.iter().enumerate() {
            let Pattern::Fringes { direction: Direction::Columns, pattern, shift_rad } = *image else {
                return Err(NotACycle::Kind { index, kind: image.what() });
            };
            let cycle = cycle.get_or_insert_with(|| FringeCycle { pattern, shifts_rad: Vec::new() });
            if cycle.pattern != pattern {
                return Err(NotACycle::Fringes { index });
            }
            cycle.shifts_rad.push(shift_rad);
        }
        cycle.filter(|_| (MIN_STEPS..=MAX_STEPS).contains(&steps)).ok_or(NotACycle::Steps { steps })
    }
}

impl Pattern {
    /// The name of its kind in files.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Fringes { .. } => "fringes",
            Self::Gray { .. } => "gray",
            Self::White => "white",
            Self::Black => "black",
            Self::Chart { .. } => "chart",
        }
    }

    /// What it shows, in words: `rows gray 3`.
    #[must_use]
    pub fn what(&self) -> String {
        match self {
            Self::Fringes { direction, .. } => format!("{} {}", direction.name(), self.kind()),
            Self::Gray { direction, bit, .. } => format!("{} {} {bit}", direction.name(), self.kind()),
            Self::White | Self::Black | Self::Chart { .. } => self.kind().to_owned(),
        }
    }

    /// The direction in which it changes; columns where it has none.
    const fn direction(&self) -> Direction {
        match self {
            Self::Fringes { direction, .. } | Self::Gray { direction, .. } => *direction,
            Self::White | Self::Black | Self::Chart { .. } => Direction::Columns,
        }
    }
}

/// Checks the size of the image of a projector.
pub(crate) fn check_size(size_px: [usize; 2]) -> Result<(), PatternProblem> {
    if size_px.iter().all(|side| SIDES_PX.contains(side)) {
        return Ok(());
    }
    let expected = "width and height must lie between 16 and 8192 pixels";
    Err(PatternProblem::value("projector_px", &format!("{size_px:?}"), expected))
}

/// Checks a fringe period.
pub(crate) fn check_period(field: &str, period_px: f64) -> Result<(), PatternProblem> {
    let is_valid = period_px.is_finite() && period_px >= MIN_PERIOD_PX;
    let refused = || PatternProblem::value(field, &period_px, "it must be at least 2 projector pixels");
    is_valid.then_some(()).ok_or_else(refused)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Flip, Orientation, Response, Rotation};

    fn kinds(set: &PatternSet) -> Vec<String> {
        set.images.iter().map(Pattern::what).collect()
    }

    #[test]
    fn a_calibration_has_both_directions_between_white_images() {
        let set = PatternSet::calibration([64, 40], &FringeCycle::even(3, 16.0)).unwrap();
        let expected = [
            "white",
            "black",
            "columns fringes",
            "columns fringes",
            "columns fringes",
            "columns gray 2",
            "columns gray 1",
            "columns gray 0",
            "rows fringes",
            "rows fringes",
            "rows fringes",
            "rows gray 2",
            "rows gray 1",
            "rows gray 0",
            "white",
        ];
        assert_eq!(kinds(&set), expected);
        assert_eq!(set.cycle().unwrap_err(), NotACycle::Kind { index: 0, kind: "white".to_owned() });
    }

    #[test]
    fn a_cycle_tells_its_fringes() {
        let cycle = FringeCycle { shifts_rad: vec![0.0, 1.0, 3.0], ..FringeCycle::even(3, 18.5) };
        let set = PatternSet::fringes([64, 40], &[Direction::Columns], &cycle, false).unwrap();
        assert_eq!(set.cycle().unwrap(), cycle);
        let other = FringeCycle::even(3, 16.0);
        let mixed =
            PatternSet { images: set.images.iter().copied().chain(other.images(Direction::Columns)).collect(), ..set };
        assert_eq!(mixed.cycle().unwrap_err(), NotACycle::Fringes { index: 3 });
        let long = PatternSet { images: mixed.images[..1].repeat(17), ..mixed };
        assert_eq!(long.cycle().unwrap_err(), NotACycle::Steps { steps: 17 });
    }

    #[test]
    fn images_are_oriented_and_corrected() {
        let cycle = FringeCycle::even(4, 16.0);
        let set = PatternSet::fringes([32, 20], &[Direction::Columns], &cycle, true).unwrap();
        let depth = Depth::Eight(Response::gamma(2.0).unwrap());
        let orientation = Orientation { rotation: Rotation::Quarter, flip: Flip::None };
        let turned = PatternSet { output: Output { orientation, depth, packed: false }, ..set.clone() };
        let image = turned.image(1).unwrap();
        assert_eq!(image.size_px, [20, 32]);
        for row in 0..32 {
            let light = turned.images[1].brightness(row as f64, 0.0);
            assert_eq!(image.levels[row * 20 + 7], (255.0 * light.sqrt()).round() as u8, "row {row}");
        }
        assert!(set.image(4).unwrap().levels.iter().all(|&level| level == 0 || level == 255));
        assert!(set.image(6).is_none());
    }

    #[test]
    fn impossible_sets_are_refused_by_name() {
        let message = |size, steps, period| {
            PatternSet::calibration(size, &FringeCycle::even(steps, period)).unwrap_err().to_string()
        };
        assert!(message([8, 40], 4, 16.0).contains("projector_px is [8, 40]"));
        assert!(message([64, 40], 2, 16.0).contains("steps is 2"));
        assert!(message([64, 40], 4, 1.5).contains("period is 1.5"));
        assert!(message([64, 40], 4, f64::NAN).contains("period is NaN"));
    }
}

//! One direction of fringes.

use std::ops::Range;

use fringeflow::geometry::FringePattern;
use fringeflow::phase::GrayCode;

/// One direction of fringes: pattern, phase shifts, and the Gray code that makes the phase absolute.
#[derive(Clone, Debug, PartialEq)]
pub struct FringeSequence {
    /// Phase as a function of the projector column (row for the second direction).
    pub pattern: FringePattern,
    /// Phase shift of every phase image, rad.
    pub shifts_rad: Vec<f64>,
    /// Gray code, if there is one.
    pub gray: Option<GrayCode>,
}

/// Images cannot be thinned out evenly to a number of steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("--steps {steps}: {count} images cannot be thinned out evenly; give a divisor of {count}")]
pub struct UnevenSteps {
    /// The wanted number.
    pub steps: usize,
    /// Number of images.
    pub count: usize,
}

/// Numbers of `steps` of these images, evenly spaced.
///
/// # Errors
/// `steps` does not divide the number of images.
pub fn evenly_spaced(images: Range<usize>, steps: usize) -> Result<Vec<usize>, UnevenSteps> {
    let count = images.len();
    if steps == 0 || !count.is_multiple_of(steps) {
        return Err(UnevenSteps { steps, count });
    }
    // Without images there is nothing to step over.
    Ok(images.step_by((count / steps).max(1)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_evenly_spaced_or_refused() {
        assert_eq!(evenly_spaced(0..16, 4), Ok(vec![0, 4, 8, 12]));
        assert_eq!(evenly_spaced(3..6, 3), Ok(vec![3, 4, 5]));
        assert_eq!(evenly_spaced(0..0, 4), Ok(vec![]));
        assert_eq!(evenly_spaced(0..16, 5), Err(UnevenSteps { steps: 5, count: 16 }));
        let refused = evenly_spaced(0..16, 0).unwrap_err().to_string();
        assert_eq!(refused, "--steps 0: 16 images cannot be thinned out evenly; give a divisor of 16");
    }
}

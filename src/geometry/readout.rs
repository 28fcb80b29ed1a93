//! Region of interest and binning of a sensor.
//!
//! In: the calibration of the full image. Out: the calibration of the cropped and binned image. Nothing is fitted and
//! rays do not change: pixels only get other coordinates. Cost: once per rig.

use super::{Camera, Rig};

/// Smallest side of a cropped and binned image, pixels.
const LEAST_SIDE_PX: usize = 16;
/// Supported binning factors: n × n sensor pixels become one.
pub const BINNINGS: [usize; 2] = [1, 2];

/// Region and binning in which a sensor is read out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Readout {
    sensor_px: [usize; 2],
    origin_px: [usize; 2],
    region_px: [usize; 2],
    binning: usize,
}

/// Why a readout is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadoutError {
    /// The region leaves the image.
    #[error(
        "region {region:?} (x, y, width, height) is not within the calibrated image of {} × {} pixels",
        sensor_px[0], sensor_px[1]
    )]
    Outside {
        /// The region.
        region: [usize; 4],
        /// Width and height of the full image, pixels.
        sensor_px: [usize; 2],
    },
    /// A side is too short, or no multiple of the binning.
    #[error(
        "region {region:?} (x, y, width, height) does not suit binning {binning}: both sides must be multiples of the \
         binning and at least {LEAST_SIDE_PX} pixels after binning"
    )]
    Sides {
        /// The region.
        region: [usize; 4],
        /// The binning.
        binning: usize,
    },
    /// The binning is not supported.
    #[error("binning {0} is not supported; use 1 (every pixel) or 2 (2 × 2 pixels become one)")]
    Binning(usize),
}

impl Readout {
    /// The full image without binning.
    #[must_use]
    pub fn whole(sensor_px: [usize; 2]) -> Self {
        Self { sensor_px, origin_px: [0, 0], region_px: sensor_px, binning: 1 }
    }

    /// A region of a sensor (x, y, width, height; `None` for all of it), binned by `binning`.
    ///
    /// # Errors
    /// The region leaves the sensor, its sides do not suit the binning, or the binning is not supported.
    pub fn new(sensor_px: [usize; 2], region: Option<[usize; 4]>, binning: usize) -> Result<Self, ReadoutError> {
        if !BINNINGS.contains(&binning) {
            return Err(ReadoutError::Binning(binning));
        }
        let region = region.unwrap_or([0, 0, sensor_px[0], sensor_px[1]]);
        let [x, y, width, height] = region;
        let is_within = |from: usize, side: usize, whole: usize| from.checked_add(side).is_some_and(|end| end <= whole);
        if !is_within(x, width, sensor_px[0]) || !is_within(y, height, sensor_px[1]) {
            return Err(ReadoutError::Outside { region, sensor_px });
        }
        if [width, height].iter().any(|side| !side.is_multiple_of(binning) || side / binning < LEAST_SIDE_PX) {
            return Err(ReadoutError::Sides { region, binning });
        }
        Ok(Self { sensor_px, origin_px: [x, y], region_px: [width, height], binning })
    }

    /// Width and height of the full image, pixels.
    #[must_use]
    pub fn sensor_px(&self) -> [usize; 2] {
        self.sensor_px
    }

    /// The region: x, y, width and height in the full image, pixels.
    #[must_use]
    pub fn region(&self) -> [usize; 4] {
        let ([x, y], [width, height]) = (self.origin_px, self.region_px);
        [x, y, width, height]
    }

    /// Binning factor.
    #[must_use]
    pub fn binning(&self) -> usize {
        self.binning
    }

    /// Width and height of the cropped and binned image, pixels.
    #[must_use]
    pub fn image_size_px(&self) -> [usize; 2] {
        self.region_px.map(|side| side / self.binning)
    }

    /// Whether this is the full image without binning.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        *self == Self::whole(self.sensor_px)
    }

    /// The camera of the cropped and binned image, from the camera of the full image.
    #[must_use]
    pub fn camera(&self, whole: &Camera) -> Camera {
        let binning = self.binning as f64;
        // Centre of the first binned pixel in the full image.
        let first = self.origin_px.map(|origin| origin as f64 + (binning - 1.0) / 2.0);
        let ([fx, fy], [cx, cy]) = (whole.focal_px(), whole.principal_px());
        let principal_px = [(cx - first[0]) / binning, (cy - first[1]) / binning];
        Camera::new([fx / binning, fy / binning], principal_px, *whole.distortion(), self.image_size_px())
            .with_skew(whole.skew_px() / binning)
    }

    /// The rig of the cropped and binned images. The projector stays as it is.
    #[must_use]
    pub fn rig(&self, whole: &Rig) -> Rig {
        Rig { cam1: self.camera(&whole.cam1), cam2: self.camera(&whole.cam2), ..*whole }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pixel;
    use crate::geometry::camera::tests::camera;

    #[test]
    fn pixels_keep_their_rays() {
        for (region, binning) in [(Some([40, 8, 320, 256]), 1), (None, 2), (Some([41, 7, 318, 402]), 2)] {
            let readout = Readout::new([640, 512], region, binning).unwrap();
            let (whole, used) = (camera(), readout.camera(&camera()));
            let [x, y, ..] = readout.region();
            for (u, v) in [(0, 0), (7, 3), (158, 120)] {
                // Mean position of the sensor pixels that became one.
                let middle = |from: usize, at: usize| (from + at * binning) as f64 + (binning - 1) as f64 / 2.0;
                let before = whole.ray(&Pixel::new(middle(x, u), middle(y, v))).unwrap();
                let after = used.ray(&Pixel::new(u as f64, v as f64)).unwrap();
                assert!((before - after).norm() < 1e-14, "{region:?} / {binning} at {u}, {v}");
            }
            assert_eq!([used.width_px(), used.height_px()], readout.image_size_px());
        }
        assert_eq!(Readout::whole([640, 512]).camera(&camera()), camera());
    }

    #[test]
    fn impossible_readouts_are_refused() {
        let refused = |region, binning| Readout::new([640, 512], region, binning).unwrap_err().to_string();
        assert!(refused(None, 3).contains("binning 3 is not supported"));
        assert!(refused(None, 0).contains("binning 0 is not supported"));
        assert!(refused(Some([600, 0, 64, 64]), 1).contains("640 × 512"));
        assert!(refused(Some([usize::MAX, 0, 64, 64]), 1).contains("is not within"));
        assert!(refused(Some([0, 0, 33, 64]), 2).contains("multiples of"));
        assert!(refused(Some([0, 0, 30, 64]), 2).contains("16 pixels"));
        assert!(Readout::new([640, 512], Some([0, 0, 640, 512]), 1).unwrap().is_whole());
    }
}

//! How a segment table is stored: its smooth fields, and the limits of its segments.

use crate::calibration::LikelyMistake;
use crate::geometry::EpipolarError;

use super::patches::PATCH_PX;

// The fields that are smooth over the image of C1.
/// The ray: x and y at z = 1.
pub(super) const RAY_X: usize = 0;
pub(super) const RAY_Y: usize = 1;
/// The row of the epipolar frame, pixels.
pub(super) const ROW: usize = 2;
/// The column in the middle of the volume, pixels.
pub(super) const REFERENCE: usize = 3;
/// a, turns, of Φ along the segment: Φ = a + r·s / (1 + d·s), s the column from [`REFERENCE`].
pub(super) const AT_REFERENCE: usize = 4;
/// r, turns per pixel. As a number of its own beside a, its rounding does not grow with the number of fringes.
pub(super) const RISE: usize = 5;
/// d, 1/pixel.
pub(super) const DENOMINATOR: usize = 6;
/// Number of fields.
pub(super) const FIELDS: usize = 7;

/// First and last column of pixels whose ray misses the volume or whose segment lies outside the image of C2.
pub(super) const NO_LIMITS: [u16; 2] = [1, 0];

/// Pixels of a row in memory.
pub(super) fn padded(width: usize) -> usize {
    width.next_multiple_of(PATCH_PX)
}

/// Steps per pixel in which limits are stored: the finest power of two for which the last column of an epipolar frame
/// fits 16 bits.
pub(super) fn units_per_px(epipolar_width: usize) -> u32 {
    1 << (u32::from(u16::MAX) / (epipolar_width as u32 - 1).max(1)).max(1).ilog2()
}

/// Why no segment table can be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SegmentTableError {
    /// The rig has no epipolar frame.
    #[error(transparent)]
    Epipolar(#[from] EpipolarError),
    /// No pixel of C1 has a segment.
    #[error(
        "the measurement volume is never seen: {hit} of {pixels} pixels of camera 1 look into it, and camera 2 sees \
         none of these; check the volume's pose and the unit"
    )]
    NeverSeen {
        /// Pixels of C1 whose ray meets the volume.
        hit: usize,
        /// Pixels of C1.
        pixels: usize,
    },
    /// Cameras and projector see little of the volume, and a mistake in the calibration explains it.
    #[error("the calibration does not fit the measurement volume: {0}")]
    Mistake(LikelyMistake),
    /// The projector never lights the volume.
    #[error("the projector does not look at the measurement volume; check Rp, Tp and the volume's pose")]
    NeverLit,
}

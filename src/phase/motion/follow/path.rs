//! The path along which the images of a tile are sampled.

use crate::phase::motion::fits_by_motion::{Bin, MotionFits};
use crate::phase::motion::flow::SurfaceMotion;

/// Shares of the motion across the fringes that are tried, the largest first. Motion along the fringes is followed
/// fully.
const SHARES: [f32; 5] = [1.0, 0.75, 0.5, 0.25, 0.0];

/// Path and fit of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Path {
    pub(super) velocity_px: [f32; 2],
    pub(super) bin: Option<Bin>,
    /// Expected motion beyond that of the fit, rad per image.
    pub(super) expected_rad: f32,
}

impl Path {
    /// The path of the largest share of the motion that can be followed; no path if there is none.
    pub(super) fn new(tile: &SurfaceMotion, longest_px: f32, fits: &mut MotionFits) -> Self {
        let SurfaceMotion { velocity_px, motion_rad } = *tile;
        let half = 0.5 * fits.resting().images() as f32;
        let is_short = velocity_px.iter().all(|v| v.abs() * half <= longest_px);
        let path = |share: f32| {
            let bin = fits.bin_for(share * motion_rad)?;
            let expected_rad = share * motion_rad - bin.motion_rad();
            let [across, along] = velocity_px;
            Some(Self { velocity_px: [share * across, along], bin: Some(bin), expected_rad })
        };
        SHARES.into_iter().filter(|_| is_short).find_map(path).unwrap_or_default()
    }
}

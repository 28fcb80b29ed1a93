//! Draws the drift of a calibration, as seen by C1.

use fringeflow::correspondence::DriftMap;

use super::colour::{BACKGROUND, diverging};
use super::picture::Picture;
use super::scale::with_scale;

/// Minimum end of the scale, rad: smaller values are noise of the estimate.
const MIN_RANGE_RAD: f32 = 0.01;

/// Draws the drift about its mean at the middle of the measurement volume, per pixel of C1: blue below zero, red above,
/// dark if the pixel does not see the volume. A scale in radians is drawn below.
#[must_use]
pub fn drift_picture(map: &DriftMap) -> Picture {
    let range_rad = map.middle_rad.iter().flatten().fold(MIN_RANGE_RAD, |range, drift| range.max(drift.abs()));
    let picture =
        Picture::from_fn(map.size_px, |i| map.middle_rad[i].map_or(BACKGROUND, |drift| diverging(drift / range_rad)));
    let labels = [-range_rad, range_rad].map(|end| format!("{end:+.3} rad"));
    with_scale(picture, &labels, |share| diverging(2.0 * share - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_differ_and_unseen_pixels_are_dark() {
        let middle_rad = vec![Some(-0.2), Some(0.0), Some(0.2), None];
        let picture = drift_picture(&DriftMap { size_px: [4, 1], middle_rad, greatest_rad: 0.2 });
        let [[r0, _, b0], middle, [r2, _, b2], unseen] = picture.pixels()[..4] else { panic!("four pixels") };
        assert!(b0 > r0 && r2 > b2, "{:?}", picture.pixels());
        assert!(middle.iter().all(|&c| c > 200) && unseen == BACKGROUND);
    }
}

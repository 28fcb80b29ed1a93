//! Draws the confidence of the points of a cloud, as seen by C1.

use fringeflow::cloud::Cloud;

use super::colour::{BACKGROUND, Rgb, sequential};
use super::picture::Picture;
use super::scale::with_scale;

/// Number of nines at the end of the colour map: 99.99 %.
const MAX_NINES: f32 = 4.0;

/// Draws the confidence of the points at their pixels of C1, on a scale of nines: each nine from 0 to 99.99 % is a
/// quarter of the colour map, and yellow is certain. The scale is drawn below. Points without a confidence are skipped.
///
/// `size_px` is the size of the images of C1 (width, height). Points outside are skipped.
#[must_use]
pub fn confidence_picture(cloud: &Cloud, [width, height]: [usize; 2]) -> Picture {
    let mut colours = vec![BACKGROUND; width * height];
    for point in cloud.points.iter().filter(|point| point.confidence > 0.0) {
        let [u, v] = point.cam1_px.map(usize::from);
        if u < width && v < height {
            let nines = -(1.0 - point.confidence).max(0.1_f32.powf(MAX_NINES)).log10();
            colours[v * width + u] = colour(nines / MAX_NINES);
        }
    }
    let picture = Picture::from_fn([width, height], |i| colours[i]);
    with_scale(picture, &["0 %".to_owned(), "99.99 %".to_owned()], colour)
}

fn colour(share: f32) -> Rgb {
    // The darkest tenth of the map would look like the background.
    sequential(0.1 + 0.9 * share.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::cloud::CloudPoint;

    #[test]
    fn more_confident_points_are_brighter() {
        let point = |u: u16, confidence: f32| CloudPoint { cam1_px: [u, 0], confidence, ..CloudPoint::default() };
        let cloud = Cloud { points: vec![point(0, 0.5), point(1, 0.99), point(2, 1.0), point(3, 0.0), point(9, 1.0)] };
        let picture = confidence_picture(&cloud, [5, 1]);
        let brightness: Vec<u32> =
            picture.pixels()[..3].iter().map(|p| p.iter().map(|&c| u32::from(c)).sum()).collect();
        assert!(brightness.is_sorted_by(|a, b| a < b), "{brightness:?}");
        assert_eq!(picture.pixels()[3..5], [BACKGROUND; 2]);
    }
}

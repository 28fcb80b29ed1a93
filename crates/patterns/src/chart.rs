//! The chart for focus and alignment.
//!
//! - A frame one pixel wide at the border: the whole image is seen.
//! - A cross through the middle: the projector is aimed.
//! - A star of 36 rays in the middle, and groups of lines of 1, 2 and 4 pixels beside all corners: focus, and its tilt.
//!   Blur makes the star grey from its middle outwards.
//! - The letter F in the upper left part: upright, it shows neither rotation nor mirroring.
//! - A wedge of 17 grey levels at the bottom: its middle has half of the light of its right end.

use std::f64::consts::TAU;

/// Pairs of a bright and a dark ray of the star.
const RAY_PAIRS: f64 = 36.0;
/// Grey levels of the wedge.
const LEVELS: f64 = 17.0;
/// Brightness of the ground, so that both bright and dark parts stand out.
const GROUND: f64 = 0.22;

/// Returns the brightness of the chart at a pixel, 0 to 1.
pub(crate) fn brightness(size_px: [usize; 2], column_px: f64, row_px: f64) -> f64 {
    let [width, height] = size_px.map(|side| side as f64);
    let (x, y) = (column_px + 0.5, row_px + 0.5);
    let border_px = x.min(width - x).min(y).min(height - y);
    if border_px < 2.0 {
        return if border_px < 1.0 { 1.0 } else { 0.0 };
    }
    let side = width.min(height);
    let (right, down) = (x - width / 2.0, y - height / 2.0);
    if right.hypot(down) < 0.2 * side {
        return bright((down.atan2(right) / TAU * RAY_PAIRS).rem_euclid(1.0) < 0.5);
    }
    if let Some(line) = lines(size_px, column_px, row_px) {
        return line;
    }
    // The letter is upright where the image is.
    let (u, v) = (x - 0.25 * width, y - 0.2 * height);
    if letter_f(u / (0.12 * side), v / (0.2 * side)) {
        return 1.0;
    }
    if (0.88..0.95).contains(&(y / height)) && (0.2..0.8).contains(&(x / width)) {
        return ((x / width - 0.2) / 0.6 * LEVELS).floor() / (LEVELS - 1.0);
    }
    if right.abs() < 1.0 || down.abs() < 1.0 { 1.0 } else { GROUND }
}

fn bright(is_bright: bool) -> f64 {
    f64::from(u8::from(is_bright))
}

/// Lines of the groups beside the corners: those of the left half of a group are upright, those of the other half level.
fn lines([width, height]: [usize; 2], column_px: f64, row_px: f64) -> Option<f64> {
    let side = width.min(height) as f64;
    // Whole pixels, so that lines of one pixel are sharp.
    let (group, gap) = ((0.12 * side / 8.0).floor().max(1.0) * 8.0, (0.04 * side).floor());
    let place = |position: f64, extent: usize| {
        let from_start = position - gap;
        let from_end = position - (extent as f64 - gap - group);
        [from_start, from_end].into_iter().find(|place| (0.0..group).contains(place))
    };
    let (u, v) = (place(column_px, width)?, place(row_px, height)?);
    let line_px = [1.0, 2.0, 4.0][(v / group * 3.0) as usize % 3];
    let along = if u < group / 2.0 { column_px } else { row_px };
    Some(bright((along.round() / line_px).floor().rem_euclid(2.0) < 1.0))
}

/// Whether a point of the unit square lies on the letter F.
fn letter_f(u: f64, v: f64) -> bool {
    let is_inside = (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
    is_inside && (u < 0.25 || v < 0.18 || ((0.4..0.58).contains(&v) && u < 0.75))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Flip, Orientation, Rotation};

    const SIZE: [usize; 2] = [640, 480];

    #[test]
    fn the_border_is_bright_and_the_middle_has_rays() {
        for (column, row) in [(0.0, 0.0), (639.0, 100.0), (320.0, 479.0), (5.0, 0.0)] {
            assert_eq!(brightness(SIZE, column, row), 1.0, "{column} {row}");
        }
        assert_eq!(brightness(SIZE, 1.0, 100.0), 0.0);
        let on_circle = |k: usize| {
            let angle = TAU * (k as f64 + 0.5) / 720.0;
            brightness(SIZE, 319.5 + 60.0 * angle.cos(), 239.5 + 60.0 * angle.sin())
        };
        let changes = (0..720).filter(|&k| on_circle(k) != on_circle((k + 1) % 720)).count();
        assert_eq!(changes, 72);
    }

    #[test]
    fn no_rotation_or_mirroring_maps_the_chart_to_itself() {
        let square = [480, 480];
        let at = |[x, y]: [usize; 2]| brightness(square, x as f64, y as f64);
        for rotation in Rotation::ALL {
            for flip in Flip::ALL {
                let orientation = Orientation { rotation, flip };
                let pixels = (0..480 * 480).map(|i| [i % 480, i / 480]);
                let off = pixels.filter(|&pixel| at(pixel) != at(orientation.upright(square, pixel))).count();
                assert_eq!(off < 5000, orientation == Orientation::default(), "{orientation:?}: {off}");
            }
        }
    }

    #[test]
    fn lines_of_one_pixel_alternate_beside_all_corners() {
        for column in [24, 570] {
            for row in [24, 410] {
                let at = |x: usize| brightness(SIZE, (column + x) as f64, f64::from(row));
                assert!((0..8).all(|x| at(x) + at(x + 1) == 1.0), "{column} {row}");
            }
        }
    }

    #[test]
    fn the_wedge_rises_in_even_steps() {
        let levels: Vec<f64> =
            (0..17).map(|k| brightness(SIZE, 128.0 + 384.0 * (f64::from(k) + 0.5) / 17.0, 440.0)).collect();
        for (k, level) in levels.iter().enumerate() {
            assert!((level - k as f64 / 16.0).abs() < 1e-12, "{levels:?}");
        }
    }
}

//! Sharpness: the width of the edges of the board.

use fringeflow::geometry::Pixel;
use fringeflow_base::grey::GreyLevels;

/// Returns the width of the sharpest edge in a window around a corner, pixels: its contrast over its steepest slope. A
/// perfect edge has 1. `None` at the border of the image or without contrast.
pub(super) fn width_px(
    image: GreyLevels<'_>,
    [width, height]: [usize; 2],
    corner: Pixel,
    radius_px: f64,
) -> Option<f64> {
    /// Contrast below which the window shows no edge, grey levels.
    const LEAST_CONTRAST: f32 = 20.0;
    let range = |c: f64, size: usize| {
        let (low, high) = ((c - radius_px).ceil(), (c + radius_px).floor());
        (low >= 1.0 && high <= size as f64 - 2.0).then_some(low as usize..=high as usize)
    };
    let (columns, rows) = (range(corner.x, width)?, range(corner.y, height)?);
    let grey = |u: usize, v: usize| image.grey(v * width + u);
    let (mut least, mut most, mut steepest) = (f32::INFINITY, f32::NEG_INFINITY, 0.0_f32);
    for v in rows {
        for u in columns.clone() {
            least = least.min(grey(u, v));
            most = most.max(grey(u, v));
            let slope = (grey(u + 1, v) - grey(u - 1, v)).hypot(grey(u, v + 1) - grey(u, v - 1)) / 2.0;
            steepest = steepest.max(slope);
        }
    }
    let contrast = most - least;
    (contrast >= LEAST_CONTRAST && steepest > 0.0).then(|| f64::from(contrast / steepest))
}

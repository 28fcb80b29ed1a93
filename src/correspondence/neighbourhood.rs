//! What neighbours of one surface look like: how the phase of C1 runs on from pixel to pixel.

/// One turn of phase.
pub(super) const TURN: i32 = 65536;
/// Absolute phase of a pixel that has none: no other is near it.
pub(super) const ABSENT: i32 = i32::MIN;
/// Largest phase step between neighbours of one surface; a surface seen at a grazing angle may come close to it.
pub(super) const MAX_STEP: i32 = 24576;
/// Largest change of the step from one pixel to the next on one surface (22°). Across a depth edge the wrapped phase
/// jumps by anything: three quarters of such jumps would pass [`MAX_STEP`] alone, one in eight passes this too.
pub(super) const MAX_STEP_CHANGE: i32 = 4000;

/// The four neighbours of a pixel, as far as they lie in the image.
#[cfg(test)]
pub(super) fn neighbours(pixel: usize, width: usize, pixels: usize) -> [Option<usize>; 4] {
    let column = pixel % width;
    [
        (column > 0).then(|| pixel - 1),
        (column + 1 < width).then(|| pixel + 1),
        (pixel >= width).then(|| pixel - width),
        (pixel + width < pixels).then(|| pixel + width),
    ]
}

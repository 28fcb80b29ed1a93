//! How the wrapped phase changes from pixel to pixel, and how far it does on one surface.

/// One turn of phase.
pub(super) const TURN: i32 = 65536;
/// Stands for no absolute phase. No absolute phase lies near it.
pub(super) const ABSENT: i32 = i32::MIN;
/// Largest phase step between neighbours on one surface. A surface seen at a grazing angle comes close to it.
pub(super) const MAX_STEP: i32 = 24576;
/// Largest change of the step from one pixel to the next on one surface (22°). Across a depth edge the wrapped phase
/// jumps by any amount: three quarters of such jumps pass [`MAX_STEP`], one in eight passes this too.
pub(super) const MAX_STEP_CHANGE: i32 = 4000;

/// Step from one wrapped phase to another, less than half a turn either way, turns · 65536.
#[inline(always)]
pub(super) fn phase_step(from: u16, to: u16) -> i32 {
    i32::from(to.wrapping_sub(from) as i16)
}

/// The four neighbours of a pixel, as far as they lie in the image.
pub(super) fn neighbours(pixel: usize, width: usize, pixels: usize) -> [Option<usize>; 4] {
    let column = pixel % width;
    [
        (column > 0).then(|| pixel - 1),
        (column + 1 < width).then(|| pixel + 1),
        (pixel >= width).then(|| pixel - width),
        (pixel + width < pixels).then(|| pixel + width),
    ]
}

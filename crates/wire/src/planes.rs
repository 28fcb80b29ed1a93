//! Cutting a payload into planes.

use bytemuck::Pod;

use fringeflow_message::Block;

/// Blocks of a plane of `pixels` values of `T`.
pub(super) const fn blocks_of<T>(pixels: usize) -> usize {
    pixels.saturating_mul(size_of::<T>()).div_ceil(size_of::<Block>())
}

/// Takes the next plane off a payload that is being written.
pub(super) fn next_plane_mut<'a, T: Pod>(rest: &mut &'a mut [Block], pixels: usize) -> &'a mut [T] {
    let (plane, behind) = std::mem::take(rest).split_at_mut(blocks_of::<T>(pixels));
    *rest = behind;
    &mut bytemuck::cast_slice_mut(plane)[..pixels]
}

/// Takes the next plane off a payload that is being read.
pub(super) fn next_plane<'a, T: Pod>(rest: &mut &'a [Block], pixels: usize) -> &'a [T] {
    let (plane, behind) = rest.split_at(blocks_of::<T>(pixels));
    *rest = behind;
    &bytemuck::cast_slice(plane)[..pixels]
}

/// Makes a vector the copy of a plane, in its own memory where that is large enough.
pub(super) fn refill<T: Pod>(vector: &mut Vec<T>, plane: &[T]) {
    vector.clear();
    vector.extend_from_slice(plane);
}

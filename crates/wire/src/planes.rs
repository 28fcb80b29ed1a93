//! Planes of a payload.

use bytemuck::Pod;

use fringeflow_message::Block;

/// Blocks of a plane of `pixels` values of `T`.
pub(super) const fn blocks_of<T>(pixels: usize) -> usize {
    pixels.saturating_mul(size_of::<T>()).div_ceil(size_of::<Block>())
}

/// Takes the next plane of a payload to write it.
pub(super) fn next_plane_mut<'a, T: Pod>(rest: &mut &'a mut [Block], pixels: usize) -> &'a mut [T] {
    let (plane, after) = std::mem::take(rest).split_at_mut(blocks_of::<T>(pixels));
    *rest = after;
    &mut bytemuck::cast_slice_mut(plane)[..pixels]
}

/// Takes the next plane of a payload to read it.
pub(super) fn next_plane<'a, T: Pod>(rest: &mut &'a [Block], pixels: usize) -> &'a [T] {
    let (plane, after) = rest.split_at(blocks_of::<T>(pixels));
    *rest = after;
    &bytemuck::cast_slice(plane)[..pixels]
}

/// Copies a plane into a vector, and reuses the memory of the vector.
pub(super) fn refill<T: Pod>(vector: &mut Vec<T>, plane: &[T]) {
    vector.clear();
    vector.extend_from_slice(plane);
}

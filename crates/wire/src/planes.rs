//! Planes of a payload.

use bytemuck::Pod;
use rayon::prelude::*;

use fringeflow_message::Block;

/// Values of a plane that a thread copies at a time.
pub(super) const PIECE_VALUES: usize = 1 << 16;

/// Number of blocks of a plane of `pixels` values of type `T`.
pub(super) const fn blocks_of<T>(pixels: usize) -> usize {
    pixels.saturating_mul(size_of::<T>()).div_ceil(size_of::<Block>())
}

/// Splits off the next plane of a payload for writing. The rest of its last block becomes zero.
pub(super) fn next_plane_mut<'a, T: Pod>(rest: &mut &'a mut [Block], pixels: usize) -> &'a mut [T] {
    let (plane, after) = std::mem::take(rest).split_at_mut(blocks_of::<T>(pixels));
    *rest = after;
    if let Some(last) = plane.last_mut() {
        *last = Block([0; _]);
    }
    &mut bytemuck::cast_slice_mut(plane)[..pixels]
}

/// Splits off the next plane of a payload for reading.
pub(super) fn next_plane<'a, T: Pod>(rest: &mut &'a [Block], pixels: usize) -> &'a [T] {
    let (plane, after) = rest.split_at(blocks_of::<T>(pixels));
    *rest = after;
    &bytemuck::cast_slice(plane)[..pixels]
}

/// Copies a plane in parallel.
pub(super) fn copy<T: Copy + Send + Sync>(from: &[T], to: &mut [T]) {
    // Otherwise pieces that only one side has would be left out.
    assert_eq!(from.len(), to.len(), "the planes must have the same size");
    let pieces = to.par_chunks_mut(PIECE_VALUES).zip(from.par_chunks(PIECE_VALUES));
    pieces.for_each(|(to, from)| to.copy_from_slice(from));
}

/// Copies a plane into a vector and reuses its memory.
pub(super) fn refill<T: Pod + Send + Sync>(vector: &mut Vec<T>, plane: &[T]) {
    vector.resize(plane.len(), T::zeroed());
    copy(plane, vector);
}

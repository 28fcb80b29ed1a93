//! Bands of rows: what workers take at a time, each with scratch memory of its own that stays from image to image.

/// Rows of a band.
pub(super) const BAND_ROWS: usize = 32;

/// One scratch buffer for each band of an image of so many rows.
pub(super) fn resize<T: Default + Clone>(scratches: &mut Vec<T>, rows: usize) {
    scratches.resize(rows.div_ceil(BAND_ROWS), T::default());
}

//! Bands of rows: what workers take at a time, each with room of its own that stays from image to image.

/// Rows of a band.
pub(super) const BAND_ROWS: usize = 32;

/// Makes room for the bands of an image of so many rows.
pub(super) fn resize<T: Default + Clone>(rooms: &mut Vec<T>, rows: usize) {
    rooms.resize(rows.div_ceil(BAND_ROWS), T::default());
}

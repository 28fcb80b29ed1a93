//! Bands of rows: the unit of parallel work. Each band keeps its scratch memory from image to image. Threads take one band
//! at a time (`with_max_len(1)`), so that none waits long for the last.

/// Rows of a band.
pub(super) const BAND_ROWS: usize = 32;

/// Resizes to one scratch buffer for each band of an image of `rows` rows.
pub(super) fn resize<T: Default + Clone>(scratches: &mut Vec<T>, rows: usize) {
    scratches.resize(rows.div_ceil(BAND_ROWS), T::default());
}

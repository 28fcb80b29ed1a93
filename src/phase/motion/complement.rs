//! What a linear model cannot explain. In: the values of its terms at each image. Out: orthonormal directions.

/// Orthonormal basis of the complement of the columns of `basis`, which has one row per image (Gram and Schmidt).
pub(super) fn unexplained<const COLUMNS: usize>(basis: &[[f64; COLUMNS]]) -> Vec<Vec<f64>> {
    /// Vectors shorter than this are linearly dependent.
    const MIN_LENGTH: f64 = 1e-6;
    let images = basis.len();
    let explained = (0..COLUMNS).map(|k| basis.iter().map(|row| row[k]).collect::<Vec<f64>>());
    let units = (0..images).map(|i| (0..images).map(|j| f64::from(u8::from(i == j))).collect());
    let mut directions: Vec<Vec<f64>> = Vec::with_capacity(images);
    for mut direction in explained.chain(units) {
        for other in &directions {
            let projection: f64 = other.iter().zip(&direction).map(|(a, b)| a * b).sum();
            direction.iter_mut().zip(other).for_each(|(value, a)| *value -= projection * a);
        }
        let length = direction.iter().map(|value| value * value).sum::<f64>().sqrt();
        if length > MIN_LENGTH {
            direction.iter_mut().for_each(|value| *value /= length);
            directions.push(direction);
        }
    }
    directions.into_iter().skip(COLUMNS).take(images - COLUMNS).collect()
}

//! What a linear model cannot explain. In: the values of its terms at each image. Out: orthonormal directions.

/// Orthonormal basis of the complement of `terms`, each with a value per image (Gram and Schmidt). Its first directions
/// are those that explain `others`.
pub(super) fn unexplained(images: usize, terms: &[Vec<f64>], others: &[Vec<f64>]) -> Vec<Vec<f64>> {
    /// Vectors shorter than this are linearly dependent.
    const MIN_LENGTH: f64 = 1e-6;
    let units = (0..images).map(|i| (0..images).map(|j| f64::from(u8::from(i == j))).collect());
    let mut directions: Vec<Vec<f64>> = Vec::with_capacity(images);
    for mut direction in terms.iter().chain(others).cloned().chain(units) {
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
    directions.into_iter().skip(terms.len()).take(images - terms.len()).collect()
}

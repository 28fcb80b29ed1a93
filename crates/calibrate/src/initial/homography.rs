//! The homography between a plane and its image (Hartley and Zisserman 2004, algorithm 4.2).

use fringeflow::geometry::Pixel;
use nalgebra::{DMatrix, Matrix3, Vector2};

/// Returns the homography that maps points of the plane to pixels, from at least four pairs; `None` if they do not
/// determine it.
pub(crate) fn homography(pairs: &[(Vector2<f64>, Pixel)]) -> Option<Matrix3<f64>> {
    if pairs.len() < 4 {
        return None;
    }
    let plane = normalization(pairs.iter().map(|(point, _)| *point))?;
    let image = normalization(pairs.iter().map(|(_, pixel)| pixel.coords))?;
    let mut equations = DMatrix::zeros(2 * pairs.len().max(5), 9);
    for (k, (point, pixel)) in pairs.iter().enumerate() {
        let p = plane * point.push(1.0);
        let q = image * pixel.coords.push(1.0);
        for i in 0..3 {
            equations[(2 * k, i)] = p[i];
            equations[(2 * k, 6 + i)] = -q.x * p[i];
            equations[(2 * k + 1, 3 + i)] = p[i];
            equations[(2 * k + 1, 6 + i)] = -q.y * p[i];
        }
    }
    let solution = smallest_direction(equations)?;
    let normalized = Matrix3::from_row_iterator(solution);
    let found = image.try_inverse()? * normalized * plane;
    found.iter().all(|value| value.is_finite()).then_some(found)
}

/// The direction in which a matrix is smallest.
pub(crate) fn smallest_direction(matrix: DMatrix<f64>) -> Option<Vec<f64>> {
    let svd = matrix.try_svd(false, true, f64::EPSILON, 1000)?;
    let v_t = svd.v_t?;
    let row = v_t.row(svd.singular_values.imin());
    Some(row.iter().copied().collect())
}

/// Moves points to a mean of zero and a mean distance of √2.
fn normalization(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let count = points.clone().count() as f64;
    let mean = points.clone().sum::<Vector2<f64>>() / count;
    let distance = points.map(|point| (point - mean).norm()).sum::<f64>() / count;
    let scale = std::f64::consts::SQRT_2 / distance;
    let shift = -mean * scale;
    scale.is_finite().then(|| Matrix3::new(scale, 0.0, shift.x, 0.0, scale, shift.y, 0.0, 0.0, 1.0))
}

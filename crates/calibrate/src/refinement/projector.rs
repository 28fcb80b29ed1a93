//! A projector of which only columns are known, from points of scans.
//!
//! In: points in the frame of C1 and the column that lights each. Out: a first projector. Columns tell its focal length
//! across, its principal point across and its pose, but for the shift along its columns; what they do not tell is set as if
//! its pixels were square and its axis in the middle of its image. [`super::refine`] makes it better.

use fringeflow::geometry::{Camera, Distortion, Pose, Vector3};
use nalgebra::{DMatrix, Matrix4, Rotation3, Translation3, UnitQuaternion, Vector4};

use crate::initial::smallest_direction;
use crate::median::median;

/// Rounds in which points with a wrong column are found and left out.
const ROUNDS: usize = 6;
/// Residuals beyond this multiple of their median are left out.
const OUTLIER_MEDIANS: f64 = 6.0;
/// Fewest points.
const FEWEST: usize = 50;

/// Finds a projector with an image of `size_px` (width, height) and its pose in the frame of C1. `None` if the points do
/// not determine it: too few, or all on one plane.
#[must_use]
pub fn projector_from_columns(points: &[(Vector3, f64)], size_px: [usize; 2]) -> Option<(Camera, Pose)> {
    let mut kept: Vec<(Vector3, f64)> = points.to_vec();
    let mut rows = None;
    for _ in 0..ROUNDS {
        if kept.len() < FEWEST {
            return None;
        }
        let found = projective_rows(&kept)?;
        let residual = |(point, column_px): &(Vector3, f64)| (column(&found, point) - column_px).abs();
        let limit = OUTLIER_MEDIANS * median(kept.iter().map(residual).collect())?;
        kept = points.iter().filter(|point| residual(point) <= limit).copied().collect();
        rows = Some(found);
    }
    let [numerator, denominator] = rows?;
    let scale = denominator.xyz().norm();
    let sign = if denominator.dot(&kept[0].0.push(1.0)) < 0.0 { -1.0 } else { 1.0 };
    let (across, along) = (numerator * (sign / scale), denominator * (sign / scale));
    let axis = along.xyz();
    let centre_px = across.xyz().dot(&axis);
    let right = across.xyz() - axis * centre_px;
    let focal_px = right.norm();
    let right = right / focal_px;
    let down = axis.cross(&right);
    let rotation = nalgebra::Matrix3::from_rows(&[right.transpose(), down.transpose(), axis.transpose()]);
    let depth = |point: &Vector3| axis.dot(point) + along.w;
    // The shift along the columns is free: the points lie about the middle row.
    let middle = kept.iter().map(|(point, _)| down.dot(point)).sum::<f64>() / kept.len() as f64;
    let shift = Vector3::new((across.w - centre_px * along.w) / focal_px, -middle, along.w);
    let is_sound = focal_px.is_finite() && kept.iter().all(|(point, _)| depth(point) > 0.0);
    let principal_px = [centre_px, (size_px[1] as f64 - 1.0) / 2.0];
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let camera = Camera::new([focal_px; 2], principal_px, Distortion::default(), size_px);
    is_sound.then(|| (camera, Pose::from_parts(Translation3::from(shift), rotation)))
}

/// Rows a and c with column = (a·X)/(c·X) for homogeneous points X, by the direct linear transform.
fn projective_rows(points: &[(Vector3, f64)]) -> Option<[Vector4<f64>; 2]> {
    let count = points.len() as f64;
    let mean = points.iter().map(|(point, _)| point).sum::<Vector3>() / count;
    let spread = (points.iter().map(|(point, _)| (point - mean).norm_squared()).sum::<f64>() / count).sqrt();
    let mean_px = points.iter().map(|(_, column)| column).sum::<f64>() / count;
    let spread_px = (points.iter().map(|(_, column)| (column - mean_px).powi(2)).sum::<f64>() / count).sqrt();
    let mut normal = DMatrix::zeros(8, 8);
    for (point, column_px) in points {
        let p = ((point - mean) / spread).push(1.0);
        let u = (column_px - mean_px) / spread_px;
        let row = nalgebra::DVector::from_iterator(8, p.iter().copied().chain(p.iter().map(|value| -u * value)));
        normal.ger(1.0, &row, &row, 1.0);
    }
    let solution = smallest_direction(normal)?;
    let (a, c) = (Vector4::from_column_slice(&solution[..4]), Vector4::from_column_slice(&solution[4..]));
    let mut normalize = Matrix4::identity() / spread;
    normalize.fixed_view_mut::<3, 1>(0, 3).copy_from(&(-mean / spread));
    normalize[(3, 3)] = 1.0;
    let back = |row: Vector4<f64>| normalize.transpose() * row;
    let (a, c) = (back(a), back(c));
    let rows = [a * spread_px + c * mean_px, c];
    rows.iter().all(|row| row.iter().all(|value| value.is_finite())).then_some(rows)
}

fn column([numerator, denominator]: &[Vector4<f64>; 2], point: &Vector3) -> f64 {
    let homogeneous = point.push(1.0);
    numerator.dot(&homogeneous) / denominator.dot(&homogeneous)
}

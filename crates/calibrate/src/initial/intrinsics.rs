//! First values of focal length and principal point from homographies of a plane, and the pose for each.
//!
//! Distortion is zero here; [`crate::adjustment`] finds it.

use fringeflow::geometry::{Pose, Vector3};
use nalgebra::{DMatrix, Matrix3, Rotation3, Translation3, UnitQuaternion};

use super::homography::smallest_direction;
use crate::lens::Lens;

/// Returns the intrinsic parameters that Zhang's closed form finds (Zhang 2000, section 3.1, without skew); `None` if
/// the views do not determine them.
pub(super) fn closed_form(homographies: &[Matrix3<f64>], size_px: [usize; 2]) -> Option<Lens> {
    if homographies.len() < 3 {
        return None;
    }
    let scaling = centred(size_px, 0.5 * (size_px[0] + size_px[1]) as f64);
    let mut equations = DMatrix::zeros(2 * homographies.len(), 5);
    for (k, homography) in homographies.iter().enumerate() {
        let h = unit_scale(&(scaling * homography));
        let [v11, v12, v22] = [row(&h, 0, 0), row(&h, 0, 1), row(&h, 1, 1)];
        for i in 0..5 {
            equations[(2 * k, i)] = v12[i];
            equations[(2 * k + 1, i)] = v11[i] - v22[i];
        }
    }
    // B = K⁻ᵀ·K⁻¹ up to scale: B11, B22, B13, B23, B33.
    let b = smallest_direction(equations)?;
    let [b11, b22, b13, b23, b33] = [b[0], b[1], b[2], b[3], b[4]];
    let (cx, cy) = (-b13 / b11, -b23 / b22);
    let scale = b33 - b13 * b13 / b11 - b23 * b23 / b22;
    let (fx, fy) = ((scale / b11).sqrt(), (scale / b22).sqrt());
    let back = scaling.try_inverse()?;
    let (unit, offset) = (back[(0, 0)], [back[(0, 2)], back[(1, 2)]]);
    let lens = Lens::ideal([fx * unit, fy * unit], [cx * unit + offset[0], cy * unit + offset[1]]);
    lens.0.iter().all(|value| value.is_finite()).then_some(lens)
}

/// Returns the lens with square pixels and a given principal point whose focal length fits the homographies best.
pub(super) fn with_principal_point(homographies: &[Matrix3<f64>], principal_px: [f64; 2]) -> Option<Lens> {
    let (mut numerator, mut denominator) = (0.0, 0.0);
    let shift = Matrix3::new(1.0, 0.0, -principal_px[0], 0.0, 1.0, -principal_px[1], 0.0, 0.0, 1.0);
    for homography in homographies {
        let h = unit_scale(&(shift * homography));
        let [a, b] = [h.column(0), h.column(1)];
        // aᵀωb = 0 and aᵀωa = bᵀωb with ω = diag(1/f², 1/f², 1): linear in 1/f².
        for (across, along) in
            [(a.x * b.x + a.y * b.y, a.z * b.z), (a.x * a.x + a.y * a.y - b.x * b.x - b.y * b.y, a.z * a.z - b.z * b.z)]
        {
            numerator -= across * along;
            denominator += across * across;
        }
    }
    let focal_px = (denominator / numerator).sqrt();
    focal_px.is_finite().then(|| Lens::ideal([focal_px; 2], principal_px))
}

/// Returns the pose of the plane in the frame of the device, from its homography.
pub(crate) fn pose_of_plane(homography: &Matrix3<f64>, lens: &Lens) -> Option<Pose> {
    let ([fx, fy], [cx, cy]) = (lens.focal_px(), lens.principal_px());
    let k = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
    let h = k.try_inverse()? * homography;
    let scale = 2.0 / (h.column(0).norm() + h.column(1).norm());
    let scale = if h[(2, 2)] < 0.0 { -scale } else { scale };
    let (r1, r2, t): (Vector3, Vector3, Vector3) = (h.column(0) * scale, h.column(1) * scale, h.column(2) * scale);
    let svd = Matrix3::from_columns(&[r1, r2, r1.cross(&r2)]).try_svd(true, true, f64::EPSILON, 1000)?;
    let rotation = svd.u? * svd.v_t?;
    if t.z <= 0.0 || !t.iter().chain(rotation.iter()).all(|value| value.is_finite()) {
        return None;
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Some(Pose::from_parts(Translation3::from(t), rotation))
}

/// Moves the middle of the image to zero and scales `unit` pixels to one.
fn centred([width, height]: [usize; 2], unit: f64) -> Matrix3<f64> {
    let (cx, cy) = ((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0);
    Matrix3::new(1.0 / unit, 0.0, -cx / unit, 0.0, 1.0 / unit, -cy / unit, 0.0, 0.0, 1.0)
}

/// Scales a homography so that no view has more weight than another.
fn unit_scale(h: &Matrix3<f64>) -> Matrix3<f64> {
    h / h.column(0).norm().hypot(h.column(1).norm())
}

/// Coefficients of B11, B22, B13, B23, B33 in hᵢᵀ·B·hⱼ.
fn row(h: &Matrix3<f64>, i: usize, j: usize) -> [f64; 5] {
    let (a, b) = (h.column(i), h.column(j));
    [a.x * b.x, a.y * b.y, a.x * b.z + a.z * b.x, a.y * b.z + a.z * b.y, a.z * b.z]
}

//! Puts the projector of a rig at another place, and aims it at the measurement volume.
//!
//! In: a rig, its volume, and where the centre of the projector shall stand. Out: the rig, whose projector shows the
//! middle of its image at the middle of the volume. Its columns keep their direction as far as the new line of sight
//! allows: the direction of a column and the line of sight span the same plane as the old direction and it.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

use fringeflow::geometry::{Camera, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3};

use super::solid::MM_PER_M;
use super::{SimulationError, check_range};

/// Farthest place along an axis, millimetres.
const MAX_MM: f64 = 5000.0;
/// Smallest distance of the projector from the near face of the volume, millimetres.
const MIN_GAP_MM: f64 = 20.0;
/// Smallest sine of the angle between the columns and the line of sight.
const MIN_SINE: f64 = 0.05;

/// Returns the rig with its projector at `at_mm`, in the frame of C1.
///
/// # Errors
/// The place is too far away, not before the volume, or on the axis of the columns through the middle of the volume.
pub(super) fn with_projector_at(
    rig: &Rig,
    volume: &MeasurementVolume,
    at_mm: [f64; 3],
) -> Result<Rig, SimulationError> {
    for (what, value) in ["the projector's X", "the projector's Y", "the projector's Z"].into_iter().zip(at_mm) {
        check_range(what, value, -MAX_MM, MAX_MM, "mm")?;
    }
    let eye = Point3::from(Vector3::from(at_mm) / MM_PER_M);
    let in_volume = volume.cam1_from_volume().inverse_transform_point(&eye);
    let gap_mm = (volume.min().z - in_volume.z) * MM_PER_M;
    if gap_mm < MIN_GAP_MM {
        return Err(SimulationError::ProjectorAtVolume { at_mm, gap_mm, least_mm: MIN_GAP_MM });
    }
    let target = volume.cam1_from_volume() * nalgebra::center(volume.min(), volume.max());
    let column = rig.projector_from_cam1.inverse_transform_vector(&Vector3::y());
    let seen = middle_ray(&rig.projector).and_then(|ray| facing(&ray, &Vector3::y()));
    let wanted = facing(&(target - eye), &column);
    let (Some(seen), Some(wanted)) = (seen, wanted) else {
        return Err(SimulationError::ProjectorAlongColumns { at_mm });
    };
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(seen * wanted.transpose()));
    let projector_from_cam1 = Pose::from_parts((rotation * -eye.coords).into(), rotation);
    Ok(Rig { projector_from_cam1, ..*rig })
}

/// The ray of the middle of the image, in the frame of the projector.
fn middle_ray(projector: &Camera) -> Option<Vector3> {
    let middle = [projector.width_px(), projector.height_px()].map(|size| (size as f64 - 1.0) / 2.0);
    projector.ray(&Pixel::from(middle))
}

/// Returns a right-handed frame whose axis z leads along `sight` and whose axis y is as close to `column` as possible;
/// `None` if both are nearly parallel.
fn facing(sight: &Vector3, column: &Vector3) -> Option<Matrix3<f64>> {
    let z = sight.try_normalize(0.0)?;
    let y = (column - z * z.dot(column)).try_normalize(MIN_SINE * column.norm())?;
    Some(Matrix3::from_columns(&[y.cross(&z), y, z]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{RigOptions, VirtualRig};

    /// Places in the base, beyond either camera, above and below, and to the side of the base, millimetres.
    const PLACES_MM: [[f64; 3]; 7] = [
        [50.0, -30.0, 0.0],
        [-60.0, -40.0, 5.0],
        [150.0, -60.0, 20.0],
        [40.0, -140.0, 10.0],
        [55.0, 90.0, -20.0],
        [260.0, -10.0, 90.0],
        [40.0, -60.0, -150.0],
    ];

    fn at(place_mm: [f64; 3]) -> Result<VirtualRig, SimulationError> {
        VirtualRig::new(&RigOptions { projector_at_mm: Some(place_mm), ..RigOptions::usual(0.025) })
    }

    #[test]
    fn the_projector_stands_there_and_aims_at_the_middle_with_upright_columns() {
        for place_mm in PLACES_MM {
            let VirtualRig { exact, exact_volume, calibrated, deviation, .. } = at(place_mm).unwrap();
            let off_mm = (exact.centre_of_projector().coords * MM_PER_M - Vector3::from(place_mm)).norm();
            let middle = exact.project_projector(&(exact_volume.cam1_from_volume() * Point3::origin())).unwrap();
            assert!(off_mm < 1e-9 && (middle - Pixel::new(511.5, 511.5)).norm() < 1e-6, "{place_mm:?}: {middle}");
            let turned = &exact.projector_from_cam1.rotation;
            assert!((turned.to_rotation_matrix().matrix().determinant() - 1.0).abs() < 1e-9);
            let usual = VirtualRig::new(&RigOptions::usual(0.025)).unwrap().exact.projector_from_cam1;
            let (column, before) = (turned.inverse() * Vector3::y(), usual.inverse_transform_vector(&Vector3::y()));
            let sight = turned.inverse() * middle_ray(&exact.projector).unwrap();
            assert!(column.dot(&before) > 0.8, "{place_mm:?}: {column} {before}");
            assert!(sight.cross(&before).dot(&column).abs() < 5e-3, "{place_mm:?}: the columns are rolled");
            // The error of the calibration applies to every place.
            assert!((deviation.delta_rms - 0.041).abs() < 1e-6 && calibrated != exact, "{place_mm:?}: {deviation:?}");
        }
    }

    #[test]
    fn a_place_that_cannot_light_the_volume_is_refused_with_its_value() {
        let refused = |place_mm| at(place_mm).unwrap_err().to_string();
        assert!(refused([40.0, 0.0, 300.0]).contains("40, 0, 300"), "{}", refused([40.0, 0.0, 300.0]));
        assert!(refused([9000.0, 0.0, 0.0]).contains("X is 9000 mm"));
        assert!(refused([f64::NAN, 0.0, 0.0]).contains("X is NaN mm"));
        let VirtualRig { exact, exact_volume, .. } = VirtualRig::new(&RigOptions::usual(0.025)).unwrap();
        let column = exact.projector_from_cam1.inverse_transform_vector(&Vector3::y());
        let below = exact_volume.cam1_from_volume() * Point3::origin() + column * 0.4;
        let along = refused((below.coords * MM_PER_M).into());
        assert!(along.contains("along its own columns"), "{along}");
    }
}

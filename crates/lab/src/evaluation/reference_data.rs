//! The reference data RD of the paper for a rendered scene: the true correspondences that Gray code also finds (section
//! 3).

use fringeflow::cloud::Cloud;
use fringeflow::geometry::MeasurementVolume;
use fringeflow_dataset::RenderedTruth;

use super::pixel_grid::{PixelGrid, is_close, pixel, point};
use super::{EvaluationError, MAX_REFERENCE_RESIDUAL_RAD};

/// Limits the references of `truth` to measurable pixels at which the Gray-code reference agrees with the truth within
/// [`super::TOLERANCE_PX`]. `gray` is its cloud. All other points of `gray` go to `gray_cam2_px`. The images of C1 have
/// `size_px` (width, height).
///
/// # Errors
/// The cloud or the truth has another image size.
pub fn limit_to_gray_code(
    truth: RenderedTruth,
    gray: &Cloud,
    size_px: [usize; 2],
) -> Result<RenderedTruth, EvaluationError> {
    let grid = PixelGrid::new(gray, size_px)?;
    for found in [truth.measurable.len(), truth.cam2_px.len()] {
        if found != grid.len() {
            return Err(EvaluationError::Size { found, expected: grid.len() });
        }
    }
    let confirmed =
        |i: usize| truth.measurable[i] && grid.get(i).is_some_and(|p| is_close(&pixel(p.cam2_px), truth.cam2_px[i]));
    let reference: Vec<bool> = (0..grid.len()).map(confirmed).collect();
    let elsewhere = |(i, &found): (usize, &bool)| match grid.get(i) {
        Some(point) if !found => point.cam2_px,
        _ => [f32::NAN; 2],
    };
    let gray_cam2_px = Some(reference.iter().enumerate().map(elsewhere).collect());
    Ok(RenderedTruth { reference, gray_cam2_px, ..truth })
}

/// The reference data RD of the paper for any scene: the correspondences of `gray`, a cloud of a Gray-code method, in the
/// measurement volume and with a back-projection residual of at most [`MAX_REFERENCE_RESIDUAL_RAD`]. Beyond it the pixel
/// mixes two surfaces, or its Gray code is wrong.
#[must_use]
pub fn gray_reference_data(mut gray: Cloud, volume: &MeasurementVolume) -> Cloud {
    gray.points.retain(|point_of_gray| {
        let is_reliable = point_of_gray.delta_rad.abs() <= MAX_REFERENCE_RESIDUAL_RAD;
        is_reliable && volume.contains(&point(point_of_gray.position_m, 1.0))
    });
    gray
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::test_cloud::cloud;

    const NONE: [f32; 2] = [f32::NAN; 2];

    /// One row of five pixels: three measurable, one unlit, one whose ray hits nothing.
    fn truth() -> RenderedTruth {
        let measurable = vec![true, true, true, false, false];
        RenderedTruth {
            cam2_px: vec![[10.0, 0.0], [11.0, 0.0], [12.0, 0.0], [13.0, 0.0], NONE],
            point: vec![[0.0, 0.0, 300.0]; 5],
            seen_by_cam2: vec![true, true, true, true, false],
            lit: measurable.clone(),
            in_volume: vec![true, true, true, true, false],
            reference: measurable.clone(),
            measurable,
            gray_cam2_px: None,
        }
    }

    #[test]
    fn only_correspondences_confirmed_by_gray_code_are_references() {
        let gray = cloud(&[
            ([0, 0], [11.9, 0.0], 0.3), // 1.9 px off
            ([1, 0], [13.1, 0.0], 0.3), // 2.1 px off
            ([3, 0], [13.0, 0.0], 0.3), // right, but not measurable
            ([4, 0], [50.0, 1.0], 0.3), // no surface
        ]);
        let limited = limit_to_gray_code(truth(), &gray, [5, 1]).unwrap();
        assert_eq!(limited.reference, [true, false, false, false, false]);
        let elsewhere = limited.gray_cam2_px.unwrap();
        assert_eq!([elsewhere[1], elsewhere[3], elsewhere[4]], [[13.1, 0.0], [13.0, 0.0], [50.0, 1.0]]);
        assert!(elsewhere[0][0].is_nan() && elsewhere[2][0].is_nan());
        assert_eq!(limited.measurable, truth().measurable);
    }

    #[test]
    fn truths_and_clouds_of_other_images_are_refused() {
        let refused = limit_to_gray_code(truth(), &Cloud::default(), [6, 1]).unwrap_err();
        assert_eq!(refused, EvaluationError::Size { found: 5, expected: 6 });
        let outside = cloud(&[([5, 0], [0.0, 0.0], 0.3)]);
        let refused = limit_to_gray_code(truth(), &outside, [5, 1]).unwrap_err();
        assert!(matches!(refused, EvaluationError::OutsideImage { u: 5, v: 0, .. }));
    }
}

//! Evaluates a cloud against the Gray-code reference of a captured scene.

use fringeflow::cloud::Cloud;
use fringeflow_dataset::CapturedTruth;

use super::pixel_grid::{PixelGrid, pixel, point};
use super::scores::Tally;
use super::{EDGE_TOLERANCE_PX, Evaluation, EvaluationError, Judgement, MAX_REFERENCE_RESIDUAL_RAD, TOLERANCE_PX};

/// Metres per unit of the points of a captured truth, millimetres.
const UNIT_M: f64 = 1e-3;

/// Evaluates a cloud against the Gray-code reference of a captured scene, for images of C1 of `size_px` (width,
/// height).
///
/// The references lie between pixels. Each is compared with the point of the nearest pixel; both its image points are
/// first shifted by the offset from the centre of that pixel. A point without a reference is unjudged, since Gray code
/// is not complete.
///
/// # Errors
/// The cloud has another image size, or the truth has no reliable reference.
pub fn against_captured(
    cloud: &Cloud,
    size_px: [usize; 2],
    truth: &CapturedTruth,
) -> Result<Evaluation, EvaluationError> {
    let grid = PixelGrid::new(cloud, size_px)?;
    let unjudged = |i| if grid.get(i).is_some() { Judgement::Unjudged } else { Judgement::Nothing };
    let mut judgements: Vec<Judgement> = (0..grid.len()).map(unjudged).collect();
    let (mut tally, mut errors_m) = (Tally::default(), Vec::new());
    for k in reliable_references(truth) {
        let i = grid.index_of(&pixel(truth.cam1_px[k]));
        let (judgement, error_m) = judge(&grid, truth, k, i);
        tally.reference += 1;
        tally.add(judgement);
        errors_m.extend(error_m);
        judgements[i] = better(judgements[i], judgement);
    }
    tally.unjudged = judgements.iter().filter(|&&j| j == Judgement::Unjudged).count() as u64;
    Ok(Evaluation { scores: tally.scores(cloud.points.len(), None, &mut errors_m)?, judgements })
}

/// Returns the references with a small back-projection residual.
fn reliable_references(truth: &CapturedTruth) -> impl Iterator<Item = usize> + '_ {
    let residuals = truth.residual_rad.iter().enumerate();
    residuals.filter(|(_, r)| r.abs() <= MAX_REFERENCE_RESIDUAL_RAD).map(|(k, _)| k)
}

/// Returns the judgement of reference `k` at pixel `i`, and the 3D error of a correct point in metres.
fn judge(grid: &PixelGrid<'_>, truth: &CapturedTruth, k: usize, i: usize) -> (Judgement, Option<f64>) {
    let Some(found) = grid.get(i) else { return (Judgement::Missed, None) };
    let shift = grid.centre(i) - pixel(truth.cam1_px[k]);
    let off_px = (pixel(found.cam2_px) - shift - pixel(truth.cam2_px[k])).norm();
    if off_px <= TOLERANCE_PX {
        let error_m = (point(found.position_m, 1.0) - point(truth.point_mm[k], UNIT_M)).norm();
        return (Judgement::Correct, Some(error_m));
    }
    (if off_px > EDGE_TOLERANCE_PX { Judgement::Wrong } else { Judgement::Tolerated }, None)
}

/// Returns the better judgement, for a pixel with several references.
fn better(a: Judgement, b: Judgement) -> Judgement {
    let rank = |j| match j {
        Judgement::Correct => 0,
        Judgement::Tolerated => 1,
        Judgement::Wrong | Judgement::Stray | Judgement::Missed => 2,
        Judgement::Unjudged | Judgement::Nothing => 3,
    };
    if rank(b) < rank(a) { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::test_cloud::cloud;

    fn truth() -> CapturedTruth {
        CapturedTruth {
            // The last reference has a residual above the limit.
            cam1_px: vec![[0.2, 0.0], [1.0, 0.4], [1.9, 0.0], [3.0, 0.0], [4.0, 0.0]],
            cam2_px: vec![[50.2, 0.0], [51.0, 0.4], [51.9, 0.0], [53.0, 0.0], [54.0, 0.0]],
            point_mm: vec![[0.0, 0.0, 300.0]; 5],
            residual_rad: vec![0.0, -0.1, 0.1, 0.15, 0.2],
        }
    }

    #[test]
    fn every_judgement_occurs() {
        let points = [
            ([0, 0], [51.9, 0.0], 0.3), // 1.9 px off
            ([1, 0], [53.5, 0.0], 0.3), // 2.5 px off: tolerated
            ([2, 0], [55.5, 0.0], 0.3), // 3.5 px off
            ([4, 0], [54.0, 0.0], 0.3), // no reliable reference
        ];
        let found = against_captured(&cloud(&points), [6, 1], &truth()).unwrap();
        use Judgement::{Correct, Missed, Nothing, Tolerated, Unjudged, Wrong};
        assert_eq!(found.judgements, [Correct, Tolerated, Wrong, Missed, Unjudged, Nothing]);
        let s = found.scores;
        assert_eq!((s.reference, s.unjudged, s.outliers_percent), (4, 1, None));
        assert_eq!((s.com_percent, s.miss_percent, s.fpc_percent), (25.0, 25.0, 25.0));
        assert!(s.rms_m.unwrap() < 1e-7);
    }

    #[test]
    fn each_of_several_references_of_a_pixel_counts() {
        let mut truth = truth();
        truth.cam1_px[1] = [0.3, 0.0];
        truth.cam2_px[1] = [90.0, 0.0];
        let found = against_captured(&cloud(&[([0, 0], [50.0, 0.0], 0.3)]), [6, 1], &truth).unwrap();
        assert_eq!(found.judgements[0], Judgement::Correct);
        assert_eq!((found.scores.com_percent, found.scores.wrong_percent), (25.0, 25.0));
    }
}

//! Evaluates a cloud against another cloud, such as the Gray-code reference.

use fringeflow::cloud::Cloud;

use super::pixel_grid::{PixelGrid, pixel, point};
use super::scores::Tally;
use super::{Evaluation, EvaluationError, Judgement, TOLERANCE_PX};

/// Evaluates a cloud against a reference cloud of the same images, C1 of `size_px` (width, height).
///
/// A point at a pixel without a reference is tolerated if the reference of a neighbouring pixel explains it. Otherwise
/// it is unjudged.
///
/// # Errors
/// A cloud has another image size, or the reference has no points.
pub fn against_cloud(cloud: &Cloud, size_px: [usize; 2], reference: &Cloud) -> Result<Evaluation, EvaluationError> {
    let (grid, truth) = (PixelGrid::new(cloud, size_px)?, PixelGrid::new(reference, size_px)?);
    let mut tally = Tally { reference: reference.points.len() as u64, ..Tally::default() };
    let mut errors_m = Vec::new();
    let mut judgements = Vec::with_capacity(grid.len());
    for i in 0..grid.len() {
        let judgement = judge(&grid, &truth, i);
        if let (Judgement::Correct, Some(a), Some(b)) = (judgement, grid.get(i), truth.get(i)) {
            errors_m.push((point(a.position_m, 1.0) - point(b.position_m, 1.0)).norm());
        }
        tally.add(judgement);
        judgements.push(judgement);
    }
    Ok(Evaluation { scores: tally.scores(cloud.points.len(), None, &mut errors_m)?, judgements })
}

fn judge(grid: &PixelGrid<'_>, truth: &PixelGrid<'_>, i: usize) -> Judgement {
    let reference = truth.get(i).map(|r| pixel(r.cam2_px));
    let Some(found) = grid.get(i) else {
        return if reference.is_some() { Judgement::Missed } else { Judgement::Nothing };
    };
    let cam2_px = pixel(found.cam2_px);
    if reference.is_some_and(|r| (cam2_px - r).norm() <= TOLERANCE_PX) {
        return Judgement::Correct;
    }
    if grid.is_explained(i, &cam2_px, |n| truth.get(n).map(|r| pixel(r.cam2_px))) {
        return Judgement::Tolerated;
    }
    if reference.is_some() { Judgement::Wrong } else { Judgement::Unjudged }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::test_cloud::cloud;

    #[test]
    fn every_judgement_occurs() {
        let reference: Vec<_> = (0..5).map(|u| ([u, 0], [100.0 + 10.0 * f32::from(u), 0.0], 0.3)).collect();
        let points = [
            ([0, 0], [101.0, 0.0], 0.3002),
            ([1, 0], [122.0, 0.0], 0.3),
            ([2, 0], [150.0, 0.0], 0.3),
            ([5, 0], [140.0, 0.0], 0.3),
            ([6, 0], [0.0, 0.0], 0.3),
        ];
        let found = against_cloud(&cloud(&points), [8, 1], &cloud(&reference)).unwrap();
        use Judgement::{Correct, Missed, Nothing, Tolerated, Unjudged, Wrong};
        assert_eq!(found.judgements, [Correct, Tolerated, Wrong, Missed, Missed, Tolerated, Unjudged, Nothing]);
        let s = found.scores;
        assert_eq!((s.com_percent, s.miss_percent, s.fpc_percent, s.unjudged), (20.0, 40.0, 20.0, 1));
        assert!((s.rms_m.unwrap() - 2e-4).abs() < 1e-7);
    }

    #[test]
    fn an_empty_reference_is_refused() {
        let refused = against_cloud(&Cloud::default(), [8, 1], &Cloud::default());
        assert_eq!(refused, Err(EvaluationError::NoReference));
    }
}

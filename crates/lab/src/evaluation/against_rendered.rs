//! Evaluates a cloud against the exact truth of a rendered scene.

use fringeflow::cloud::{Cloud, CloudPoint};
use fringeflow_dataset::{RenderedTruth, Setup};

use super::frames::Frames;
use super::interior::interior;
use super::moved_truth::truth_at;
use super::pixel_grid::{PixelGrid, is_close, pixel, point};
use super::scores::{Scores, Tally};
use super::{Evaluation, EvaluationError, Judgement};

/// Evaluates a cloud against the truth of a rendered scene, for images of C1 of `size_px` (width, height).
///
/// A point without a reference is stray, with two exceptions. It is tolerated if a surface that C2 sees and P lights
/// explains it, at its pixel or at a neighbour, or if the Gray-code reference has the same point.
///
/// # Errors
/// The cloud or the truth has another image size, or the truth has no reference.
pub fn against_rendered(
    cloud: &Cloud,
    size_px: [usize; 2],
    truth: &RenderedTruth,
    frames: &Frames,
) -> Result<Evaluation, EvaluationError> {
    evaluate(cloud, size_px, truth, frames, None)
}

/// As [`against_rendered`], for a cloud from images of `setup` whose middle is at `image`, counted in phase images. If
/// the object moves, the truth is moved to that moment.
///
/// Then any surface explains a point, lit or not, since shadows have moved. The truth does not know surfaces that come
/// into view. Points on them are unjudged unless a neighbour explains them.
///
/// # Errors
/// As [`against_rendered`].
pub fn against_rendered_at(
    cloud: &Cloud,
    setup: &Setup,
    truth: &RenderedTruth,
    image: f64,
) -> Result<Evaluation, EvaluationError> {
    let (size_px, frames) = (setup.image_size_px, Frames::from_setup(setup));
    check_size(truth, setup.image_pixels())?;
    let other_motion = setup.motion.as_ref().filter(|motion| motion.reference != image);
    match other_motion.and_then(|motion| truth_at(truth, setup, motion, image)) {
        Some(moved) => evaluate(cloud, size_px, &moved.truth, &frames, Some(&moved.known)),
        None => against_rendered(cloud, size_px, truth, &frames),
    }
}

/// Evaluates a cloud against the truth of the same moment, or against a moved truth, which is complete only where
/// `known`.
fn evaluate(
    cloud: &Cloud,
    size_px: [usize; 2],
    truth: &RenderedTruth,
    frames: &Frames,
    known: Option<&[bool]>,
) -> Result<Evaluation, EvaluationError> {
    let grid = PixelGrid::new(cloud, size_px)?;
    check_size(truth, grid.len())?;
    let reference = truth.reference.iter().filter(|&&r| r).count() as u64;
    let (mut tally, mut outliers, mut errors_m) = (Tally { reference, ..Tally::default() }, 0, Vec::new());
    let mut judgements = Vec::with_capacity(grid.len());
    for i in 0..grid.len() {
        let (judgement, outlier) = match judge(&grid, truth, i, known.is_some()) {
            (Judgement::Stray, _) if known.is_some_and(|known| !known[i]) => (Judgement::Unjudged, false),
            judged => judged,
        };
        outliers += u64::from(outlier);
        if judgement == Judgement::Correct {
            errors_m.extend(grid.get(i).map(|found| error_m(found, truth, i, frames)));
        }
        tally.add(judgement);
        judgements.push(judgement);
    }
    let scores = tally.scores(cloud.points.len(), Some(outliers), &mut errors_m)?;
    let interior_percent = interior_percent(&interior(truth, size_px[0], frames.unit_m), &judgements);
    Ok(Evaluation { scores: Scores { interior_percent, ..scores }, judgements })
}

/// Returns the percentage of correct points in the interior, or `None` if there is no interior.
fn interior_percent(interior: &[bool], judgements: &[Judgement]) -> Option<f64> {
    let inside = interior.iter().zip(judgements).filter(|(is_interior, _)| **is_interior);
    let count = inside.clone().count();
    let correct = inside.filter(|(_, judgement)| **judgement == Judgement::Correct).count();
    (count > 0).then(|| 100.0 * correct as f64 / count as f64)
}

/// Returns the judgement of a pixel, and whether its point is an outlier. With `any_surface`, surfaces that P does not
/// light or C2 does not see also explain points.
fn judge(grid: &PixelGrid<'_>, truth: &RenderedTruth, i: usize, any_surface: bool) -> (Judgement, bool) {
    let reference = truth.reference[i];
    let Some(found) = grid.get(i) else {
        return (if reference { Judgement::Missed } else { Judgement::Nothing }, false);
    };
    let cam2_px = pixel(found.cam2_px);
    if reference && is_close(&cam2_px, truth.cam2_px[i]) {
        return (Judgement::Correct, false);
    }
    let visible = |n: usize| (any_surface || truth.seen_by_cam2[n] && truth.lit[n]).then(|| pixel(truth.cam2_px[n]));
    if grid.is_explained(i, &cam2_px, visible) {
        return (Judgement::Tolerated, false);
    }
    if reference {
        return (Judgement::Wrong, true);
    }
    let in_gray_code = truth.gray_cam2_px.as_ref().is_some_and(|gray| is_close(&cam2_px, gray[i]));
    (if in_gray_code { Judgement::Tolerated } else { Judgement::Stray }, true)
}

fn error_m(found: &CloudPoint, truth: &RenderedTruth, i: usize, frames: &Frames) -> f64 {
    let measured = frames.cam1_from_volume.inverse() * point(found.position_m, 1.0);
    let exact = frames.exact_cam1_from_volume.inverse() * point(truth.point[i], frames.unit_m);
    (measured - exact).norm()
}

fn check_size(truth: &RenderedTruth, expected: usize) -> Result<(), EvaluationError> {
    let masks = [&truth.seen_by_cam2, &truth.lit, &truth.reference].map(Vec::len);
    let gray = truth.gray_cam2_px.as_ref().map_or(expected, Vec::len);
    let sizes = masks.into_iter().chain([truth.cam2_px.len(), truth.point.len(), gray]);
    match sizes.into_iter().find(|&found| found != expected) {
        Some(found) => Err(EvaluationError::Size { found, expected }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::test_cloud::cloud;
    use fringeflow::geometry::Pose;
    use fringeflow::geometry::Vector3;

    const NONE: [f32; 2] = [f32::NAN; 2];

    /// One row of seven pixels. Six have a correspondence 100 px to the right (the third 50 px farther, at another
    /// depth), the last has none.
    fn truth() -> RenderedTruth {
        let mut cam2_px: Vec<[f32; 2]> = (0..6).map(|u| [100.0 + u as f32, 0.0]).chain([NONE]).collect();
        cam2_px[2][0] += 50.0;
        let hit = vec![true, true, true, true, true, true, false];
        RenderedTruth {
            cam2_px,
            point: vec![[0.0, 0.0, 300.0]; 7],
            seen_by_cam2: hit.clone(),
            lit: hit.clone(),
            in_volume: hit.clone(),
            measurable: hit,
            // The sixth pixel is measurable, but Gray code did not find it.
            reference: vec![true, true, true, true, true, false, false],
            gray_cam2_px: Some(vec![NONE; 7]),
        }
    }

    fn frames() -> Frames {
        let moved = Pose::translation(0.0, 0.0, 0.001);
        Frames { cam1_from_volume: moved, exact_cam1_from_volume: Pose::identity(), unit_m: 1e-3 }
    }

    fn judged(points: &[([u16; 2], [f32; 2], f32)], truth: &RenderedTruth) -> Evaluation {
        against_rendered(&cloud(points), [7, 1], truth, &frames()).unwrap()
    }

    #[test]
    fn every_judgement_occurs() {
        let points = [
            ([0, 0], [101.9, 0.0], 0.3011), // 1.9 px off: correct, 0.1 mm off in the frame of the volume
            ([1, 0], [120.0, 0.0], 0.3),    // wrong
            ([2, 0], [103.0, 2.9], 0.3),    // what its right neighbour corresponds to: tolerated
            ([5, 0], [105.0, 0.0], 0.3),    // no reference, but true: tolerated
            ([6, 0], [500.0, 0.0], 0.3),    // stray
        ];
        let found = judged(&points, &truth());
        use Judgement::{Correct, Missed, Stray, Tolerated, Wrong};
        assert_eq!(found.judgements, [Correct, Wrong, Tolerated, Missed, Missed, Tolerated, Stray]);
        let s = found.scores;
        assert_eq!((s.points, s.reference), (5, 5));
        assert_eq!((s.com_percent, s.miss_percent, s.fpc_percent), (20.0, 40.0, 40.0));
        assert_eq!((s.wrong_percent, s.stray_percent, s.outliers_percent), (20.0, 20.0, Some(40.0)));
        assert!((s.rms_m.unwrap() - 1e-4).abs() < 1e-7 && (s.median_m.unwrap() - 1e-4).abs() < 1e-7);
    }

    #[test]
    fn a_point_that_gray_code_also_has_is_an_outlier_but_not_stray() {
        let mut truth = truth();
        truth.gray_cam2_px.as_mut().unwrap()[6] = [500.0, 1.0];
        let found = judged(&[([6, 0], [500.0, 0.0], 0.3)], &truth);
        assert_eq!(found.judgements[6], Judgement::Tolerated);
        assert_eq!((found.scores.stray_percent, found.scores.outliers_percent), (0.0, Some(20.0)));
        truth.gray_cam2_px = None;
        assert_eq!(judged(&[([6, 0], [500.0, 0.0], 0.3)], &truth).judgements[6], Judgement::Stray);
    }

    #[test]
    fn an_unlit_neighbour_explains_nothing() {
        let mut truth = truth();
        truth.lit[3] = false;
        let found = judged(&[([2, 0], [103.0, 2.9], 0.3)], &truth);
        // The second neighbour on the left corresponds to 101: 3.5 px away.
        assert_eq!(found.judgements[2], Judgement::Wrong);
    }

    #[test]
    fn clouds_and_truths_of_other_images_are_refused() {
        let outside = cloud(&[([7, 0], [0.0, 0.0], 0.3)]);
        let refused = against_rendered(&outside, [7, 1], &truth(), &frames());
        assert!(matches!(refused, Err(EvaluationError::OutsideImage { u: 7, v: 0, .. })));
        let refused = against_rendered(&Cloud::default(), [8, 1], &truth(), &frames());
        assert_eq!(refused, Err(EvaluationError::Size { found: 7, expected: 8 }));
        let turned = Frames { cam1_from_volume: Pose::rotation(Vector3::x()), ..frames() };
        let nothing = against_rendered(&Cloud::default(), [7, 1], &truth(), &turned).unwrap();
        assert_eq!((nothing.scores.miss_percent, nothing.scores.rms_m), (100.0, None));
    }
}

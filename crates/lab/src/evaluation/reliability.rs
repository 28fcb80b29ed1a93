//! Reliability of the confidences: of the points with a confidence of 99 %, 99 % should be true.

use serde::Serialize;

use fringeflow::cloud::Cloud;

use super::Judgement;

/// Number of parts, each with the same number of points.
const PARTS: usize = 10;

/// One of ten equal parts of the points, sorted by confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReliabilityPart {
    /// Number of judged points.
    pub points: u64,
    /// Lowest confidence among them, percent.
    pub least_percent: f64,
    /// Mean of their confidences, percent.
    pub stated_percent: f64,
    /// Share of them that are not false positives, percent.
    pub true_percent: f64,
}

/// Splits the points of a cloud into ten equal parts, the lowest confidences first. The result is empty if the points
/// have no confidence.
///
/// `judgements` are those of the pixels of C1, with `width` per row. Unjudged points are skipped.
#[must_use]
pub fn reliability(cloud: &Cloud, judgements: &[Judgement], width: usize) -> Vec<ReliabilityPart> {
    let judged = cloud.points.iter().filter_map(|point| {
        let [u, v] = point.cam1_px.map(usize::from);
        let judgement = *judgements.get(v * width + u)?;
        (judgement != Judgement::Unjudged && point.confidence > 0.0).then(|| (point.confidence, !judgement.is_false()))
    });
    let mut judged: Vec<(f32, bool)> = judged.collect();
    judged.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ends = |part: usize| judged.len() * part / PARTS;
    let parts = (0..PARTS).map(|part| &judged[ends(part)..ends(part + 1)]);
    parts.filter_map(part_figures).collect()
}

fn part_figures(part: &[(f32, bool)]) -> Option<ReliabilityPart> {
    let (least, _) = part.first()?;
    let count = part.len() as f64;
    let stated: f64 = part.iter().map(|(confidence, _)| f64::from(*confidence)).sum();
    let found = part.iter().filter(|(_, is_true)| *is_true).count();
    Some(ReliabilityPart {
        points: part.len() as u64,
        least_percent: 100.0 * f64::from(*least),
        stated_percent: 100.0 * stated / count,
        true_percent: 100.0 * found as f64 / count,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::test_cloud::cloud;

    #[test]
    fn parts_are_equal_and_show_stated_and_true_shares() {
        let points: Vec<_> = (0..40).map(|u| ([u, 0], [0.0, 0.0], 1.0)).collect();
        let mut cloud = cloud(&points);
        // The first four are uncertain, and one of them is wrong.
        cloud.points.iter_mut().enumerate().for_each(|(i, p)| p.confidence = if i < 4 { 0.75 } else { 1.0 });
        let mut judgements = vec![Judgement::Correct; 40];
        judgements[2] = Judgement::Stray;
        judgements[3] = Judgement::Tolerated;
        let parts = reliability(&cloud, &judgements, 40);
        assert_eq!(parts.len(), PARTS);
        assert_eq!(
            parts[0],
            ReliabilityPart { points: 4, least_percent: 75.0, stated_percent: 75.0, true_percent: 75.0 }
        );
        assert!(parts[1..].iter().all(|part| part.points == 4 && part.true_percent == 100.0));
    }

    #[test]
    fn a_cloud_without_confidence_has_no_parts() {
        let mut cloud = cloud(&[([0, 0], [0.0, 0.0], 1.0)]);
        cloud.points[0].confidence = 0.0;
        assert_eq!(reliability(&cloud, &[Judgement::Correct], 1), []);
    }
}

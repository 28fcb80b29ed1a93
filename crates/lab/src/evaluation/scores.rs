//! The scores of a cloud.

use serde::Serialize;

use super::{EvaluationError, Judgement};

/// Scores of a cloud, in percent of the reference correspondences (paper, section 3).
///
/// com + miss + fpc may exceed 100 %, since points without a reference can also be false.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Scores {
    /// Points of the cloud.
    pub points: u64,
    /// Reference correspondences.
    pub reference: u64,
    /// com: reference correspondences found correctly.
    pub com_percent: f64,
    /// com of the interior: references whose neighbours in 5 × 5 pixels are also references, within 1 mm of depth.
    /// `None` if the truth is not exact or there is no interior.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interior_percent: Option<f64>,
    /// miss: reference correspondences without a point.
    pub miss_percent: f64,
    /// fpc: points in a wrong place, the sum of [`Self::wrong_percent`] and [`Self::stray_percent`].
    pub fpc_percent: f64,
    /// Points that disagree with their reference.
    pub wrong_percent: f64,
    /// Points at pixels without a true correspondence; zero if these are unknown.
    pub stray_percent: f64,
    /// Points that the exact truth does not support, even if Gray code also has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outliers_percent: Option<f64>,
    /// Points without a truth to judge them by.
    pub unjudged: u64,
    /// Root mean square 3D distance of the correct points, metres; `None` if there are none.
    pub rms_m: Option<f64>,
    /// Median 3D distance of the correct points, metres; `None` if there are none.
    pub median_m: Option<f64>,
}

/// Counts of judgements.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    pub(super) reference: u64,
    pub(super) correct: u64,
    pub(super) missed: u64,
    pub(super) wrong: u64,
    pub(super) stray: u64,
    pub(super) unjudged: u64,
}

impl Tally {
    /// Counts a pixel with at most one reference.
    pub(super) fn add(&mut self, judgement: Judgement) {
        match judgement {
            Judgement::Correct => self.correct += 1,
            Judgement::Missed => self.missed += 1,
            Judgement::Wrong => self.wrong += 1,
            Judgement::Stray => self.stray += 1,
            Judgement::Unjudged => self.unjudged += 1,
            Judgement::Tolerated | Judgement::Nothing => {}
        }
    }

    /// Computes the scores, with the 3D errors of the correct points.
    pub(super) fn scores(
        &self,
        points: usize,
        outliers: Option<u64>,
        errors_m: &mut [f64],
    ) -> Result<Scores, EvaluationError> {
        if self.reference == 0 {
            return Err(EvaluationError::NoReference);
        }
        let percent = |count: u64| 100.0 * count as f64 / self.reference as f64;
        Ok(Scores {
            points: points as u64,
            reference: self.reference,
            com_percent: percent(self.correct),
            interior_percent: None,
            miss_percent: percent(self.missed),
            fpc_percent: percent(self.wrong + self.stray),
            wrong_percent: percent(self.wrong),
            stray_percent: percent(self.stray),
            outliers_percent: outliers.map(percent),
            unjudged: self.unjudged,
            rms_m: rms(errors_m),
            median_m: median(errors_m),
        })
    }
}

fn rms(values: &[f64]) -> Option<f64> {
    let mean_square = values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
    (!values.is_empty()).then(|| mean_square.sqrt())
}

/// Returns the median; for an even count, the mean of the two middle values.
fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let upper = *values.get(values.len() / 2)?;
    let lower = values[(values.len() - 1) / 2];
    Some((lower + upper) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_a_few_values() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(rms(&[3.0, 4.0]), Some(12.5_f64.sqrt()));
        assert_eq!((rms(&[]), median(&mut [])), (None, None));
    }

    #[test]
    fn nothing_is_a_percentage_of_nothing() {
        assert_eq!(Tally::default().scores(3, None, &mut []), Err(EvaluationError::NoReference));
    }
}

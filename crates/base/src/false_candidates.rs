//! How many false candidates to expect, and how many unique correspondences (paper, sections 2.1 and 2.2.1).

use std::f64::consts::PI;

/// Factor from sd to the threshold of the back-projection test (paper, 2.1): thr = 3·sd.
pub const THRESHOLD_SD: f64 = 3.0;

/// Expected number of additional false candidates per true one (paper, Eq. 1): efc = 3·sd·(n − 1)/π, from the standard
/// deviation of δ and the mean number n of periods on a segment. 0 if a segment has less than one period.
#[must_use]
pub fn expected_false_candidates(sd_rad: f64, mean_periods: f64) -> f64 {
    (THRESHOLD_SD * sd_rad * (mean_periods - 1.0) / PI).max(0.0)
}

/// Expected percentage of unique correspondences (paper, 2.2.1): puc ≈ 100·(1 − efc). The paper gives it for efc
/// considerably smaller than 1; from 1 on it is 0.
#[must_use]
pub fn expected_unique_percent(expected_false_candidates: f64) -> f64 {
    100.0 * (1.0 - expected_false_candidates).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn efc_is_equation_1_of_the_paper_and_puc_what_it_leaves() {
        // The paper's own figures: n = 6, sd = 0.041, efc = 0.20.
        let efc = expected_false_candidates(0.041, 6.0);
        assert!((efc - 0.20).abs() < 0.005);
        assert!((expected_unique_percent(efc) - 80.0).abs() < 0.5);
        assert_eq!(expected_false_candidates(0.041, 0.5), 0.0);
        assert_eq!([0.0, 0.25, 1.0, 3.0].map(expected_unique_percent), [100.0, 75.0, 0.0, 0.0]);
    }
}

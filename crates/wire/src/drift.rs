//! A drift of the calibration as numbers in a header.

use fringeflow::correspondence::KnownDrift;
use fringeflow_message::{DRIFT_NUMBERS, DriftNumbers};

const _: () = assert!(DRIFT_NUMBERS == KnownDrift::NUMBERS);

/// Returns the numbers of a drift; all are 0 if there is none.
#[must_use]
pub fn numbers(drift: Option<&KnownDrift>) -> DriftNumbers {
    drift.map_or([0.0; _], KnownDrift::to_numbers)
}

/// Returns the drift with these numbers; `None` if they are not a valid drift.
#[must_use]
pub fn read(numbers: &DriftNumbers) -> Option<KnownDrift> {
    KnownDrift::from_numbers(*numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_numbers_are_not_read_as_a_drift() {
        let numbers: DriftNumbers = std::array::from_fn(|i| 0.25 * i as f32 + 0.125);
        let drift = read(&numbers).unwrap();
        assert_eq!(super::numbers(Some(&drift)), numbers);
        assert_eq!(read(&super::numbers(None)), None);
        for (index, wrong) in [(0, 0.0), (0, -0.1), (0, f32::INFINITY), (1, f32::NAN), (21, f32::NEG_INFINITY)] {
            let mut numbers = numbers;
            numbers[index] = wrong;
            assert_eq!(read(&numbers), None, "{index}: {wrong}");
        }
    }
}

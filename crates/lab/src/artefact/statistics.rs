//! Order statistics of numbers without NaN.

/// Returns the value below which a share of the values lies; `None` without values. Reorders the values.
pub(super) fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let place = (share * last as f64).round() as usize;
    Some(*values.select_nth_unstable_by(place.min(last), f64::total_cmp).1)
}

/// Returns the median; 0 without values. Reorders the values.
pub(super) fn median(values: &mut [f64]) -> f64 {
    quantile(values, 0.5).unwrap_or_default()
}

/// Returns the standard deviation of a normal distribution with the same median of absolute values.
pub(super) fn robust_sd(values: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).collect();
    1.4826 * median(&mut sizes)
}

/// Returns the mean and the standard deviation; `None` for fewer than two values.
pub(super) fn mean_and_sd(values: &[f64]) -> Option<(f64, f64)> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() > 1).then(|| (mean, (squares / (count - 1.0)).sqrt()))
}

/// Returns the largest value minus the smallest; 0 without values.
pub(super) fn range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    (high - low).max(0.0)
}

//! How a figure changes from window to window.

use std::collections::BTreeMap;

use super::cells::Cell;
use super::statistics::{mean_and_sd, median};

/// A figure over windows.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Number of windows.
    pub windows: usize,
    /// Median.
    pub median: f64,
    /// Value with the largest size.
    pub worst: f64,
    /// Standard deviation from window to window; `None` for fewer than three.
    pub sd: Option<f64>,
}

impl Spread {
    /// The spread of some values; `None` without values.
    #[must_use]
    pub fn new(values: &[f64]) -> Option<Self> {
        let worst = values.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let sd = mean_and_sd(values).filter(|_| values.len() > 2).map(|(_, sd)| sd);
        Some(Self { windows: values.len(), median: median(&mut values.to_vec()), worst, sd })
    }
}

/// Root mean square over cells of the standard deviation of their means from window to window, metres: how well the form
/// repeats. `None` if fewer than ten cells were seen three times.
#[must_use]
pub fn cell_repeatability_m<'a>(windows: impl Iterator<Item = &'a [Cell]>) -> Option<f64> {
    let mut means: BTreeMap<[i64; 2], Vec<f64>> = BTreeMap::new();
    for cell in windows.flatten() {
        means.entry(cell.at).or_default().push(cell.mean_m);
    }
    let seen = means.values().filter(|means| means.len() > 2);
    let squares: Vec<f64> = seen.filter_map(|means| mean_and_sd(means)).map(|(_, sd)| sd * sd).collect();
    (squares.len() >= 10).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

//! Mean and spread of a figure over the seeds.

use serde::Serialize;

/// Mean and standard deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation about the mean, by n − 1; 0 for a single value.
    pub sd: f64,
}

impl Spread {
    /// The spread of some values; `None` without any.
    #[must_use]
    pub fn of_values(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let sd = if values.len() > 1 { (squares / (count - 1.0)).sqrt() } else { 0.0 };
        (!values.is_empty()).then_some(Self { mean, sd })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_that_of_a_sample() {
        assert_eq!(Spread::of_values([]), None);
        assert_eq!(Spread::of_values([3.0]), Some(Spread { mean: 3.0, sd: 0.0 }));
        let spread = Spread::of_values([1.0, 2.0, 3.0]).unwrap();
        assert_eq!((spread.mean, spread.sd), (2.0, 1.0));
    }
}

//! Logarithmic axis of a plot: converts values to positions.

/// An axis from `low` at `from_px` to `high` at `to_px`.
#[derive(Clone, Copy)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) from_px: f64,
    pub(super) to_px: f64,
    /// Values with a grid line and a number.
    pub(super) ticks: &'static [f64],
}

impl Axis {
    /// Position of a value, pixels. A value beyond an end is clamped to it.
    pub(super) fn position_px(&self, value: f64) -> f64 {
        let (low, high) = (self.low.log10(), self.high.log10());
        let share = (value.clamp(self.low, self.high).log10() - low) / (high - low);
        self.from_px + (self.to_px - self.from_px) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_have_equal_lengths_and_values_beyond_the_ends_are_clamped() {
        let axis = Axis { low: 0.01, high: 100.0, from_px: 400.0, to_px: 0.0, ticks: &[] };
        assert_eq!(
            [0.0, 0.01, 0.1, 1.0, 100.0, 1e6].map(|v| axis.position_px(v)),
            [400.0, 400.0, 300.0, 200.0, 0.0, 0.0]
        );
    }
}

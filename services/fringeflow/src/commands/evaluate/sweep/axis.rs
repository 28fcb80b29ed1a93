//! A logarithmic axis of a plot: from values to places on the page.

/// From `low` at `from_px` to `high` at `to_px`.
#[derive(Clone, Copy)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) from_px: f64,
    pub(super) to_px: f64,
    /// Where its lines and numbers stand.
    pub(super) ticks: &'static [f64],
}

impl Axis {
    /// Place of a value; what lies beyond an end stands at that end.
    pub(super) fn place_px(&self, value: f64) -> f64 {
        let (low, high) = (self.low.log10(), self.high.log10());
        let share = (value.clamp(self.low, self.high).log10() - low) / (high - low);
        self.from_px + (self.to_px - self.from_px) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decades_are_of_one_length_and_nothing_leaves_the_axis() {
        let axis = Axis { low: 0.01, high: 100.0, from_px: 400.0, to_px: 0.0, ticks: &[] };
        assert_eq!([0.0, 0.01, 0.1, 1.0, 100.0, 1e6].map(|v| axis.place_px(v)), [400.0, 400.0, 300.0, 200.0, 0.0, 0.0]);
    }
}

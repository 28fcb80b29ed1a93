//! Watches from window to window whether the scanner measures well.
//!
//! In: the time and the values of each window ([`Measures`]), one or none for each [`Quantity`]. Out: a [`Gauge`] for
//! each quantity with its level over the last windows, and a [`HealthState`] that does not flicker. The state of the
//! scanner is the worst of them. The result depends only on the input: the module uses no clock and no log. The cost is
//! negligible compared with that of a window.

mod advice;
mod gauge;
mod limits;
mod quantity;
mod state;

pub use gauge::{Gauge, median};
pub use limits::{HealthLimits, Limits};
pub use quantity::{Averaging, Quantity};
pub use state::HealthState;

/// Values of a window, in the order of [`Quantity::ALL`]; `None` if the window has no value.
pub type Measures = [Option<f64>; Quantity::ALL.len()];

/// The health of a scanner.
#[derive(Clone, Debug)]
pub struct Health {
    gauges: [Gauge; Quantity::ALL.len()],
    limits: HealthLimits,
}

impl Health {
    /// Creates the health of a scanner without windows.
    #[must_use]
    pub fn new(limits: &HealthLimits) -> Self {
        Self { gauges: Quantity::ALL.map(|quantity| Gauge::new(quantity, limits)), limits: limits.clone() }
    }

    /// Adds the values of a window, measured at `time_ns`.
    pub fn add(&mut self, time_ns: u64, measures: &Measures) {
        for (gauge, measure) in self.gauges.iter_mut().zip(measures) {
            if let Some(value) = measure.filter(|value| value.is_finite()) {
                gauge.add(time_ns, value, &self.limits);
            }
        }
    }

    /// The gauges of all quantities, in the order of [`Quantity::ALL`].
    #[must_use]
    pub fn gauges(&self) -> &[Gauge] {
        &self.gauges
    }

    /// The worst state of all quantities. Unknown until a quantity is known.
    #[must_use]
    pub fn state(&self) -> HealthState {
        self.gauges.iter().map(Gauge::state).max().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_state_counts_and_missing_values_do_not_count() {
        let mut health = Health::new(&HealthLimits::default());
        assert_eq!(health.state(), HealthState::NotKnown);
        let mut measures: Measures = [None; Quantity::ALL.len()];
        measures[Quantity::Drift as usize] = Some(0.04);
        measures[Quantity::HarmonicsCam2 as usize] = Some(f64::NAN);
        (0..9).for_each(|time_ns| health.add(time_ns, &measures));
        assert_eq!(health.state(), HealthState::Ok);
        measures[Quantity::SaturatedCam1 as usize] = Some(0.9);
        (9..18).for_each(|time_ns| health.add(time_ns, &measures));
        assert_eq!(health.state(), HealthState::Bad);
        let level_and_state = |quantity: Quantity| {
            let gauge = &health.gauges()[quantity as usize];
            (gauge.report().known(), gauge.state())
        };
        assert_eq!(level_and_state(Quantity::Drift), (Some(0.04), HealthState::Ok));
        assert_eq!(level_and_state(Quantity::HarmonicsCam2), (None, HealthState::NotKnown));
    }
}

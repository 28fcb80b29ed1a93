//! Whether the scanner measures as it should, watched from window to window.
//!
//! In: what each window tells ([`Measures`], one number a [`Quantity`] or none) and when. Out: for every quantity a [`Gauge`]
//! with its level over the last windows, and a [`HealthState`] that does not flicker; the worst is that of the scanner. It is a
//! function of that sequence alone: no clock, no log. Cost: nothing beside a window.

mod gauge;
mod limits;
mod quantity;
mod state;

pub use gauge::{Gauge, median};
pub use limits::{HealthLimits, Limits};
pub use quantity::{Level, Quantity};
pub use state::HealthState;

/// What a window tells of each quantity, by [`Quantity::ALL`]; `None` where it tells nothing.
pub type Measures = [Option<f64>; Quantity::ALL.len()];

/// The health of a scanner.
#[derive(Clone, Debug)]
pub struct Health {
    gauges: [Gauge; Quantity::ALL.len()],
}

impl Health {
    /// Nothing known yet.
    #[must_use]
    pub fn new(limits: &HealthLimits) -> Self {
        Self { gauges: Quantity::ALL.map(|quantity| Gauge::new(quantity, limits)) }
    }

    /// Takes what a window tells, at a time, nanoseconds.
    pub fn add(&mut self, time_ns: u64, measures: &Measures) {
        for (gauge, measure) in self.gauges.iter_mut().zip(measures) {
            if let Some(value) = measure.filter(|value| value.is_finite()) {
                gauge.add(time_ns, value);
            }
        }
    }

    /// All quantities.
    #[must_use]
    pub fn gauges(&self) -> &[Gauge] {
        &self.gauges
    }

    /// The worst state of all quantities; not known before any is.
    #[must_use]
    pub fn state(&self) -> HealthState {
        self.gauges.iter().map(Gauge::state).max().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_quantity_is_the_state_and_what_is_not_told_counts_nowhere() {
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
        let told = |quantity: Quantity| {
            (health.gauges()[quantity as usize].level(), health.gauges()[quantity as usize].state())
        };
        assert_eq!(told(Quantity::Drift), (Some(0.04), HealthState::Ok));
        assert_eq!(told(Quantity::HarmonicsCam2), (None, HealthState::NotKnown));
    }
}

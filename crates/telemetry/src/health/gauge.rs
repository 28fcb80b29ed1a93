//! One health quantity over the last windows.

use std::collections::VecDeque;

use fringeflow_message::GaugeReport;

use super::{Averaging, HealthLimits, HealthState, Limits, Quantity};

/// A quantity, its level over the last windows, and its state.
///
/// The state rises as soon as the level exceeds a limit. It falls when the level drops below `release_share` of that
/// limit. So neither a single window nor a level near a limit makes it flicker. The state is unknown until there are
/// enough windows.
#[derive(Clone, Debug)]
pub struct Gauge {
    quantity: Quantity,
    /// Values of the last windows, the newest last.
    recent: VecDeque<f64>,
    report: GaugeReport,
}

impl Gauge {
    /// Creates a gauge without windows.
    #[must_use]
    pub fn new(quantity: Quantity, limits: &HealthLimits) -> Self {
        let Limits { warn, bad } = limits.limits_of(quantity);
        Self {
            quantity,
            recent: VecDeque::with_capacity(limits.windows),
            report: GaugeReport { warn, bad, ..GaugeReport::default() },
        }
    }

    /// Adds the value of the next window, measured at `time_ns`.
    pub fn add(&mut self, time_ns: u64, value: f64, limits: &HealthLimits) {
        if self.recent.len() == limits.windows {
            self.recent.pop_front();
        }
        self.recent.push_back(value);
        if self.recent.len() < limits.fewest_windows {
            return;
        }
        let Some(level) = self.level() else { return };
        (self.report.level, self.report.is_known) = (level, 1);
        let state = self.state_at(level, limits.release_share) as u32;
        if state != self.report.state {
            (self.report.state, self.report.since_ns) = (state, time_ns);
        }
    }

    /// Level, limits and state.
    #[must_use]
    pub fn report(&self) -> GaugeReport {
        self.report
    }

    /// State of the quantity.
    #[must_use]
    pub fn state(&self) -> HealthState {
        HealthState::from_code(self.report.state)
    }

    /// Level over the last windows.
    fn level(&self) -> Option<f64> {
        match self.quantity.averaging() {
            Averaging::Median => median(self.recent.iter().copied()),
            Averaging::Mean => Some(self.recent.iter().sum::<f64>() / self.recent.len().max(1) as f64),
        }
    }

    fn state_at(&self, level: f64, release_share: f64) -> HealthState {
        // The present state ends only when the level drops below a share of its limit.
        let holds =
            |state: HealthState, limit: f64| level > limit || (self.state() >= state && level >= release_share * limit);
        if holds(HealthState::Bad, self.report.bad) {
            HealthState::Bad
        } else if holds(HealthState::Warn, self.report.warn) {
            HealthState::Warn
        } else {
            HealthState::Ok
        }
    }
}

/// Returns the median, for an even count the lower of the two middle values; `None` if there are no values.
#[must_use]
pub fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use HealthState::{Bad, NotKnown, Ok, Warn};

    fn gauge(quantity: Quantity) -> (Gauge, HealthLimits) {
        let mut limits = HealthLimits::default();
        limits.set(quantity.key(), Limits { warn: 0.1, bad: 0.3 });
        (Gauge::new(quantity, &limits), limits)
    }

    /// States after each of the windows.
    fn states_after((gauge, limits): &mut (Gauge, HealthLimits), values: &[f64]) -> Vec<HealthState> {
        let mut add = |&value: &f64| {
            gauge.add(7, value, limits);
            gauge.state()
        };
        values.iter().map(&mut add).collect()
    }

    #[test]
    fn the_level_is_the_median_and_single_windows_do_not_raise_it() {
        assert_eq!(
            states_after(&mut gauge(Quantity::Drift), &[0.2; 5]),
            [NotKnown, NotKnown, NotKnown, NotKnown, Warn]
        );
        let mut spiked = gauge(Quantity::Drift);
        let spikes = [0.04, 0.5, 0.04, 0.5, 0.04, 0.5, 0.04, 0.5, 0.04, 0.04, 0.5, 0.04];
        assert!(states_after(&mut spiked, &spikes)[4..].iter().all(|&state| state == Ok));
        assert_eq!(spiked.0.report().known(), Some(0.04));
    }

    #[test]
    fn a_level_near_a_limit_does_not_flicker() {
        let mut gauge = gauge(Quantity::Drift);
        assert_eq!(states_after(&mut gauge, &[0.12; 9])[8], Warn);
        let near_limit = [[0.099; 9], [0.101; 9], [0.085; 9]].concat();
        assert!(states_after(&mut gauge, &near_limit).iter().all(|&state| state == Warn));
        assert_eq!(states_after(&mut gauge, &[0.079; 5]), [Warn, Warn, Warn, Warn, Ok]);
        assert!(states_after(&mut gauge, &[0.099; 20]).iter().all(|&state| state == Ok));
    }

    #[test]
    fn it_rises_to_bad_at_once_and_falls_through_warn() {
        let mut gauge = gauge(Quantity::Drift);
        assert_eq!(states_after(&mut gauge, &[0.04; 9])[8], Ok);
        assert_eq!(states_after(&mut gauge, &[0.4; 5]), [Ok, Ok, Ok, Ok, Bad]);
        assert!(states_after(&mut gauge, &[0.25; 18]).iter().all(|&state| state == Bad));
        assert_eq!(states_after(&mut gauge, &[0.2; 9])[8], Warn);
        assert!(states_after(&mut gauge, &[0.29; 18]).iter().all(|&state| state == Warn));
        assert_eq!(states_after(&mut gauge, &[0.0; 9])[8], Ok);
    }

    #[test]
    fn the_report_says_when_the_state_began() {
        let (mut gauge, limits) = gauge(Quantity::Drift);
        (0..20).for_each(|time_ns| gauge.add(time_ns, if time_ns < 10 { 0.0 } else { 0.2 }, &limits));
        assert_eq!((gauge.state(), gauge.report().since_ns), (Warn, 14));
    }

    #[test]
    fn each_slipped_window_counts() {
        let mut gauge = gauge(Quantity::Slipped);
        assert_eq!(states_after(&mut gauge, &[0.0; 9])[8], Ok);
        assert_eq!(states_after(&mut gauge, &[1.0, 1.0, 1.0, 1.0]), [Warn, Warn, Bad, Bad]);
    }
}

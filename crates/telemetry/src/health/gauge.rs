//! One quantity over the last windows.

use std::collections::VecDeque;

use super::{HealthLimits, HealthState, Level, Limits, Quantity};

/// A quantity with its level over the last windows, and its state.
///
/// The state rises as soon as the level exceeds a limit, and falls when it is below a share of it: neither a single window nor a
/// level about a limit makes it flicker. Before there are enough windows it is not known.
#[derive(Clone, Debug)]
pub struct Gauge {
    quantity: Quantity,
    limits: Limits,
    windows: usize,
    fewest_windows: usize,
    release_share: f64,
    recent: VecDeque<f64>,
    state: HealthState,
    since_ns: u64,
}

impl Gauge {
    /// A quantity of which nothing is known.
    #[must_use]
    pub fn new(quantity: Quantity, limits: &HealthLimits) -> Self {
        Self {
            quantity,
            limits: limits.of(quantity),
            windows: limits.windows,
            fewest_windows: limits.fewest_windows,
            release_share: limits.release_share,
            recent: VecDeque::with_capacity(limits.windows),
            state: HealthState::NotKnown,
            since_ns: 0,
        }
    }

    /// Takes what the next window says, at a time, nanoseconds.
    pub fn add(&mut self, time_ns: u64, value: f64) {
        if self.recent.len() == self.windows {
            self.recent.pop_front();
        }
        self.recent.push_back(value);
        let Some(level) = self.level() else { return };
        let state = self.judge(level);
        if state != self.state {
            (self.state, self.since_ns) = (state, time_ns);
        }
    }

    /// The quantity.
    #[must_use]
    pub fn quantity(&self) -> Quantity {
        self.quantity
    }

    /// Its limits.
    #[must_use]
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// Its level over the last windows; `None` before there are enough.
    #[must_use]
    pub fn level(&self) -> Option<f64> {
        if self.recent.len() < self.fewest_windows {
            return None;
        }
        match self.quantity.level() {
            Level::Median => median(self.recent.iter().copied()),
            Level::Mean => Some(self.recent.iter().sum::<f64>() / self.recent.len().max(1) as f64),
        }
    }

    /// Its state.
    #[must_use]
    pub fn state(&self) -> HealthState {
        self.state
    }

    /// When it came to that state, nanoseconds; 0 while it is not known.
    #[must_use]
    pub fn since_ns(&self) -> u64 {
        self.since_ns
    }

    fn judge(&self, level: f64) -> HealthState {
        let stands = |state: HealthState, limit: f64| {
            level > limit || (self.state >= state && level >= self.release_share * limit)
        };
        if stands(HealthState::Bad, self.limits.bad) {
            HealthState::Bad
        } else if stands(HealthState::Warn, self.limits.warn) {
            HealthState::Warn
        } else {
            HealthState::Ok
        }
    }
}

/// The middle one of some values, of two the lower; `None` without any.
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

    fn gauge(quantity: Quantity) -> Gauge {
        let mut limits = HealthLimits::default();
        limits.set(quantity.key(), Limits { warn: 0.1, bad: 0.3 });
        Gauge::new(quantity, &limits)
    }

    /// The state after each of some windows.
    fn course(gauge: &mut Gauge, values: &[f64]) -> Vec<HealthState> {
        let mut add = |&value: &f64| {
            gauge.add(7, value);
            gauge.state()
        };
        values.iter().map(&mut add).collect()
    }

    #[test]
    fn it_takes_the_median_of_five_windows_and_single_ones_raise_nothing() {
        assert_eq!(course(&mut gauge(Quantity::Drift), &[0.2; 5]), [NotKnown, NotKnown, NotKnown, NotKnown, Warn]);
        let mut spiked = gauge(Quantity::Drift);
        let spikes = [0.04, 0.5, 0.04, 0.5, 0.04, 0.5, 0.04, 0.5, 0.04, 0.04, 0.5, 0.04];
        assert!(course(&mut spiked, &spikes)[4..].iter().all(|&state| state == Ok));
        assert_eq!(spiked.level(), Some(0.04));
    }

    #[test]
    fn a_level_about_a_limit_does_not_flicker() {
        let mut gauge = gauge(Quantity::Drift);
        assert_eq!(course(&mut gauge, &[0.12; 9])[8], Warn);
        let about = [[0.099; 9], [0.101; 9], [0.085; 9]].concat();
        assert!(course(&mut gauge, &about).iter().all(|&state| state == Warn));
        assert_eq!(course(&mut gauge, &[0.079; 5]), [Warn, Warn, Warn, Warn, Ok]);
        assert!(course(&mut gauge, &[0.099; 20]).iter().all(|&state| state == Ok));
    }

    #[test]
    fn it_rises_to_bad_at_once_and_falls_through_warn() {
        let mut gauge = gauge(Quantity::Drift);
        assert_eq!(course(&mut gauge, &[0.04; 9])[8], Ok);
        assert_eq!(course(&mut gauge, &[0.4; 5]), [Ok, Ok, Ok, Ok, Bad]);
        assert!(course(&mut gauge, &[0.25; 18]).iter().all(|&state| state == Bad));
        assert_eq!(course(&mut gauge, &[0.2; 9])[8], Warn);
        assert!(course(&mut gauge, &[0.29; 18]).iter().all(|&state| state == Warn));
        assert_eq!(course(&mut gauge, &[0.0; 9])[8], Ok);
    }

    #[test]
    fn it_tells_since_when() {
        let mut gauge = gauge(Quantity::Drift);
        (0..20).for_each(|time_ns| gauge.add(time_ns, if time_ns < 10 { 0.0 } else { 0.2 }));
        assert_eq!((gauge.state(), gauge.since_ns()), (Warn, 14));
    }

    #[test]
    fn each_slipped_window_counts() {
        let mut gauge = gauge(Quantity::Slipped);
        assert_eq!(course(&mut gauge, &[0.0; 9])[8], Ok);
        assert_eq!(course(&mut gauge, &[1.0, 1.0, 1.0, 1.0]), [Warn, Warn, Bad, Bad]);
    }
}

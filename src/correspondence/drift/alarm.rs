//! When the drift of a calibration calls for a new one.
//!
//! In: the drift of one window after the other. Out: whether an alarm stands, a function of that sequence alone.

use std::collections::VecDeque;

use super::estimate::Drift;

/// Windows whose median drift is judged, and the fewest that are enough.
const WINDOWS: usize = 9;
const FEWEST_WINDOWS: usize = 5;
/// Share of the limit that the median must fall to before an alarm ends.
const ENDING_SHARE: f64 = 0.8;

/// The drift up to which a calibration is as it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriftLimit {
    /// Root mean square of the drift over the measurement volume, rad.
    pub rms_rad: f64,
}

impl Default for DriftLimit {
    /// 0.1 rad: two and a half times what calibrated rigs have, and the sd at which efc (paper, Eq. 1) of six periods
    /// reaches 0.5, the most that the paper recommends. Orders are decided rightly far beyond.
    fn default() -> Self {
        Self { rms_rad: 0.1 }
    }
}

impl DriftLimit {
    /// Whether a drift, rad rms, lies beyond.
    #[must_use]
    pub fn is_exceeded_by(self, rms_rad: f64) -> bool {
        rms_rad > self.rms_rad
    }
}

/// Alarm while the drift stays beyond its limit.
///
/// It begins when the median of the last nine windows, five at least, exceeds the limit, and ends when that median is below
/// four fifths of it: neither a single window nor a drift about the limit makes it flicker. Windows that tell nothing about
/// the calibration ([`Drift::is_of_most_pixels`]) do not count.
#[derive(Clone, Debug)]
pub struct DriftAlarm {
    limit: DriftLimit,
    recent_rad: VecDeque<f64>,
    is_raised: bool,
}

impl DriftAlarm {
    /// No alarm, before the first window.
    #[must_use]
    pub fn new(limit: DriftLimit) -> Self {
        Self { limit, recent_rad: VecDeque::with_capacity(WINDOWS), is_raised: false }
    }

    /// Takes the drift of the next window.
    pub fn add(&mut self, drift: &Drift) {
        if !drift.is_of_most_pixels() {
            return;
        }
        if self.recent_rad.len() == WINDOWS {
            self.recent_rad.pop_front();
        }
        self.recent_rad.push_back(drift.rms_rad);
        let Some(median_rad) = self.median_rad().filter(|_| self.recent_rad.len() >= FEWEST_WINDOWS) else { return };
        self.is_raised = if self.is_raised {
            median_rad >= ENDING_SHARE * self.limit.rms_rad
        } else {
            self.limit.is_exceeded_by(median_rad)
        };
    }

    /// Whether the alarm stands.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.is_raised
    }

    /// The limit.
    #[must_use]
    pub fn limit(&self) -> DriftLimit {
        self.limit
    }

    /// Median drift of the last windows, rad rms; `None` before the first.
    #[must_use]
    pub fn median_rad(&self) -> Option<f64> {
        median_drift_rad(self.recent_rad.iter().copied())
    }
}

/// The drift that some windows are judged by: the middle one, of two the lower; `None` without any. rad rms.
#[must_use]
pub fn median_drift_rad(drifts_rad: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = drifts_rad.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the alarm stands after each of some windows.
    fn course(alarm: &mut DriftAlarm, rms_rad: &[f64]) -> Vec<bool> {
        let mut add = |&rms_rad: &f64| {
            alarm.add(&Drift { rms_rad, ..Drift::default() });
            alarm.is_raised()
        };
        rms_rad.iter().map(&mut add).collect()
    }

    #[test]
    fn it_takes_the_median_of_five_windows_and_single_ones_raise_nothing() {
        let mut alarm = DriftAlarm::new(DriftLimit { rms_rad: 0.1 });
        assert_eq!(course(&mut alarm, &[0.2; 5]), [false, false, false, false, true]);
        let mut alarm = DriftAlarm::new(DriftLimit { rms_rad: 0.1 });
        let spikes = [0.04, 0.5, 0.04, 0.5, 0.04, 0.5, 0.04, 0.5, 0.04, 0.04, 0.5, 0.04];
        assert!(course(&mut alarm, &spikes).iter().all(|raised| !raised));
        assert_eq!(alarm.median_rad(), Some(0.04));
    }

    #[test]
    fn a_drift_about_the_limit_does_not_flicker() {
        let mut alarm = DriftAlarm::new(DriftLimit { rms_rad: 0.1 });
        assert!(course(&mut alarm, &[0.12; 9])[8]);
        let about = [[0.099; 9], [0.101; 9], [0.085; 9]].concat();
        assert!(course(&mut alarm, &about).iter().all(|&raised| raised));
        assert_eq!(course(&mut alarm, &[0.079; 5]), [true, true, true, true, false]);
        assert!(course(&mut alarm, &[0.099; 20]).iter().all(|raised| !raised));
    }

    #[test]
    fn windows_that_tell_nothing_do_not_count() {
        let mut alarm = DriftAlarm::new(DriftLimit::default());
        for _ in 0..20 {
            alarm.add(&Drift { rms_rad: 0.9, share: 0.3, ..Drift::default() });
        }
        assert_eq!((alarm.is_raised(), alarm.median_rad()), (false, None));
    }
}

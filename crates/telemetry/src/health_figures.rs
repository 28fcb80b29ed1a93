//! Health of the scanner for people and programs, at one window and over a run.

use std::fmt;

use serde::Serialize;

use fringeflow_message::{GaugeReport, WindowReport};

use crate::health::{Gauge, Health, HealthLimits, HealthState, Measures, Quantity};

/// Health at one window.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HealthFigures {
    /// The worst state of all quantities.
    #[serde(serialize_with = "by_name")]
    pub state: HealthState,
    /// All quantities.
    pub quantities: Vec<GaugeFigures>,
}

/// A quantity over the last windows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GaugeFigures {
    /// The quantity, by its name.
    #[serde(serialize_with = "quantity_name")]
    pub quantity: Quantity,
    /// Title for people.
    pub title: &'static str,
    /// Unit of level and limits; empty for shares.
    pub unit: &'static str,
    /// Its state.
    #[serde(serialize_with = "by_name")]
    pub state: HealthState,
    /// Its level; `None` while too few windows have had a value.
    pub level: Option<f64>,
    /// Above this limit the state is a warning.
    pub warn: f64,
    /// Above this limit the state is bad.
    pub bad: f64,
    /// Time when the present state began; 0 while the state is unknown.
    pub since_ns: u64,
}

/// The health over the windows of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct HealthRecord {
    /// Windows with a health report.
    windows: u64,
    /// The worst state of all quantities in any window.
    #[serde(serialize_with = "by_name")]
    worst: HealthState,
    /// All quantities, each at the window at which it was worst.
    quantities: Vec<GaugeRecord>,
}

/// A quantity over a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct GaugeRecord {
    /// Its figures at its worst window: the highest level in its worst state.
    #[serde(flatten)]
    at_worst: GaugeFigures,
    /// Windows in which its state was a warning.
    windows_warn: u64,
    /// Windows in which its state was bad.
    windows_bad: u64,
}

impl HealthFigures {
    /// Returns the health in a window report, or `None` if the report comes from an older recording.
    #[must_use]
    pub fn from_report(report: &WindowReport) -> Option<Self> {
        Self::from_gauges(report.health.gauges.iter())
    }

    /// The health that a single window shows: its values against the limits.
    #[must_use]
    pub fn of_window(measures: &Measures, limits: &HealthLimits) -> Self {
        let mut health = Health::new(&limits.for_one_window());
        health.add(0, measures);
        let reports: Vec<GaugeReport> = health.gauges().iter().map(Gauge::report).collect();
        Self::from_gauges(reports.iter()).unwrap_or(Self { state: HealthState::NotKnown, quantities: Vec::new() })
    }

    /// The gauges in the order of [`Quantity::ALL`]; `None` without any.
    fn from_gauges<'a>(gauges: impl Iterator<Item = &'a GaugeReport>) -> Option<Self> {
        // Limits of 0 mark a gauge that the recording does not have.
        let quantities: Vec<_> = Quantity::ALL
            .into_iter()
            .zip(gauges)
            .map(|(quantity, gauge)| GaugeFigures::new(quantity, gauge))
            .filter(|gauge| gauge.bad > 0.0)
            .collect();
        let state = quantities.iter().map(|gauge| gauge.state).max()?;
        Some(Self { state, quantities })
    }

    /// Returns the figures of a quantity, or `None` if the report has none.
    #[must_use]
    pub fn quantity(&self, quantity: Quantity) -> Option<&GaugeFigures> {
        self.quantities.iter().find(|gauge| gauge.quantity == quantity)
    }

    /// Returns the quantities above their limits, the worst first.
    #[must_use]
    pub fn beyond_limits(&self) -> Vec<&GaugeFigures> {
        let mut beyond: Vec<_> = self.quantities.iter().filter(|gauge| gauge.state >= HealthState::Warn).collect();
        beyond.sort_by_key(|gauge| std::cmp::Reverse(gauge.state));
        beyond
    }
}

impl GaugeFigures {
    fn new(quantity: Quantity, report: &GaugeReport) -> Self {
        Self {
            quantity,
            title: quantity.title(),
            unit: quantity.unit(),
            state: HealthState::from_code(report.state),
            level: report.known(),
            warn: report.warn,
            bad: report.bad,
            since_ns: report.since_ns,
        }
    }

    /// Time since the present state began, seconds; `None` while the state is unknown.
    #[must_use]
    pub fn seconds_in_state(&self, now_ns: u64) -> Option<f64> {
        (self.since_ns > 0).then(|| now_ns.saturating_sub(self.since_ns) as f64 * 1e-9)
    }

    /// Whether a change of state should be logged: a change from or to a state above the limits.
    #[must_use]
    pub fn is_noteworthy_change(before: HealthState, now: HealthState) -> bool {
        before != now && before.max(now) >= HealthState::Warn
    }

    /// Formats a level or limit with its unit; shares in percent.
    #[must_use]
    pub fn with_unit(&self, value: f64) -> String {
        match self.unit {
            "" => format!("{:.1} %", 100.0 * value),
            unit => format!("{value:.3} {unit}"),
        }
    }

    /// Formats the level with its unit, or returns "not known".
    #[must_use]
    pub fn level_text(&self) -> String {
        self.level.map_or_else(|| HealthState::NotKnown.name().to_owned(), |level| self.with_unit(level))
    }
}

impl fmt::Display for GaugeFigures {
    /// Writes the state and the remedy, for people.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (title, level, key) = (self.title, self.level_text(), self.quantity.key());
        let remedy = self.quantity.remedy();
        match self.state {
            HealthState::NotKnown => write!(f, "{title}: not known"),
            HealthState::Ok => write!(f, "{title} is ok: {level}, within {}", self.with_unit(self.warn)),
            state => {
                let limit = if state == HealthState::Bad { self.bad } else { self.warn };
                let (state, limit) = (state.name(), self.with_unit(limit));
                write!(f, "{title}: {state}, {level}, limit {limit} ({key}); {remedy}")
            }
        }
    }
}

impl HealthRecord {
    /// Adds the report of a window.
    pub fn add(&mut self, report: &WindowReport) {
        let Some(figures) = HealthFigures::from_report(report) else { return };
        self.windows += 1;
        self.worst = self.worst.max(figures.state);
        for gauge in figures.quantities {
            let same = |record: &GaugeRecord| record.at_worst.quantity == gauge.quantity;
            let index = self.quantities.iter().position(same).unwrap_or_else(|| {
                self.quantities.push(GaugeRecord { at_worst: gauge, windows_warn: 0, windows_bad: 0 });
                self.quantities.len() - 1
            });
            self.quantities[index].add(gauge);
        }
    }

    /// The worst state of all quantities in any window; `None` if there was no health report.
    #[must_use]
    pub fn worst(&self) -> Option<HealthState> {
        (self.windows > 0).then_some(self.worst)
    }

    /// Whether no window had a health report.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.windows == 0
    }

    /// Returns the quantities that were above their limits, the worst first.
    fn beyond_limits(&self) -> Vec<&GaugeRecord> {
        let mut beyond: Vec<_> =
            self.quantities.iter().filter(|record| record.at_worst.state >= HealthState::Warn).collect();
        beyond.sort_by_key(|record| std::cmp::Reverse(record.at_worst.state));
        beyond
    }
}

impl GaugeRecord {
    fn add(&mut self, gauge: GaugeFigures) {
        self.windows_warn += u64::from(gauge.state == HealthState::Warn);
        self.windows_bad += u64::from(gauge.state == HealthState::Bad);
        let rank = |gauge: &GaugeFigures| (gauge.state, gauge.level.unwrap_or(0.0));
        if rank(&gauge) > rank(&self.at_worst) {
            self.at_worst = gauge;
        }
    }
}

impl fmt::Display for HealthRecord {
    /// Writes the worst state, and a line for each quantity that exceeded its limits, for people.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(worst) = self.worst() else { return write!(f, "health: no reports") };
        write!(f, "health: {} at worst, over {} windows", worst.name(), self.windows)?;
        for GaugeRecord { at_worst, windows_warn, windows_bad } in self.beyond_limits() {
            write!(f, "\n  {at_worst} [{windows_warn} windows warn, {windows_bad} bad]")?;
        }
        Ok(())
    }
}

fn by_name<S: serde::Serializer>(state: &HealthState, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(state.name())
}

fn quantity_name<S: serde::Serializer>(quantity: &Quantity, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(quantity.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(level: f64, state: HealthState) -> WindowReport {
        let mut report = WindowReport::default();
        report.health.gauges[Quantity::Drift as usize] =
            GaugeReport { level, warn: 0.1, bad: 0.2, since_ns: 5, state: state as u32, is_known: 1 };
        report.health.gauges[Quantity::HarmonicsCam1 as usize] =
            GaugeReport { warn: 0.04, bad: 0.1, ..GaugeReport::default() };
        report
    }

    #[test]
    fn figures_show_state_limit_and_remedy() {
        let figures = HealthFigures::from_report(&report(0.25, HealthState::Bad)).unwrap();
        assert_eq!(figures.state, HealthState::Bad);
        let text = figures.beyond_limits()[0].to_string();
        for part in
            ["drift of the calibration: bad, 0.250 rad", "limit 0.200 rad", "health.drift_rad", "calibrate again"]
        {
            assert!(text.contains(part), "{text}");
        }
        let harmonics = figures.quantity(Quantity::HarmonicsCam1).unwrap();
        assert_eq!(
            (harmonics.level, harmonics.to_string().as_str()),
            (None, "harmonics of the fringes, camera 1: not known")
        );
        let json = serde_json::to_value(harmonics).unwrap();
        assert_eq!((&json["level"], &json["state"]), (&serde_json::Value::Null, &"not known".into()));
        assert_eq!(HealthFigures::from_report(&WindowReport::default()), None);
    }

    #[test]
    fn a_run_is_judged_by_its_worst_window() {
        let mut record = HealthRecord::default();
        assert_eq!((record.worst(), record.to_string().as_str()), (None, "health: no reports"));
        for (level, state) in [
            (0.0, HealthState::NotKnown),
            (0.09, HealthState::Ok),
            (0.15, HealthState::Warn),
            (0.25, HealthState::Bad),
            (0.21, HealthState::Bad),
            (0.19, HealthState::Bad),
            (0.01, HealthState::Ok),
        ] {
            record.add(&report(level, state));
        }
        let [worst] = record.beyond_limits()[..] else { panic!("one quantity") };
        assert_eq!((worst.at_worst.level, worst.windows_warn, worst.windows_bad), (Some(0.25), 1, 3));
        assert_eq!((record.worst(), record.windows), (Some(HealthState::Bad), 7));
        assert!(record.to_string().starts_with("health: bad at worst, over 7 windows\n  drift"), "{record}");
    }
}

//! `project --check`: how steadily a monitor shows images.

use std::time::Duration;

use serde::Serialize;

use fringeflow_patterns::PatternSet;

use crate::schedule::Schedule;
use crate::window::{Completed, Window};
use crate::{Monitor, ProjectorError, Screen};

/// Refreshes that are measured.
const REFRESHES: u64 = 180;
/// Longest wait for one of them.
const SILENCE: Duration = Duration::from_secs(5);

/// How steadily a monitor shows an image at each refresh.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Steadiness {
    /// Refreshes per second, measured.
    pub refresh_hz: f64,
    /// Images shown.
    pub shown: u64,
    /// Refreshes without a new image.
    pub missed: u64,
    /// Images that went straight to the monitor; the others were copied.
    pub flipped: u64,
    /// Deviation of the times of the images from an even grid, rms, microseconds.
    pub jitter_rms_us: f64,
    /// Largest deviation, microseconds.
    pub jitter_max_us: f64,
}

/// Shows a set of patterns, a new one at each refresh, and measures when they appear.
///
/// # Errors
/// The patterns do not fit the monitor, or the server does not answer.
pub fn check(screen: &Screen, monitor: &Monitor, set: &PatternSet) -> Result<Steadiness, ProjectorError> {
    let window = Window::open(screen, monitor)?;
    let images = (0..set.images.len()).filter_map(|index| set.image(index));
    let images = images.map(|image| window.store(&image)).collect::<Result<Vec<_>, _>>()?;
    let mut now = window.time(0)?.refresh;
    let mut schedule = Schedule::new(images.len(), 1);
    let (mut times, mut missed, mut flipped) = (Vec::new(), 0, 0);
    let end = now + REFRESHES;
    while now < end {
        while let Some(request) = schedule.next(now) {
            window.present(images[request.pattern], request.serial, request.refresh)?;
        }
        let told = window.wait(SILENCE)?.ok_or_else(|| window.silent())?;
        now = now.max(told.refresh);
        let is_shown = matches!(told.kind, Completed::Shown { .. });
        if let Some(shown) = schedule.complete(told.serial, told.refresh, is_shown) {
            missed += shown.missed;
            flipped += u64::from(told.kind == Completed::Shown { flipped: true });
            times.push((told.refresh, told.time_ns));
        }
    }
    let (period_ns, deviations_ns) = grid(&times);
    let squares: f64 = deviations_ns.iter().map(|deviation| deviation * deviation).sum();
    Ok(Steadiness {
        refresh_hz: 1e9 / period_ns,
        shown: times.len() as u64,
        missed,
        flipped,
        jitter_rms_us: (squares / deviations_ns.len().max(1) as f64).sqrt() / 1e3,
        jitter_max_us: deviations_ns.iter().fold(0.0, |max: f64, deviation| max.max(deviation.abs())) / 1e3,
    })
}

/// Fits an even grid to times of refreshes. Returns its period and the deviation of each time, ns.
fn grid(times: &[(u64, u64)]) -> (f64, Vec<f64>) {
    let Some(&(first_refresh, first_ns)) = times.first() else { return (f64::NAN, Vec::new()) };
    let points: Vec<(f64, f64)> = times
        .iter()
        .map(|&(refresh, time_ns)| {
            (refresh.saturating_sub(first_refresh) as f64, time_ns.saturating_sub(first_ns) as f64)
        })
        .collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum();
    let period_ns = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / spread;
    (period_ns, points.iter().map(|p| p.1 - y - period_ns * (p.0 - x)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_has_the_period_and_the_deviations() {
        let times: Vec<(u64, u64)> = (0..100)
            .filter(|k| k % 7 != 3)
            .map(|k| (500 + k, 1_000_000_000 + 16_666_667 * k + if k % 2 == 0 { 30_000 } else { 0 }))
            .collect();
        let (period_ns, deviations_ns) = grid(&times);
        assert!((period_ns - 16_666_667.0).abs() < 100.0, "{period_ns}");
        assert!(deviations_ns.iter().all(|d| (d.abs() - 15_000.0).abs() < 3_000.0), "{deviations_ns:?}");
    }
}

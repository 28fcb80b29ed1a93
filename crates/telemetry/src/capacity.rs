//! How many clouds per second the machine holds, what bounds it, and which settings hold the rate of the cameras.
//!
//! ```text
//! rate ≤ windows at once / time for a window, of each stage       stages are processes: they work side by side
//! rate ≤ processors / CPU time of all stages for a window
//! rate ≤ clouds made                                              while windows are skipped
//! ```
//!
//! The figures are means over the last seconds, while the stages share the processors, so the rate is approximate. CPU
//! time includes cameras, recorder and tracking, but not the supervisor and the monitor. Tracking bounds no rate: it
//! leaves out clouds.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use fringeflow_message::{Counts, DropReason, Stage};

use super::{Load, Tally};

/// Stages that each window passes through.
const CHAIN: [Stage; 3] = [Stage::Phase, Stage::Correspondence, Stage::Cloud];
/// Share of the windows that may be skipped occasionally.
const SLACK: f64 = 0.05;
/// Share of the pixels, and so of the time, that `cameras.binning = 2` leaves.
const BINNED_SHARE: f64 = 0.25;

/// The rate that the machine holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Capacity {
    /// Clouds per second that the machine holds.
    pub clouds_hz: f64,
    /// What bounds them.
    #[serde(flatten)]
    pub bound: Bound,
    /// Complete windows per second from the cameras.
    pub windows_hz: f64,
    /// Settings that hold the rate of the cameras; `None` if the present ones do.
    pub remedy: Option<Remedy>,
}

/// What bounds the rate. In JSON a name and a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "bound", rename_all = "snake_case")]
pub enum Bound {
    /// The stage with the longest time.
    Stage {
        /// Its name.
        stage: &'static str,
        /// Its time for a window.
        window_ms: f64,
        /// Number of windows that it works on at once.
        at_once: u64,
    },
    /// All processors are busy.
    Processors {
        /// Their number.
        processors: u64,
        /// CPU time of all stages for a window.
        window_ms: f64,
    },
}

/// Settings that hold the rate of the cameras. Each helps alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Remedy {
    /// Smallest `window.every`.
    pub every: u32,
    /// Share of the pixels that `cameras.region_px` may use.
    pub pixels_share: f64,
    /// Clouds per second with `cameras.binning = 2`, or another quarter of the pixels.
    pub binned_clouds_hz: f64,
}

/// Measured figures of an instance.
#[derive(Clone, Debug)]
struct Measured {
    windows_hz: f64,
    clouds_hz: f64,
    /// Windows per second skipped for lack of time.
    skipped_hz: f64,
    /// Window stride.
    every: u32,
    /// Stages, their times for a window, milliseconds, and the number of windows that they work on at once.
    stages: Vec<(Stage, f64, u64)>,
    /// CPU time of all stages per second, seconds.
    cpus: f64,
    /// Number of processors; 0 if unknown.
    processors: u64,
}

impl Capacity {
    /// Computes the capacity of a running instance from the reports of its stages. Returns `None` if no clouds were
    /// made in the last seconds.
    #[must_use]
    pub fn from_tally(tally: &Tally) -> Option<Self> {
        let load = |stage| tally.stage(stage)?.load();
        // Several stages may share a process, which must count once.
        let processes = tally.stages().filter_map(|(_, stage)| Some((stage.pid, stage.load()?.cpus)));
        let measured = Measured {
            windows_hz: load(Stage::Windowing)?.passed_hz,
            clouds_hz: load(Stage::Cloud)?.passed_hz,
            skipped_hz: load(Stage::Phase).map_or(0.0, |phase: Load| phase.skipped_hz),
            every: stride(&tally.stage(Stage::Windowing)?.counts)?,
            stages: CHAIN
                .iter()
                .filter_map(|&stage| Some((stage, load(stage)?.work_ms?, tally.stage(stage)?.at_once)))
                .collect(),
            cpus: processes.collect::<BTreeMap<_, _>>().values().sum(),
            processors: tally.stage(Stage::Cloud)?.processors,
        };
        measured.capacity()
    }
}

/// Returns the window stride that the counts of the windowing stage show.
fn stride(windowing: &Counts) -> Option<u32> {
    let (wanted, between) = (windowing.passed as f64, windowing.dropped(DropReason::BetweenWindows) as f64);
    (wanted > 0.0).then(|| ((wanted + between) / wanted).round() as u32)
}

impl Measured {
    fn capacity(&self) -> Option<Capacity> {
        let Self { windows_hz, clouds_hz, skipped_hz, .. } = *self;
        if windows_hz <= 0.0 || clouds_hz <= 0.0 {
            return None;
        }
        let bounds = self.stage_bound().into_iter().chain(self.processors_bound());
        let (bound, bound_hz) = bounds.min_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let is_skipping = skipped_hz > SLACK * windows_hz;
        let holds_hz = if is_skipping { bound_hz.min(clouds_hz) } else { bound_hz };
        Some(Capacity { clouds_hz: holds_hz, bound, windows_hz, remedy: self.remedy(holds_hz) })
    }

    fn stage_bound(&self) -> Option<(Bound, f64)> {
        let bounds = self.stages.iter().map(|&(stage, window_ms, at_once)| {
            (Bound::Stage { stage: stage.name(), window_ms, at_once }, at_once as f64 * 1000.0 / window_ms)
        });
        bounds.min_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    fn processors_bound(&self) -> Option<(Bound, f64)> {
        let Self { processors, cpus, clouds_hz, .. } = *self;
        let window_ms = 1000.0 * cpus / clouds_hz;
        let bound_hz = processors as f64 * 1000.0 / window_ms;
        (processors > 0 && cpus > 0.0).then_some((Bound::Processors { processors, window_ms }, bound_hz))
    }

    fn remedy(&self, holds_hz: f64) -> Option<Remedy> {
        let times = self.windows_hz / holds_hz;
        (times > 1.0 + SLACK).then(|| Remedy {
            every: (f64::from(self.every) * times - SLACK).ceil() as u32,
            pixels_share: 1.0 / times,
            binned_clouds_hz: holds_hz / BINNED_SHARE,
        })
    }
}

impl fmt::Display for Capacity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { clouds_hz, bound, windows_hz, remedy } = self;
        write!(f, "this computer holds about {clouds_hz:.1} clouds per second: {bound}. ")?;
        write!(f, "The cameras give {windows_hz:.1} windows per second")?;
        let Some(Remedy { every, pixels_share, binned_clouds_hz }) = remedy else { return Ok(()) };
        write!(
            f,
            ": set window.every = {every}, or a cameras.region_px of {:.0} % of the pixels",
            100.0 * pixels_share
        )?;
        if matches!(bound, Bound::Stage { stage, .. } if *stage == Stage::Phase.name()) {
            write!(f, ", or fewer phase.extra_images")?;
        }
        write!(f, ", or cameras.binning = 2, which holds about {binned_clouds_hz:.0}")
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stage { stage, window_ms, at_once } => {
                write!(f, "{stage} takes {window_ms:.0} ms for a window")?;
                if *at_once > 1 { write!(f, " and works on {at_once} at once") } else { Ok(()) }
            }
            Self::Processors { processors, window_ms } => {
                write!(f, "a window takes {window_ms:.0} ms of CPU time, and {processors} processors share it")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::StageReport;

    /// Four processors, 15 windows per second of every second image pair, and a correspondence stage that takes 104 ms.
    fn measured() -> Measured {
        Measured {
            windows_hz: 15.0,
            clouds_hz: 9.6,
            skipped_hz: 5.4,
            every: 2,
            stages: vec![(Stage::Phase, 30.0, 1), (Stage::Correspondence, 104.0, 1), (Stage::Cloud, 5.0, 1)],
            cpus: 1.5,
            processors: 4,
        }
    }

    #[test]
    fn the_longest_stage_bounds_the_rate() {
        let capacity = measured().capacity().unwrap();
        assert_eq!(capacity.bound, Bound::Stage { stage: "correspondence", window_ms: 104.0, at_once: 1 });
        let remedy = capacity.remedy.unwrap();
        // Every third pair would still be 10 windows per second.
        assert_eq!((capacity.clouds_hz, remedy.every), (9.6, 4));
        assert!((remedy.pixels_share - 0.64).abs() < 1e-9 && (remedy.binned_clouds_hz - 38.4).abs() < 1e-9);
        assert_eq!(
            capacity.to_string(),
            "this computer holds about 9.6 clouds per second: correspondence takes 104 ms for a window. The cameras \
             give 15.0 windows per second: set window.every = 4, or a cameras.region_px of 64 % of the pixels, or \
             cameras.binning = 2, which holds about 38"
        );
    }

    #[test]
    fn a_stage_that_works_on_two_windows_at_once_holds_twice_the_rate() {
        let stages = vec![(Stage::Phase, 80.0, 1), (Stage::Correspondence, 140.0, 2)];
        let capacity = Measured { skipped_hz: 0.0, stages, ..measured() }.capacity().unwrap();
        assert_eq!(
            (capacity.bound, capacity.clouds_hz),
            (Bound::Stage { stage: "phase", window_ms: 80.0, at_once: 1 }, 12.5)
        );
        let stages = vec![(Stage::Phase, 50.0, 1), (Stage::Correspondence, 140.0, 2)];
        let capacity = Measured { skipped_hz: 0.0, stages, ..measured() }.capacity().unwrap();
        assert!((capacity.clouds_hz - 2000.0 / 140.0).abs() < 1e-9);
        assert!(capacity.to_string().contains("correspondence takes 140 ms for a window and works on 2 at once"));
    }

    #[test]
    fn fewer_images_help_where_phase_takes_longest() {
        let stages = vec![(Stage::Phase, 130.0, 1), (Stage::Correspondence, 104.0, 1)];
        let capacity = Measured { stages, ..measured() }.capacity().unwrap();
        assert!(capacity.to_string().contains("phase takes 130 ms for a window"));
        assert!(capacity.to_string().contains("or fewer phase.extra_images"));
        assert!(!measured().capacity().unwrap().to_string().contains("extra_images"));
    }

    #[test]
    fn busy_processors_bound_the_rate() {
        // The stages alone would hold 20 clouds per second.
        let stages = vec![(Stage::Phase, 30.0, 1), (Stage::Correspondence, 50.0, 1)];
        let busy = Measured { stages, cpus: 1.92, processors: 2, ..measured() };
        let capacity = busy.capacity().unwrap();
        assert_eq!(capacity.bound, Bound::Processors { processors: 2, window_ms: 200.0 });
        // Two processors hold 10.0; while windows are skipped, the clouds that are made count.
        assert_eq!((capacity.clouds_hz, capacity.remedy.unwrap().every), (9.6, 4));
        let text = capacity.to_string();
        assert!(text.contains("a window takes 200 ms of CPU time, and 2 processors share it"), "{text}");
        assert_eq!(Measured { skipped_hz: 0.0, ..busy }.capacity().unwrap().clouds_hz, 10.0);
    }

    #[test]
    fn no_advice_is_given_while_all_windows_are_held() {
        let stages = vec![(Stage::Phase, 30.0, 1), (Stage::Correspondence, 50.0, 1)];
        let held = Measured { clouds_hz: 15.0, skipped_hz: 0.0, stages, ..measured() }.capacity().unwrap();
        assert_eq!((held.clouds_hz, held.remedy), (20.0, None));
        assert_eq!(
            held.to_string(),
            "this computer holds about 20.0 clouds per second: correspondence takes 50 ms for a window. The cameras \
             give 15.0 windows per second"
        );
        for nothing in [Measured { clouds_hz: 0.0, ..measured() }, Measured { windows_hz: 0.0, ..measured() }] {
            assert_eq!(nothing.capacity(), None);
        }
    }

    /// Adds the reports of three seconds at ten windows per second, of every third pair. All of its stages but the
    /// cloud stage are one process, which uses half a processor.
    fn tally() -> Tally {
        const MS: u64 = 1_000_000;
        let mut tally = Tally::default();
        for n in 0..=30 {
            for (stage, pid, work_ms) in [(Stage::Windowing, 7, 0), (Stage::Phase, 7, 20), (Stage::Cloud, 8, 40)] {
                let mut counts = Counts { passed: n, ..Counts::default() };
                counts.drop_many(DropReason::BetweenWindows, 2 * n);
                tally.add(&StageReport {
                    stage: stage as u32,
                    pid,
                    of_item: u32::from(work_ms > 0),
                    time_ns: n * 100 * MS,
                    work_ns: work_ms * MS,
                    cpu_ns: n * 50 * MS,
                    processors: 4,
                    counts,
                    ..StageReport::default()
                });
            }
        }
        tally
    }

    #[test]
    fn the_reports_of_the_stages_tell_the_capacity() {
        let capacity = Capacity::from_tally(&tally()).unwrap();
        assert_eq!(capacity.bound, Bound::Stage { stage: "cloud", window_ms: 40.0, at_once: 1 });
        assert_eq!((capacity.clouds_hz, capacity.windows_hz, capacity.remedy), (25.0, 10.0, None));
        assert_eq!(Capacity::from_tally(&Tally::default()), None);
    }

    #[test]
    fn a_process_of_several_stages_counts_once() {
        let mut tally = tally();
        // Two processes with half a processor each: a window takes 100 ms of CPU time, and one processor holds ten.
        let stage = tally.stage(Stage::Cloud).map(|cloud| cloud.counts).unwrap();
        let last = StageReport {
            stage: Stage::Cloud as u32,
            pid: 8,
            time_ns: 3_000_000_000,
            counts: stage,
            ..StageReport::default()
        };
        tally.add(&StageReport { cpu_ns: 1_500_000_000, processors: 1, ..last });
        let capacity = Capacity::from_tally(&tally).unwrap();
        assert_eq!(capacity.bound, Bound::Processors { processors: 1, window_ms: 100.0 });
    }
}

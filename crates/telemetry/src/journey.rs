//! Measures how the time of a window divides among the stages, from its last exposure to its cloud.

use std::collections::BTreeMap;

use fringeflow_message::{Stage, StageReport};

/// Maximum number of windows in progress. Older ones were dropped by a stage. A reader that had to wait for a processor
/// gets all reports of one stage before those of the next: beside the usual 64, as many windows wait here as `report/stage`
/// keeps reports for it.
const MAX_IN_PROGRESS: usize = 64 + 256;

/// A part of the time from exposure to cloud. The segments add up to the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(usize)]
pub enum Segment {
    /// From the start of the last exposure until its images reached the computer.
    Camera = 0,
    /// Waiting for the other camera or the pattern event, until the window was complete.
    Pairing = 1,
    /// Decoding, including the wait for the next stage to be free.
    Phase = 2,
    /// Waiting for the correspondence stage.
    CorrespondenceQueue = 3,
    /// Search and resolution.
    Correspondence = 4,
    /// Waiting for the cloud stage.
    CloudQueue = 5,
    /// Triangulation and publication.
    Cloud = 6,
}

/// The times at which a window passed the stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Journey {
    /// Start of the last exposure.
    pub exposure_start_ns: u64,
    /// End of each segment, indexed by [`Segment`]. Each segment begins where the one before it ended.
    pub ends_ns: [u64; Segment::ALL.len()],
}

impl Segment {
    /// All segments in their order.
    pub const ALL: [Self; 7] = [
        Self::Camera,
        Self::Pairing,
        Self::Phase,
        Self::CorrespondenceQueue,
        Self::Correspondence,
        Self::CloudQueue,
        Self::Cloud,
    ];

    /// Name in metrics and reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera => "camera",
            Self::Pairing => "pairing",
            Self::Phase => "phase",
            Self::CorrespondenceQueue => "correspondence_queue",
            Self::Correspondence => "correspondence",
            Self::CloudQueue => "cloud_queue",
            Self::Cloud => "cloud",
        }
    }
}

impl Journey {
    /// Creates a journey from the reports of the three processing stages on the same window.
    fn new(phase: &StageReport, correspondence: &StageReport, cloud: &StageReport) -> Self {
        let ends_ns = [
            phase.received_ns,
            phase.taken_ns,
            phase.passed_ns,
            correspondence.taken_ns,
            correspondence.passed_ns,
            cloud.taken_ns,
            cloud.passed_ns,
        ];
        // The next stage may receive an item before its predecessor has noted the time of passing it on. Clamping keeps
        // each duration from being negative.
        let mut latest_ns = cloud.exposure_start_ns;
        let ends_ns = ends_ns.map(|end_ns| {
            latest_ns = latest_ns.max(end_ns).min(cloud.passed_ns.max(latest_ns));
            latest_ns
        });
        Self { exposure_start_ns: cloud.exposure_start_ns, ends_ns }
    }

    /// Iterates over the segments with begin and end, nanoseconds.
    pub fn segments(&self) -> impl Iterator<Item = (Segment, u64, u64)> + '_ {
        let begins = std::iter::once(self.exposure_start_ns).chain(self.ends_ns);
        Segment::ALL.into_iter().zip(begins).zip(self.ends_ns).map(|((segment, begin), end)| (segment, begin, end))
    }

    /// Duration of a segment, nanoseconds.
    #[must_use]
    pub fn duration_ns(&self, segment: Segment) -> u64 {
        self.segments().find(|(s, ..)| *s == segment).map_or(0, |(_, begin, end)| end - begin)
    }

    /// Returns the journey without the time before its window was complete.
    #[must_use]
    pub fn since_window_complete(&self) -> Self {
        let complete_ns = self.ends_ns[Segment::Pairing as usize];
        Self { exposure_start_ns: complete_ns, ends_ns: self.ends_ns.map(|end_ns| end_ns.max(complete_ns)) }
    }

    /// Duration from exposure to cloud, nanoseconds.
    #[must_use]
    pub fn total_ns(&self) -> u64 {
        self.ends_ns[Segment::Cloud as usize] - self.exposure_start_ns
    }
}

/// Matches reports on the same window.
#[derive(Debug, Default)]
pub(super) struct Journeys {
    /// Reports of the phase, correspondence and cloud stages, by start of exposure.
    in_progress: BTreeMap<u64, [Option<StageReport>; 3]>,
}

impl Journeys {
    /// Adds a report, and returns the journey of a window whose last report it is. The last report need not be that of
    /// the cloud stage: a stage passes an item on before it reports, and the next stage may report first.
    pub(super) fn add(&mut self, report: &StageReport) -> Option<Journey> {
        let index = match Stage::from_code(report.stage).filter(|_| report.of_item != 0)? {
            Stage::Phase => 0,
            Stage::Correspondence => 1,
            Stage::Cloud => 2,
            _ => return None,
        };
        let reports = self.in_progress.entry(report.exposure_start_ns).or_default();
        reports[index] = Some(*report);
        if let [Some(phase), Some(correspondence), Some(cloud)] = reports {
            let journey = Journey::new(phase, correspondence, cloud);
            self.in_progress.remove(&report.exposure_start_ns);
            return Some(journey);
        }
        if self.in_progress.len() > MAX_IN_PROGRESS {
            self.in_progress.pop_first();
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(stage: Stage, taken_ns: u64, passed_ns: u64) -> StageReport {
        let (exposure_start_ns, received_ns) = (1000, 1030);
        StageReport {
            stage: stage as u32,
            of_item: 1,
            exposure_start_ns,
            received_ns,
            taken_ns,
            passed_ns,
            ..StageReport::default()
        }
    }

    #[test]
    fn segments_add_up_to_the_total() {
        let mut journeys = Journeys::default();
        assert_eq!(journeys.add(&report(Stage::Phase, 1040, 1055)), None);
        // Received before the phase stage had noted the time of passing it on.
        assert_eq!(journeys.add(&report(Stage::Correspondence, 1054, 1100)), None);
        let journey = journeys.add(&report(Stage::Cloud, 1110, 1150)).unwrap();
        let durations: Vec<u64> = Segment::ALL.iter().map(|&segment| journey.duration_ns(segment)).collect();
        assert_eq!(durations, [30, 10, 15, 0, 45, 10, 40]);
        assert_eq!((durations.iter().sum::<u64>(), journey.total_ns()), (150, 150));
        let complete = journey.since_window_complete();
        let durations: Vec<u64> = Segment::ALL.iter().map(|&segment| complete.duration_ns(segment)).collect();
        assert_eq!((durations, complete.total_ns()), (vec![0, 0, 15, 0, 45, 10, 40], 110));
    }

    #[test]
    fn a_window_with_a_report_missing_has_no_journey() {
        let mut journeys = Journeys::default();
        journeys.add(&report(Stage::Phase, 1040, 1055));
        assert_eq!(journeys.add(&report(Stage::Cloud, 1110, 1150)), None);
        assert_eq!(journeys.add(&StageReport { of_item: 0, ..report(Stage::Cloud, 0, 0) }), None);
    }

    #[test]
    fn reports_may_come_in_any_order() {
        let reports = [
            report(Stage::Phase, 1040, 1055),
            report(Stage::Correspondence, 1056, 1100),
            report(Stage::Cloud, 1099, 1150),
        ];
        let journeys = [[0, 1, 2], [0, 2, 1], [2, 1, 0]].map(|order| {
            let mut journeys = Journeys::default();
            let completed = order.map(|index| journeys.add(&reports[index]));
            assert!(journeys.in_progress.is_empty());
            completed
        });
        assert!(journeys.iter().all(|[first, second, last]| first.is_none() && second.is_none() && last.is_some()));
        assert!(journeys.iter().all(|completed| *completed == journeys[0]));
    }

    #[test]
    fn a_late_reader_gets_the_reports_of_one_stage_after_those_of_the_other() {
        let mut journeys = Journeys::default();
        let stages = [Stage::Phase, Stage::Correspondence, Stage::Cloud];
        let reports = stages.into_iter().flat_map(|stage| {
            (0..256).map(move |exposure_start_ns| StageReport { exposure_start_ns, ..report(stage, 1100, 1150) })
        });
        assert_eq!(reports.filter_map(|report| journeys.add(&report)).count(), 256);
    }

    #[test]
    fn dropped_windows_are_forgotten() {
        let mut journeys = Journeys::default();
        for exposure_start_ns in 0..1000 {
            journeys.add(&StageReport { exposure_start_ns, ..report(Stage::Phase, 1, 2) });
        }
        assert_eq!(journeys.in_progress.len(), MAX_IN_PROGRESS);
    }

    #[test]
    fn impossible_times_give_no_negative_segment() {
        let mut journeys = Journeys::default();
        journeys.add(&report(Stage::Phase, u64::MAX, 5));
        journeys.add(&report(Stage::Correspondence, 7, u64::MAX));
        let journey = journeys.add(&report(Stage::Cloud, 3, 1200)).unwrap();
        assert_eq!(journey.total_ns(), 200);
        assert_eq!(journey.segments().map(|(_, begin, end)| end - begin).sum::<u64>(), 200);
    }
}

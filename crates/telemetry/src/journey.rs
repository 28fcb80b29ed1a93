//! Where the time of a window went, from its last exposure to its cloud.

use std::collections::BTreeMap;

use fringeflow_message::{Stage, StageReport};

/// Windows that may be under way at once; older ones were dropped.
const UNDER_WAY: usize = 64;

/// A part of the way from exposure to cloud; together they are the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(usize)]
pub enum Segment {
    /// From the start of the last exposure until its images had reached the machine.
    Camera = 0,
    /// Until the window was complete: the other camera, the pattern event.
    Pairing = 1,
    /// Decoding, the wait for the next stage to be free among it.
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

/// The times of one window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Journey {
    /// Start of the last exposure.
    pub exposure_start_ns: u64,
    /// When each segment ended, by [`Segment`]; it began when the one before ended.
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
    /// From reports of the three working stages on the same window.
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
        // A stage may take what the one before is still noting as put out; no segment runs back for that.
        let mut latest_ns = cloud.exposure_start_ns;
        let ends_ns = ends_ns.map(|end_ns| {
            latest_ns = latest_ns.max(end_ns).min(cloud.passed_ns.max(latest_ns));
            latest_ns
        });
        Self { exposure_start_ns: cloud.exposure_start_ns, ends_ns }
    }

    /// The segments with begin and end, nanoseconds.
    pub fn segments(&self) -> impl Iterator<Item = (Segment, u64, u64)> + '_ {
        let begins = std::iter::once(self.exposure_start_ns).chain(self.ends_ns);
        Segment::ALL.into_iter().zip(begins).zip(self.ends_ns).map(|((segment, begin), end)| (segment, begin, end))
    }

    /// Duration of a segment, nanoseconds.
    #[must_use]
    pub fn duration_ns(&self, segment: Segment) -> u64 {
        self.segments().find(|(s, ..)| *s == segment).map_or(0, |(_, begin, end)| end - begin)
    }

    /// The same from the moment at which its window was complete; its exposure and all before are forgotten.
    #[must_use]
    pub fn from_window(&self) -> Self {
        let complete_ns = self.ends_ns[Segment::Pairing as usize];
        Self { exposure_start_ns: complete_ns, ends_ns: self.ends_ns.map(|end_ns| end_ns.max(complete_ns)) }
    }

    /// From exposure to cloud, nanoseconds.
    #[must_use]
    pub fn total_ns(&self) -> u64 {
        self.ends_ns[Segment::Cloud as usize] - self.exposure_start_ns
    }
}

/// Puts reports on the same window together.
#[derive(Debug, Default)]
pub(super) struct Journeys {
    /// Reports of the phase, the correspondence and the cloud stage, by exposure.
    under_way: BTreeMap<u64, [Option<StageReport>; 3]>,
}

impl Journeys {
    /// Takes a report; the journey of a window whose last report it is. That need not be the one of the cloud: a stage puts
    /// out first and reports then, and the next one may be faster.
    pub(super) fn add(&mut self, report: &StageReport) -> Option<Journey> {
        let place = match Stage::from_code(report.stage).filter(|_| report.of_item != 0)? {
            Stage::Phase => 0,
            Stage::Correspondence => 1,
            Stage::Cloud => 2,
            _ => return None,
        };
        let reports = self.under_way.entry(report.exposure_start_ns).or_default();
        reports[place] = Some(*report);
        if let [Some(phase), Some(correspondence), Some(cloud)] = reports {
            let journey = Journey::new(phase, correspondence, cloud);
            self.under_way.remove(&report.exposure_start_ns);
            return Some(journey);
        }
        if self.under_way.len() > UNDER_WAY {
            self.under_way.pop_first();
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
        // Taken before the phase stage had noted that it was put out.
        assert_eq!(journeys.add(&report(Stage::Correspondence, 1054, 1100)), None);
        let journey = journeys.add(&report(Stage::Cloud, 1110, 1150)).unwrap();
        let durations: Vec<u64> = Segment::ALL.iter().map(|&segment| journey.duration_ns(segment)).collect();
        assert_eq!(durations, [30, 10, 15, 0, 45, 10, 40]);
        assert_eq!((durations.iter().sum::<u64>(), journey.total_ns()), (150, 150));
        let from_window = journey.from_window();
        let durations: Vec<u64> = Segment::ALL.iter().map(|&segment| from_window.duration_ns(segment)).collect();
        assert_eq!((durations, from_window.total_ns()), (vec![0, 0, 15, 0, 45, 10, 40], 110));
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
            let ended = order.map(|place| journeys.add(&reports[place]));
            assert!(journeys.under_way.is_empty());
            ended
        });
        assert!(journeys.iter().all(|[first, second, last]| first.is_none() && second.is_none() && last.is_some()));
        assert!(journeys.iter().all(|ended| *ended == journeys[0]));
    }

    #[test]
    fn dropped_windows_are_forgotten() {
        let mut journeys = Journeys::default();
        for exposure_start_ns in 0..1000 {
            journeys.add(&StageReport { exposure_start_ns, ..report(Stage::Phase, 1, 2) });
        }
        assert_eq!(journeys.under_way.len(), UNDER_WAY);
    }

    #[test]
    fn times_that_cannot_be_never_run_back() {
        let mut journeys = Journeys::default();
        journeys.add(&report(Stage::Phase, u64::MAX, 5));
        journeys.add(&report(Stage::Correspondence, 7, u64::MAX));
        let journey = journeys.add(&report(Stage::Cloud, 3, 1200)).unwrap();
        assert_eq!(journey.total_ns(), 200);
        assert_eq!(journey.segments().map(|(_, begin, end)| end - begin).sum::<u64>(), 200);
    }
}

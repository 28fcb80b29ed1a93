//! Progress of a stage: counts that add up, and the times of its last item.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use crate::Incident;
use crate::codes::codes;

codes! {
    /// A stage of the pipeline. The meaning states what it counts.
    pub enum Stage {
        Camera1 = 0, "camera1", "images of camera 1, captured";
        Camera2 = 1, "camera2", "images of camera 2, captured";
        Projector = 2, "projector", "pattern events of the projector driver";
        Pattern = 3, "pattern", "pattern events that gave an image pair its step";
        Pairing = 4, "pairing", "images of both cameras, paired and given their step";
        Windowing = 5, "windowing", "image pairs, each the last of a complete window";
        Phase = 6, "phase", "windows, decoded to phase maps";
        Correspondence = 7, "correspondence", "phase maps, searched for correspondences";
        Cloud = 8, "cloud", "correspondences, triangulated to clouds";
        Recorder = 9, "recorder", "messages of all channels, written to a recording";
        Tracking = 10, "tracking", "clouds, registered to the model";
    }
}

codes! {
    /// Why an item did not reach the end of its stage.
    pub enum DropReason {
        Overrun = 0, "overrun", "overwritten in the channel before the stage took it";
        CameraLost = 1, "camera_lost", "lost by the camera or its driver";
        Duplicate = 2, "duplicate", "arrived twice";
        Late = 3, "late", "arrived after later items had been processed";
        Unpaired = 4, "unpaired", "the other camera has no image of the same exposure";
        NoPattern = 5, "no_pattern", "no pattern event belongs to its exposure";
        PatternConflict = 6, "pattern_conflict", "its pattern event or step contradicts an earlier one";
        NewSession = 7, "new_session", "camera or projector restarted before its window was complete";
        BadImage = 8, "bad_image", "size, format or flags do not match the rig";
        BadTime = 9, "bad_time", "its time stamp is impossible";
        Incomplete = 10, "incomplete", "an image before it is missing, so its window is not complete";
        BetweenWindows = 11, "between_windows", "the window stride skips the window that ends with it";
        NextStageBusy = 12, "next_stage_busy", "the next stage was still busy with an earlier one";
        NoCorrespondence = 13, "no_correspondence", "no measurable correspondence in the images";
        EmptyCloud = 14, "empty_cloud", "no point was found";
        QueueFull = 15, "queue_full", "the queue to the disk was full";
        DiskFull = 16, "disk_full", "the disk was full";
        NotRecording = 17, "not_recording", "no recording was running";
        Restart = 18, "restart", "the service died while processing it, or was not running";
        Stopped = 19, "stopped", "the run ended before it was processed";
        NoSample = 20, "no_sample", "no free sample was left in the channel";
        Malformed = 21, "malformed", "the message contradicts itself";
        Injected = 22, "injected", "a fault injected by the virtual scanner, as configured";
        HiddenLoss = 23, "hidden_loss", "its images show that one was lost, though no number is missing";
        HiddenDuplicate = 24, "hidden_duplicate", "its images show that one arrived twice, though no number repeats";
        HiddenSwap = 25, "hidden_swap", "its images show that two were swapped, though their numbers are in order";
        WrongImage = 26, "wrong_image", "one of its images does not belong to the sequence";
        UnexplainedImages = 27, "unexplained_images", "its images fit no sequence of the pattern steps";
        Thinned = 28, "thinned", "the stage was busy with an earlier one and then took a newer one";
        NotTracked = 29, "not_tracked", "the cloud was not found on the model";
        Beginning = 30, "beginning", "its session has just started, so its window is not complete";
        Skewed = 31, "skewed", "the cameras exposed farther apart than cameras.max_skew_us";
    }
}

/// Maximum number of drop reasons in a report.
const REASONS: usize = 64;
/// Maximum number of kinds of incidents in a report.
const INCIDENTS: usize = 16;

/// Items of a stage since the start of the instance: `taken = passed + Σ dropped + in work`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Counts.3")]
pub struct Counts {
    /// Items that the previous stage passed on, including those lost in between.
    pub taken: u64,
    /// Items passed on.
    pub passed: u64,
    /// Items dropped, by [`DropReason`].
    pub dropped: [u64; REASONS],
    /// Incidents, by [`Incident`].
    pub incidents: [u64; INCIDENTS],
}

/// Delay of the images of camera 2 after those of camera 1, over some pairs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Skew.1")]
pub struct Skew {
    /// Number of pairs.
    pub pairs: u64,
    /// Sum over the pairs, nanoseconds.
    pub sum_ns: i64,
    /// Minimum, nanoseconds.
    pub least_ns: i64,
    /// Maximum, nanoseconds.
    pub greatest_ns: i64,
}

/// Counts of one stage, and the times of the item that it finished last.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.StageReport.6")]
pub struct StageReport {
    /// [`Stage`].
    pub stage: u32,
    /// Process ID of the service.
    pub pid: u32,
    /// Restarts of the service in this instance.
    pub restarts: u32,
    /// 1 if the report is about an item just finished, 0 if it is a heartbeat.
    pub of_item: u32,
    /// Time of the report.
    pub time_ns: u64,
    /// Start of the (last) exposure of the item.
    pub exposure_start_ns: u64,
    /// Arrival of the (last) image of the item on this machine.
    pub received_ns: u64,
    /// When the stage took the item.
    pub taken_ns: u64,
    /// When the stage passed it on.
    pub passed_ns: u64,
    /// How long the stage worked on it, without waiting for windows before it or for the next stage. Not recorded, like
    /// the next three.
    pub work_ns: u64,
    /// CPU time of the process until now, all its stages together.
    pub cpu_ns: u64,
    /// Number of processors that the instance may use.
    pub processors: u64,
    /// Number of items that the stage may have in work at once.
    pub at_once: u64,
    /// Counts since the start of the instance.
    pub counts: Counts,
    /// Skew of the pairs since the previous report, for the stage that pairs images.
    pub skew: Skew,
}

impl Default for Counts {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl Counts {
    /// Counts one item as dropped.
    pub fn drop_one(&mut self, reason: DropReason) {
        self.drop_many(reason, 1);
    }

    /// Counts items as dropped.
    pub fn drop_many(&mut self, reason: DropReason, count: u64) {
        self.dropped[reason as usize] += count;
    }

    /// Returns the sum of two counts.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            taken: self.taken + other.taken,
            passed: self.passed + other.passed,
            dropped: std::array::from_fn(|reason| self.dropped[reason] + other.dropped[reason]),
            incidents: std::array::from_fn(|incident| self.incidents[incident] + other.incidents[incident]),
        }
    }

    /// Counts incidents of one kind.
    pub fn note(&mut self, incident: Incident, count: u64) {
        self.incidents[incident as usize] += count;
    }

    /// Items dropped because their images do not show the declared phase shifts.
    #[must_use]
    pub fn dropped_for_images(&self) -> u64 {
        use DropReason::{HiddenDuplicate, HiddenLoss, HiddenSwap, UnexplainedImages, WrongImage};
        let reasons = [HiddenLoss, HiddenDuplicate, HiddenSwap, WrongImage, UnexplainedImages];
        reasons.into_iter().map(|reason| self.dropped(reason)).sum()
    }

    /// Items dropped for one reason.
    #[must_use]
    pub fn dropped(&self, reason: DropReason) -> u64 {
        self.dropped[reason as usize]
    }

    /// The reasons that occurred and are losses, with their counts.
    pub fn losses(&self) -> impl Iterator<Item = (DropReason, u64)> + '_ {
        self.reasons().filter(|(reason, _)| reason.is_loss())
    }

    /// Items dropped for any reason.
    #[must_use]
    pub fn all_dropped(&self) -> u64 {
        self.dropped.iter().sum()
    }

    /// Items taken that are neither passed on nor dropped; `None` if their number would be negative.
    #[must_use]
    pub fn in_work(&self) -> Option<u64> {
        self.taken.checked_sub(self.passed)?.checked_sub(self.all_dropped())
    }

    /// The incidents that occurred, with their counts.
    pub fn incidents(&self) -> impl Iterator<Item = (Incident, u64)> + '_ {
        let count = |incident: Incident| self.incidents[incident as usize];
        Incident::ALL.into_iter().map(move |incident| (incident, count(incident))).filter(|&(_, n)| n > 0)
    }

    /// The reasons that occurred, with their counts.
    pub fn reasons(&self) -> impl Iterator<Item = (DropReason, u64)> + '_ {
        DropReason::ALL.into_iter().map(|reason| (reason, self.dropped(reason))).filter(|&(_, n)| n > 0)
    }
}

impl Skew {
    /// Adds the skew of a pair.
    pub fn add(&mut self, skew_ns: i64) {
        self.join(&Self { pairs: 1, sum_ns: skew_ns, least_ns: skew_ns, greatest_ns: skew_ns });
    }

    /// Adds the skew of other pairs.
    pub fn join(&mut self, other: &Self) {
        *self = match (self.pairs, other.pairs) {
            (_, 0) => *self,
            (0, _) => *other,
            _ => Self {
                pairs: self.pairs.saturating_add(other.pairs),
                sum_ns: self.sum_ns.saturating_add(other.sum_ns),
                least_ns: self.least_ns.min(other.least_ns),
                greatest_ns: self.greatest_ns.max(other.greatest_ns),
            },
        };
    }

    /// Mean over the pairs, nanoseconds; `None` without a pair.
    #[must_use]
    pub fn mean_ns(&self) -> Option<f64> {
        (self.pairs > 0).then(|| self.sum_ns as f64 / self.pairs as f64)
    }
}

/// What it means that an item was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DropMeaning {
    /// Something is missing that should be there.
    Loss,
    /// The configuration or the user wants it so; the setting that chooses it.
    Choice(&'static str),
    /// Nothing could be measured, or nothing is missing; what is missing behind it is counted where it was lost.
    Unmeasurable,
}

impl DropMeaning {
    /// The setting that chooses it; `None` unless it is a choice.
    #[must_use]
    pub fn setting(self) -> Option<&'static str> {
        match self {
            Self::Choice(setting) => Some(setting),
            Self::Loss | Self::Unmeasurable => None,
        }
    }
}

impl DropReason {
    /// What the reason means.
    #[must_use]
    pub fn drop_meaning(self) -> DropMeaning {
        match self {
            Self::BetweenWindows => DropMeaning::Choice("window.every"),
            Self::NextStageBusy | Self::Thinned => DropMeaning::Choice("window.when_busy"),
            Self::NotRecording => DropMeaning::Choice("recorder.from_start"),
            Self::Injected => DropMeaning::Choice("virtual_scanner.faults"),
            Self::Stopped => DropMeaning::Choice("the end of the run"),
            Self::Duplicate
            | Self::Incomplete
            | Self::NoCorrespondence
            | Self::EmptyCloud
            | Self::NotTracked
            | Self::Beginning => DropMeaning::Unmeasurable,
            Self::Overrun
            | Self::CameraLost
            | Self::Late
            | Self::Unpaired
            | Self::NoPattern
            | Self::PatternConflict
            | Self::NewSession
            | Self::BadImage
            | Self::BadTime
            | Self::QueueFull
            | Self::DiskFull
            | Self::Restart
            | Self::NoSample
            | Self::Malformed
            | Self::HiddenLoss
            | Self::HiddenDuplicate
            | Self::HiddenSwap
            | Self::WrongImage
            | Self::UnexplainedImages
            | Self::Skewed => DropMeaning::Loss,
        }
    }

    /// Whether the reason is a loss: something that should not happen.
    #[must_use]
    pub fn is_loss(self) -> bool {
        self.drop_meaning() == DropMeaning::Loss
    }
}

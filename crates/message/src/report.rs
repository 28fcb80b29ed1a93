//! What a stage has done: counts that add up, and the times of its last item.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use super::Incident;

/// A stage of the pipeline, and what it counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
pub enum Stage {
    /// Camera 1 and its capture: images.
    Camera1 = 0,
    /// Camera 2 and its capture: images.
    Camera2 = 1,
    /// The projector driver: pattern events.
    Projector = 2,
    /// Pattern events as the pipeline takes them: those that gave an image pair its step.
    Pattern = 3,
    /// Images of both cameras, paired and given their step.
    Pairing = 4,
    /// Image pairs, each the last of a complete window.
    Windowing = 5,
    /// Windows, decoded to phase maps.
    Phase = 6,
    /// Phase maps, searched for correspondences.
    Correspondence = 7,
    /// Correspondences, triangulated to clouds.
    Cloud = 8,
    /// Messages of all channels, written to a recording.
    Recorder = 9,
    /// Clouds, registered to the model that they make.
    Tracking = 10,
}

/// Why an item did not reach the end of its stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
pub enum DropReason {
    /// Overwritten in the channel before this stage took it: the stage is too slow.
    Overrun = 0,
    /// The camera or its driver lost it.
    CameraLost = 1,
    /// It came twice.
    Duplicate = 2,
    /// It came after its place in the order had passed.
    Late = 3,
    /// The other camera has no image of the same exposure.
    Unpaired = 4,
    /// No pattern event belongs to its exposure.
    NoPattern = 5,
    /// Its pattern event, or its place in the cycle, contradicts what came before.
    PatternConflict = 6,
    /// Its camera or projector started anew before its window was complete.
    NewSession = 7,
    /// Its size, format or flags are not those of the rig.
    BadImage = 8,
    /// Its time stamp cannot be.
    BadTime = 9,
    /// An image before it is missing, so its window is not complete.
    Incomplete = 10,
    /// Its window was not wanted: windows are further apart than image pairs.
    BetweenWindows = 11,
    /// The next stage still worked on an earlier one.
    NextStageBusy = 12,
    /// The images hold no measurable correspondence, or contradict the calibration.
    NoCorrespondence = 13,
    /// No point was found.
    EmptyCloud = 14,
    /// The queue to the disk was full.
    QueueFull = 15,
    /// The disk was full, or as full as the configuration lets it become.
    DiskFull = 16,
    /// No recording was running.
    NotRecording = 17,
    /// The service died while it worked on it.
    Restart = 18,
    /// The run ended before its turn came.
    Stopped = 19,
    /// No free sample was left in the channel.
    NoSample = 20,
    /// The message contradicts itself.
    Malformed = 21,
    /// Left out on purpose: a fault that the configuration asks of the virtual scanner.
    Injected = 22,
    /// By its images one of them was lost, which no number told.
    HiddenLoss = 23,
    /// By its images one of them came twice, which no number told.
    HiddenDuplicate = 24,
    /// By its images two of them were exchanged, which no number told.
    HiddenSwap = 25,
    /// One of its images shows something else.
    WrongImage = 26,
    /// Its images fit no sequence of the pattern steps.
    UnexplainedImages = 27,
    /// The stage worked on an earlier one and took a newer one afterwards.
    Thinned = 28,
    /// A cloud that was not found on the model.
    NotTracked = 29,
    /// Its session has only begun, so its window is not complete.
    Beginning = 30,
}

/// Number of drop reasons that a report has room for.
const REASONS: usize = 32;
/// Number of kinds of incidents that a report has room for.
const INCIDENTS: usize = 16;

/// Items of a stage since the start of the instance: `taken = passed + Σ dropped + in work`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Counts.2")]
pub struct Counts {
    /// Items that the stage before had put out, those lost on the way included.
    pub taken: u64,
    /// Items that it put out.
    pub passed: u64,
    /// Items that it dropped, by [`DropReason`].
    pub dropped: [u64; REASONS],
    /// What happened beside the items, by [`Incident`].
    pub incidents: [u64; INCIDENTS],
}

/// By how much the images of camera 2 began later than those of camera 1, over some pairs.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Skew.1")]
pub struct Skew {
    /// Number of pairs.
    pub pairs: u64,
    /// Sum over them, nanoseconds.
    pub sum_ns: i64,
    /// Least.
    pub least_ns: i64,
    /// Greatest.
    pub greatest_ns: i64,
}

/// One stage's counts, and the times of the item that it finished last.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.StageReport.3")]
pub struct StageReport {
    /// [`Stage`].
    pub stage: u32,
    /// Process that reports.
    pub pid: u32,
    /// How often the service was started in this instance, from 0.
    pub restarts: u32,
    /// 1 if the report is about an item just finished, 0 if it is a sign of life.
    pub of_item: u32,
    /// When the report was made.
    pub time_ns: u64,
    /// Start of the (last) exposure of the item.
    pub exposure_start_ns: u64,
    /// When the (last) image of the item had reached this machine.
    pub received_ns: u64,
    /// When the stage took the item.
    pub taken_ns: u64,
    /// When it put it out.
    pub passed_ns: u64,
    /// Counts since the start of the instance.
    pub counts: Counts,
    /// Of the pairs since the report before, where the stage pairs images.
    pub skew: Skew,
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

    /// These counts and others together.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            taken: self.taken + other.taken,
            passed: self.passed + other.passed,
            dropped: std::array::from_fn(|reason| self.dropped[reason] + other.dropped[reason]),
            incidents: std::array::from_fn(|incident| self.incidents[incident] + other.incidents[incident]),
        }
    }

    /// Counts incidents of a kind.
    pub fn note(&mut self, incident: Incident, count: u64) {
        self.incidents[incident as usize] += count;
    }

    /// Items dropped since their images do not show what is said of them.
    #[must_use]
    pub fn dropped_for_images(&self) -> u64 {
        DropReason::OF_IMAGES.iter().map(|&reason| self.dropped(reason)).sum()
    }

    /// Items dropped for one reason.
    #[must_use]
    pub fn dropped(&self, reason: DropReason) -> u64 {
        self.dropped[reason as usize]
    }

    /// The losses that occurred, with their numbers.
    pub fn losses(&self) -> impl Iterator<Item = (DropReason, u64)> + '_ {
        self.reasons().filter(|(reason, _)| reason.is_loss())
    }

    /// Items dropped for any reason.
    #[must_use]
    pub fn all_dropped(&self) -> u64 {
        self.dropped.iter().sum()
    }

    /// Items taken and neither passed nor dropped; `None` where more left than came.
    #[must_use]
    pub fn in_work(&self) -> Option<u64> {
        self.taken.checked_sub(self.passed)?.checked_sub(self.all_dropped())
    }

    /// The incidents that occurred, with their numbers.
    pub fn incidents(&self) -> impl Iterator<Item = (Incident, u64)> + '_ {
        let count = |incident: Incident| self.incidents[incident as usize];
        Incident::ALL.into_iter().map(move |incident| (incident, count(incident))).filter(|&(_, n)| n > 0)
    }

    /// The reasons that occurred, with their numbers.
    pub fn reasons(&self) -> impl Iterator<Item = (DropReason, u64)> + '_ {
        DropReason::ALL.into_iter().map(|reason| (reason, self.dropped(reason))).filter(|&(_, n)| n > 0)
    }
}

impl Skew {
    /// Takes the skew of a pair.
    pub fn add(&mut self, skew_ns: i64) {
        self.join(&Self { pairs: 1, sum_ns: skew_ns, least_ns: skew_ns, greatest_ns: skew_ns });
    }

    /// Takes other pairs.
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

impl Stage {
    /// All stages, in the order of the pipeline; what stands beside it last.
    pub const ALL: [Self; 11] = [
        Self::Camera1,
        Self::Camera2,
        Self::Projector,
        Self::Pattern,
        Self::Pairing,
        Self::Windowing,
        Self::Phase,
        Self::Correspondence,
        Self::Cloud,
        Self::Recorder,
        Self::Tracking,
    ];

    /// The stage of a report; `None` for a number that is none.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|stage| *stage as u32 == code)
    }

    /// Name in reports, metrics and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Camera1 => "camera1",
            Self::Camera2 => "camera2",
            Self::Projector => "projector",
            Self::Pattern => "pattern",
            Self::Pairing => "pairing",
            Self::Windowing => "windowing",
            Self::Phase => "phase",
            Self::Correspondence => "correspondence",
            Self::Cloud => "cloud",
            Self::Recorder => "recorder",
            Self::Tracking => "tracking",
        }
    }
}

impl DropReason {
    /// All reasons.
    pub const ALL: [Self; 31] = [
        Self::Overrun,
        Self::CameraLost,
        Self::Duplicate,
        Self::Late,
        Self::Unpaired,
        Self::NoPattern,
        Self::PatternConflict,
        Self::NewSession,
        Self::BadImage,
        Self::BadTime,
        Self::Incomplete,
        Self::BetweenWindows,
        Self::NextStageBusy,
        Self::NoCorrespondence,
        Self::EmptyCloud,
        Self::QueueFull,
        Self::DiskFull,
        Self::NotRecording,
        Self::Restart,
        Self::Stopped,
        Self::NoSample,
        Self::Malformed,
        Self::Injected,
        Self::HiddenLoss,
        Self::HiddenDuplicate,
        Self::HiddenSwap,
        Self::WrongImage,
        Self::UnexplainedImages,
        Self::Thinned,
        Self::NotTracked,
        Self::Beginning,
    ];

    /// Reasons that tell of a window by its images: they do not show the steps that are said of them.
    pub const OF_IMAGES: [Self; 5] =
        [Self::HiddenLoss, Self::HiddenDuplicate, Self::HiddenSwap, Self::WrongImage, Self::UnexplainedImages];

    /// Whether something was lost that should not have been; the others are decisions, or say that there was nothing to see.
    #[must_use]
    pub fn is_loss(self) -> bool {
        match self {
            Self::Duplicate
            | Self::Incomplete
            | Self::BetweenWindows
            | Self::NextStageBusy
            | Self::NoCorrespondence
            | Self::EmptyCloud
            | Self::NotRecording
            | Self::Stopped
            | Self::Injected
            | Self::Thinned
            | Self::NotTracked
            | Self::Beginning => false,
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
            | Self::UnexplainedImages => true,
        }
    }

    /// Name in reports, metrics and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Overrun => "overrun",
            Self::CameraLost => "camera_lost",
            Self::Duplicate => "duplicate",
            Self::Late => "late",
            Self::Unpaired => "unpaired",
            Self::NoPattern => "no_pattern",
            Self::PatternConflict => "pattern_conflict",
            Self::NewSession => "new_session",
            Self::BadImage => "bad_image",
            Self::BadTime => "bad_time",
            Self::Incomplete => "incomplete",
            Self::BetweenWindows => "between_windows",
            Self::NextStageBusy => "next_stage_busy",
            Self::NoCorrespondence => "no_correspondence",
            Self::EmptyCloud => "empty_cloud",
            Self::QueueFull => "queue_full",
            Self::DiskFull => "disk_full",
            Self::NotRecording => "not_recording",
            Self::Restart => "restart",
            Self::Stopped => "stopped",
            Self::NoSample => "no_sample",
            Self::Malformed => "malformed",
            Self::Injected => "injected",
            Self::HiddenLoss => "hidden_loss",
            Self::HiddenDuplicate => "hidden_duplicate",
            Self::HiddenSwap => "hidden_swap",
            Self::WrongImage => "wrong_image",
            Self::UnexplainedImages => "unexplained_images",
            Self::Thinned => "thinned",
            Self::NotTracked => "not_tracked",
            Self::Beginning => "beginning",
        }
    }
}

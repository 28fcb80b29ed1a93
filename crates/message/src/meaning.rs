//! What the names of reasons and incidents mean, for readers who do not know the pipeline by heart.

use super::{DropReason, Incident};

impl DropReason {
    /// Why an item did not reach the end of its stage.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Overrun => "overwritten in the channel before the stage took it",
            Self::CameraLost => "lost by the camera or its driver",
            Self::Duplicate => "came twice",
            Self::Late => "came after its place in the order had passed",
            Self::Unpaired => "the other camera has no image of the same exposure",
            Self::NoPattern => "no pattern event belongs to its exposure",
            Self::PatternConflict => "its pattern contradicts what came before",
            Self::NewSession => "camera or projector started anew before its window was complete",
            Self::BadImage => "size, format or flags are not those of the rig",
            Self::BadTime => "its time stamp cannot be",
            Self::Incomplete => "an image before it is missing, so its window is not complete",
            Self::BetweenWindows => "windows are further apart than image pairs",
            Self::NextStageBusy => "the next stage still worked on an earlier one",
            Self::NoCorrespondence => "no measurable correspondence in the images",
            Self::EmptyCloud => "no point was found",
            Self::QueueFull => "the queue to the disk was full",
            Self::DiskFull => "no room left on the disk",
            Self::NotRecording => "no recording was running",
            Self::Restart => "the service died while it worked on it, or was not there",
            Self::Stopped => "the run ended before its turn came",
            Self::NoSample => "no free sample was left in the channel",
            Self::Malformed => "the message contradicts itself",
            Self::Injected => "a fault that the configuration asks of the virtual scanner",
            Self::HiddenLoss => "its images tell of one that was lost, though no number did",
            Self::HiddenDuplicate => "its images tell of one that came twice, though no number did",
            Self::HiddenSwap => "its images tell of two that are exchanged, though no number did",
            Self::WrongImage => "one of its images shows something else",
            Self::UnexplainedImages => "its images fit no sequence of the pattern steps",
            Self::Thinned => "the stage worked on an earlier one and took a newer one afterwards",
            Self::NotTracked => "the cloud was not found on the model",
            Self::Beginning => "its session has only begun, so its window is not complete",
        }
    }
}

impl Incident {
    /// What happened beside the items.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::TimeOut => "no image for longer than the time-out",
            Self::Interrupted => "a signal cut a call short; it was made again",
            Self::CallRefused => "the driver refused a call",
            Self::StreamRestart => "the stream was stopped and begun anew",
            Self::Unplugged => "the camera was unplugged",
            Self::Returned => "the camera was there again",
            Self::NumberingRestart => "the driver's numbers began anew",
            Self::StampAhead => "a time stamp lay after the arrival of its image",
            Self::StampJump => "time stamps ran back, or are of no known clock",
        }
    }
}

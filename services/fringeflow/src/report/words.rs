//! What the names of reasons and incidents mean, for readers who do not know the pipeline by heart.

use fringeflow::message::{DropReason, Incident};

/// Why an item did not reach the end of its stage.
pub(super) fn of_reason(reason: DropReason) -> &'static str {
    match reason {
        DropReason::Overrun => "overwritten in the channel before the stage took it",
        DropReason::CameraLost => "lost by the camera or its driver",
        DropReason::Duplicate => "came twice",
        DropReason::Late => "came after its place in the order had passed",
        DropReason::Unpaired => "the other camera has no image of the same exposure",
        DropReason::NoPattern => "no pattern event belongs to its exposure",
        DropReason::PatternConflict => "its pattern contradicts what came before",
        DropReason::NewSession => "camera or projector started anew before its window was complete",
        DropReason::BadImage => "size, format or flags are not those of the rig",
        DropReason::BadTime => "its time stamp cannot be",
        DropReason::Incomplete => "an image before it is missing, so its window is not complete",
        DropReason::BetweenWindows => "windows are further apart than image pairs",
        DropReason::NextStageBusy => "the next stage still worked on an earlier one",
        DropReason::NoCorrespondence => "no measurable correspondence in the images",
        DropReason::EmptyCloud => "no point was found",
        DropReason::QueueFull => "the queue to the disk was full",
        DropReason::DiskFull => "no room left on the disk",
        DropReason::NotRecording => "no recording was running",
        DropReason::Restart => "the service died while it worked on it, or was not there",
        DropReason::Stopped => "the run ended before its turn came",
        DropReason::NoSample => "no free sample was left in the channel",
        DropReason::Malformed => "the message contradicts itself",
        DropReason::Injected => "a fault that the configuration asks of the virtual scanner",
    }
}

/// What happened beside the items.
pub(super) fn of_incident(incident: Incident) -> &'static str {
    match incident {
        Incident::TimeOut => "no image for longer than the time-out",
        Incident::Interrupted => "a signal cut a call short; it was made again",
        Incident::CallRefused => "the driver refused a call",
        Incident::StreamRestart => "the stream was stopped and begun anew",
        Incident::Unplugged => "the camera was unplugged",
        Incident::Returned => "the camera was there again",
        Incident::NumberingRestart => "the driver's numbers began anew",
        Incident::StampAhead => "a time stamp lay after the arrival of its image",
        Incident::StampJump => "time stamps ran back, or are of no known clock",
    }
}

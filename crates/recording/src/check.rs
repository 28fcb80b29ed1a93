//! Checks a recording: reads every message and compares it with the others.
//!
//! Opening a recording already checks checksums, counts and headers. This module checks the content.

use serde::Serialize;

use fringeflow::cloud::{CloudPoint, read_records};
use fringeflow_message::{CloudHeader, PatternEvent};

use crate::{Content, Losses, Message, Recording, RecordingError, Topic};

/// Maximum number of described faults. Further faults are only counted.
const MAX_DESCRIBED_FAULTS: usize = 20;

/// Result of a check.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Check {
    /// Messages, without headers.
    pub messages: u64,
    /// What was lost.
    #[serde(flatten)]
    pub losses: Losses,
    /// Images of camera 1 and 2 with a repeated number.
    pub repeated_images: [u64; 2],
    /// Number of clouds.
    pub clouds: u64,
    /// Faults: numbers that are not finite, messages that contradict themselves. At most twenty are described.
    pub faults: Vec<String>,
    /// Number of faults.
    pub fault_count: u64,
}

impl Check {
    fn add_fault(&mut self, what: String) {
        self.fault_count += 1;
        if self.faults.len() < MAX_DESCRIBED_FAULTS {
            self.faults.push(what);
        }
    }
}

impl Recording {
    /// Reads every message and compares it with the others. Calls `progress` for each message.
    ///
    /// # Errors
    /// The file can no longer be read. Faults in its content are part of the result.
    pub fn check(&self, mut progress: impl FnMut()) -> Result<Check, RecordingError> {
        let (losses, repeated_images) = (self.losses()?, self.numbering()?.repeated_images);
        let mut check = Check { losses, repeated_images, ..Check::default() };
        for message in self.messages() {
            progress();
            check.messages += 1;
            match message {
                Ok(message) => check_message(&message, &mut check),
                Err(error) if error.problem.is_content() => check.add_fault(error.problem.to_string()),
                Err(error) => return Err(error),
            }
        }
        Ok(check)
    }

    /// Whether the recording contains all images of a cloud.
    pub(super) fn has_window(&self, header: &CloudHeader) -> bool {
        let window = &header.window;
        window.pairs().all(|[first, second]| {
            self.has_image(1, window.cam1_session, first) && self.has_image(2, window.cam2_session, second)
        })
    }
}

fn check_message(message: &Message, check: &mut Check) {
    match &message.content {
        Content::Pattern(event) => {
            if let Some(what) = pattern_fault(event) {
                check.add_fault(format!("topic {}, pattern {}: {what}", Topic::Pattern.name(), event.sequence));
            }
        }
        Content::Cloud(header, records) => {
            check.clouds += 1;
            if let Some(what) = cloud_fault(header, records) {
                check.add_fault(format!("topic {}, cloud {}: {what}", Topic::Cloud.name(), header.published));
            }
        }
        _ => {}
    }
}

fn pattern_fault(event: &PatternEvent) -> Option<String> {
    if !event.period_px.is_finite() {
        return Some(format!("field period_px is {}; expected a finite number", event.period_px));
    }
    (event.step >= event.steps)
        .then(|| format!("field step is {}; expected less than steps, {}", event.step, event.steps))
}

fn cloud_fault(header: &CloudHeader, records: &[u8]) -> Option<String> {
    let figures = [("delta_mean_rad", header.delta_mean_rad), ("delta_sd_rad", header.delta_sd_rad)];
    if let Some((field, value)) = figures.into_iter().find(|(_, value)| !value.is_finite()) {
        return Some(format!("field {field} is {value}; expected a finite number"));
    }
    let is_finite = |point: &CloudPoint| {
        let numbers = [point.cam2_px[0], point.cam2_px[1], point.delta_rad, point.sigma_m, point.confidence];
        point.position_m.iter().chain(&numbers).all(|number| number.is_finite())
    };
    let index = read_records(records)?.iter().position(|point| !is_finite(point))?;
    Some(format!("point {index} has a number that is not finite"))
}

//! Checks a recording: reads every message and compares it with the others.
//!
//! Opening a recording already checks checksums, counts and headers. This module checks the content.

use std::collections::BTreeMap;

use serde::Serialize;

use fringeflow::cloud::{CloudPoint, read_records};
use fringeflow_message::{CloudHeader, PatternEvent};

use crate::{Content, Message, Recording, RecordingError, Topic};

/// Maximum number of described faults. Further faults are only counted.
const MAX_DESCRIBED_FAULTS: usize = 20;

/// Result of a check.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Check {
    /// Messages, without headers.
    pub messages: u64,
    /// Gaps in the sequence numbers of camera 1 and 2: missing images.
    pub missing_images: [u64; 2],
    /// Images of camera 1 and 2 with a repeated number.
    pub repeated_images: [u64; 2],
    /// Gaps in the numbers of the pattern events: missing events.
    pub missing_patterns: u64,
    /// Number of clouds.
    pub clouds: u64,
    /// Clouds with a missing image, although their window started within the recording.
    pub clouds_without_images: u64,
    /// Messages that the recorder lost; `None` if unknown.
    pub lost: Option<u64>,
    /// Faults: numbers that are not finite, messages that contradict themselves. At most twenty are described.
    pub faults: Vec<String>,
    /// Number of faults.
    pub fault_count: u64,
}

impl Check {
    /// Whether messages that were sent are missing.
    #[must_use]
    pub fn has_losses(&self) -> bool {
        self.lost != Some(0)
            || self.missing_images != [0, 0]
            || self.missing_patterns > 0
            || self.clouds_without_images > 0
    }

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
        let mut check = Check { lost: self.lost_messages(), ..Check::default() };
        let mut patterns: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
        for message in self.messages() {
            progress();
            check.messages += 1;
            match message {
                Ok(message) => self.check_message(&message, &mut check, &mut patterns),
                Err(error) if error.problem.is_content() => check.add_fault(error.problem.to_string()),
                Err(error) => return Err(error),
            }
        }
        check.missing_patterns =
            patterns.into_values().fold(0, |sum: u64, numbers| sum.saturating_add(gaps(numbers).0));
        for (camera, i) in [(1, 0), (2, 1)] {
            let mut sessions: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
            for header in self.frame_headers(camera) {
                sessions.entry(header.session).or_default().push(header.sequence);
            }
            for numbers in sessions.into_values() {
                let (missing, repeated) = gaps(numbers);
                check.missing_images[i] = check.missing_images[i].saturating_add(missing);
                check.repeated_images[i] += repeated;
            }
        }
        Ok(check)
    }

    fn check_message(&self, message: &Message, check: &mut Check, patterns: &mut BTreeMap<u64, Vec<u64>>) {
        match &message.content {
            Content::Pattern(event) => {
                patterns.entry(event.session).or_default().push(event.sequence);
                if let Some(what) = pattern_fault(event) {
                    check.add_fault(format!("topic {}, pattern {}: {what}", Topic::Pattern.name(), event.sequence));
                }
            }
            Content::Cloud(header, records) => {
                check.clouds += 1;
                if !self.has_window(header) && !self.begins_after(&header.window) {
                    check.clouds_without_images += 1;
                }
                if let Some(what) = cloud_fault(header, records) {
                    check.add_fault(format!("topic {}, cloud {}: {what}", Topic::Cloud.name(), header.published));
                }
            }
            _ => {}
        }
    }

    /// Whether the recording contains all images of a cloud.
    fn has_window(&self, header: &CloudHeader) -> bool {
        let window = &header.window;
        window.pairs().all(|[first, second]| {
            self.has_image(1, window.cam1_session, first) && self.has_image(2, window.cam2_session, second)
        })
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

/// Returns the number of gaps in the numbers, and the number of repetitions.
fn gaps(mut numbers: Vec<u64>) -> (u64, u64) {
    numbers.sort_unstable();
    let all = numbers.len() as u64;
    numbers.dedup();
    let distinct = numbers.len() as u64;
    let span = numbers.last().zip(numbers.first()).map_or(0, |(last, first)| (last - first).saturating_add(1));
    (span.saturating_sub(distinct), all - distinct)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_repetitions_are_counted() {
        assert_eq!(gaps(vec![]), (0, 0));
        assert_eq!(gaps(vec![7, 5, 9, 9, 6]), (1, 1));
        assert_eq!(gaps(vec![0, u64::MAX]), (u64::MAX - 2, 0));
    }
}

//! Checking a recording: every message is read, and compared with what the others say.
//!
//! Opening compares checksums, counts and pairs of headers and payloads; here the content follows.

use std::collections::BTreeMap;

use serde::Serialize;

use fringeflow::cloud::{CloudPoint, read_records};
use fringeflow_message::{CloudHeader, PatternEvent};

use super::content::{Content, Message};
use super::error::RecordingError;
use super::{Recording, Topic};

/// Most faults that are described; the rest is counted.
const MOST_FAULTS: usize = 20;

/// What a check found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Check {
    /// Messages read, headers not counted.
    pub messages: u64,
    /// Images of camera 1 and 2 that are missing between others by the numbers of their driver.
    pub missing_images: [u64; 2],
    /// Images of camera 1 and 2 that have the number of another one.
    pub repeated_images: [u64; 2],
    /// Pattern events that are missing between others.
    pub missing_patterns: u64,
    /// Clouds.
    pub clouds: u64,
    /// Clouds of whose images at least one is not in the recording, though it had begun.
    pub clouds_without_images: u64,
    /// Messages that the recorder lost; `None` if it did not say.
    pub lost: Option<u64>,
    /// What cannot be: numbers that are not finite, messages that contradict themselves. Described at most twenty times.
    pub faults: Vec<String>,
    /// Number of faults.
    pub fault_count: u64,
}

impl Check {
    /// Whether something is missing that was sent.
    #[must_use]
    pub fn has_losses(&self) -> bool {
        self.lost != Some(0)
            || self.missing_images != [0, 0]
            || self.missing_patterns > 0
            || self.clouds_without_images > 0
    }

    fn fault(&mut self, what: String) {
        self.fault_count += 1;
        if self.faults.len() < MOST_FAULTS {
            self.faults.push(what);
        }
    }
}

impl Recording {
    /// Reads every message and compares.
    ///
    /// # Errors
    /// The file cannot be read any more; faults in it are part of the result.
    pub fn check(&self, mut progress: impl FnMut()) -> Result<Check, RecordingError> {
        let mut check = Check { lost: self.lost(), ..Check::default() };
        let mut patterns: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
        for message in self.messages() {
            progress();
            check.messages += 1;
            match message {
                Ok(message) => self.check_message(&message, &mut check, &mut patterns),
                Err(error) if error.problem.is_content() => check.fault(error.problem.to_string()),
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
                    check.fault(format!("topic {}, pattern {}: {what}", Topic::Pattern.name(), event.sequence));
                }
            }
            Content::Cloud(header, records) => {
                check.clouds += 1;
                if !self.has_window(header) && !self.begins_after(&header.window) {
                    check.clouds_without_images += 1;
                }
                if let Some(what) = cloud_fault(header, records) {
                    check.fault(format!("topic {}, cloud {}: {what}", Topic::Cloud.name(), header.published));
                }
            }
            _ => {}
        }
    }

    /// Whether all images of a cloud are there.
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
    let place = read_records(records)?.iter().position(|point| !is_finite(point))?;
    Some(format!("point {place} has a number that is not finite"))
}

/// Numbers that are missing between others, and numbers that come again.
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

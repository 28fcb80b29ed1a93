//! Image pairs of a recording, in the order of their exposures, each with the step of its pattern.
//!
//! The live synchronization (`fringeflow_message::synchronization`) has limited memory and drops what contradicts
//! itself. Here the whole recording is known, so every pair that has a step is used, even outside complete windows. In
//! a recording without events, the pairs are counted instead of trusting sequence numbers.

use fringeflow_dataset::{CameraId, GreyImage};
use fringeflow_message::{FrameHeader, PATTERN_FRINGES, PatternEvent};

use crate::{Content, Recording, RecordingError, Topic};

/// Images of both cameras at the same exposure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImagePair {
    /// Image of camera 1.
    pub cam1: FrameHeader,
    /// Image of camera 2.
    pub cam2: FrameHeader,
    /// Step of the phase shift, from 0 to the number of steps of the setup − 1.
    pub step: usize,
}

impl ImagePair {
    /// Time between the starts of both exposures, nanoseconds.
    #[must_use]
    pub fn skew_ns(&self) -> u64 {
        self.cam1.exposure_start_ns.abs_diff(self.cam2.exposure_start_ns)
    }

    /// Whether this pair directly follows `before`: no image is missing in between, and the step is the next one.
    #[must_use]
    pub fn follows(&self, before: &Self, steps: usize) -> bool {
        let images = [(before.cam1, self.cam1), (before.cam2, self.cam2)];
        let is_next = |(a, b): &(FrameHeader, FrameHeader)| {
            a.session == b.session && a.sequence.checked_add(1) == Some(b.sequence)
        };
        images.iter().all(is_next) && self.step == (before.step + 1) % steps.max(1)
    }
}

impl Recording {
    /// Returns all image pairs that have a step. The step comes from the pattern event of the exposure; in a recording
    /// without any events, from the position of the pair.
    ///
    /// # Errors
    /// A pattern event cannot be read.
    pub fn pairs(&self) -> Result<Vec<ImagePair>, RecordingError> {
        let [cam1, cam2] = [1, 2].map(|camera| {
            let mut headers: Vec<FrameHeader> = self.frame_headers(camera).copied().collect();
            headers.sort_by_key(|header| header.exposure_start_ns);
            // A program that joins recordings may have written a message twice.
            headers.dedup();
            headers
        });
        let mut events = self.pattern_events()?;
        events.sort_by_key(|event| event.exposure_start_ns);
        let tolerance_ns = half_period_ns(&cam1);
        let steps = self.setup().steps;
        let mut pairs = Vec::with_capacity(cam1.len());
        let times: Vec<u64> = cam2.iter().map(|header| header.exposure_start_ns).collect();
        let event_times: Vec<u64> = events.iter().map(|event| event.exposure_start_ns).collect();
        for (number, first) in cam1.iter().enumerate() {
            let time_ns = first.exposure_start_ns;
            let Some(second) = nearest(&times, time_ns, tolerance_ns).and_then(|i| cam2.get(i)) else { continue };
            let event = nearest(&event_times, time_ns, tolerance_ns).and_then(|i| events.get(i));
            let step = match event {
                _ if events.is_empty() => Some(number % steps),
                Some(event) => step_of(event, steps),
                None => None,
            };
            pairs.extend(step.map(|step| ImagePair { cam1: *first, cam2: *second, step }));
        }
        Ok(pairs)
    }

    /// Reads the images of one camera of these pairs.
    ///
    /// # Errors
    /// An image cannot be read.
    pub fn pair_images(&self, pairs: &[ImagePair], camera: CameraId) -> Result<Vec<GreyImage>, RecordingError> {
        let header = |pair: &ImagePair| match camera {
            CameraId::Cam1 => pair.cam1,
            CameraId::Cam2 => pair.cam2,
        };
        let image = |header: FrameHeader| self.image(header.camera, header.session, header.sequence);
        pairs.iter().map(|pair| image(header(pair))).collect()
    }

    fn pattern_events(&self) -> Result<Vec<PatternEvent>, RecordingError> {
        let events = self.messages_of(Topic::Pattern).map(|message| match message?.content {
            Content::Pattern(event) => Ok(Some(event)),
            _ => Ok(None),
        });
        events.filter_map(Result::transpose).collect()
    }
}

/// Returns the start indices of complete windows: `images` pairs with consecutive steps and without a missing image.
pub fn window_starts(pairs: &[ImagePair], steps: usize, images: usize) -> impl Iterator<Item = usize> + '_ {
    let is_window = move |window: &[ImagePair]| {
        let mut neighbours = window.iter().zip(window.iter().skip(1));
        neighbours.all(|(before, pair)| pair.follows(before, steps))
    };
    pairs.windows(images.max(1)).enumerate().filter(move |(_, window)| is_window(window)).map(|(start, _)| start)
}

/// Returns the start indices of complete cycles: windows with all steps from 0 on. The cycles share no image.
pub fn cycle_starts(pairs: &[ImagePair], steps: usize) -> impl Iterator<Item = usize> + '_ {
    window_starts(pairs, steps, steps).filter(|&start| pairs.get(start).is_some_and(|pair| pair.step == 0))
}

fn step_of(event: &PatternEvent, steps: usize) -> Option<usize> {
    let step = event.step as usize;
    (event.kind == PATTERN_FRINGES && event.steps as usize == steps && step < steps).then_some(step)
}

/// Returns half of the median time between two exposures.
fn half_period_ns(headers: &[FrameHeader]) -> u64 {
    let mut gaps: Vec<u64> =
        headers.iter().zip(headers.iter().skip(1)).map(|(a, b)| b.exposure_start_ns - a.exposure_start_ns).collect();
    gaps.sort_unstable();
    gaps.get(gaps.len() / 2).map_or(u64::MAX, |median| median / 2)
}

/// Returns the index of the time nearest to `time_ns`, if it is at most `tolerance_ns` away.
fn nearest(sorted: &[u64], time_ns: u64, tolerance_ns: u64) -> Option<usize> {
    let after = sorted.partition_point(|&t| t < time_ns);
    let neighbours = [after.checked_sub(1), Some(after)].into_iter().flatten();
    let distances = neighbours.filter_map(|i| Some((sorted.get(i)?.abs_diff(time_ns), i)));
    distances.min().filter(|(distance, _)| *distance <= tolerance_ns).map(|(_, i)| i)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(sequence: u64, step: usize) -> ImagePair {
        let header = |camera| FrameHeader { camera, sequence, session: 7, ..FrameHeader::default() };
        ImagePair { cam1: header(1), cam2: header(2), step }
    }

    #[test]
    fn the_nearest_time_is_within_the_tolerance() {
        let times = [10, 20, 30];
        assert_eq!(nearest(&times, 14, 5), Some(0));
        assert_eq!(nearest(&times, 16, 5), Some(1));
        assert_eq!(nearest(&times, 36, 5), None);
        assert_eq!(nearest(&[], 0, u64::MAX), None);
    }

    #[test]
    fn a_cycle_has_all_steps_and_no_gap() {
        let whole = [pair(0, 2), pair(1, 0), pair(2, 1), pair(3, 2)];
        let starts = |pairs: &[ImagePair]| cycle_starts(pairs, 3).collect::<Vec<_>>();
        assert_eq!(starts(&whole), [1]);
        let gap = [pair(0, 0), pair(1, 1), pair(3, 2), pair(4, 0), pair(5, 1), pair(6, 2)];
        assert_eq!(starts(&gap), [3]);
        assert_eq!(starts(&gap[..5]), [0_usize; 0]);
        let two: Vec<ImagePair> = (0..7).map(|n| pair(n, n as usize % 3)).collect();
        assert_eq!(starts(&two), [0, 3]);
    }

    #[test]
    fn a_window_may_start_with_any_step() {
        let starts = |pairs: &[ImagePair]| window_starts(pairs, 3, 3).collect::<Vec<_>>();
        let run: Vec<ImagePair> = (0..5).map(|n| pair(n, (n as usize + 1) % 3)).collect();
        assert_eq!(starts(&run), [0, 1, 2]);
        let missing = [run[0], run[1], run[3], run[4]];
        assert_eq!(starts(&missing), [0_usize; 0]);
        let out_of_turn = [pair(0, 0), pair(1, 2), pair(2, 1)];
        assert_eq!(starts(&out_of_turn), [0_usize; 0]);
    }
}

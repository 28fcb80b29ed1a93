//! Compares the clouds of a replay with those of the recording.

use std::collections::HashMap;

use fringeflow_message::{CloudHeader, Window};
use fringeflow_recording::{Content, Recording, RecordingError, Topic, WindowPrior};

/// Comparison of the clouds of a replay with the recorded ones, by window.
#[derive(Debug, Default)]
pub struct Comparison {
    /// Recorded clouds that are not compared yet.
    recorded: HashMap<WindowKey, Vec<u8>>,
    compared: Compared,
}

/// Numbers of compared clouds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Compared {
    /// Clouds with the recorded bytes.
    pub same: u64,
    /// Clouds with other bytes.
    pub different: u64,
    /// Clouds of windows for which the recording has no cloud.
    pub new: u64,
    /// Recorded clouds that the replay has not made.
    pub missing: u64,
}

/// Sessions and numbers of the images of a window.
type WindowKey = ([u64; 2], Vec<[u64; 2]>);

fn window_key(window: &Window) -> WindowKey {
    ([window.cam1_session, window.cam2_session], window.pairs().collect())
}

impl Comparison {
    /// Reads the clouds that can be made again from a recording: it has their images, the pattern events of these, and
    /// the prior that they were made with.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn from_recording(recording: &Recording) -> Result<Self, RecordingError> {
        let mut comparison = Self::default();
        let first_event_ns = first_event_ns(recording)?;
        let priors = recording.priors()?;
        for message in recording.messages_of(Topic::Cloud) {
            if let Content::Cloud(header, records) = message?.content
                && has_all_images(recording, &header.window)
                && priors.used_by(&header.window) != WindowPrior::Missing
                && first_event_ns.is_none_or(|time_ns| has_all_events(&header.window, time_ns))
            {
                comparison.recorded.insert(window_key(&header.window), records.to_vec());
            }
        }
        Ok(comparison)
    }

    /// Compares a cloud.
    pub(crate) fn add(&mut self, header: &CloudHeader, records: &[u8]) {
        match self.recorded.remove(&window_key(&header.window)) {
            Some(recorded) if recorded == records => self.compared.same += 1,
            Some(_) => {
                self.compared.different += 1;
                tracing::error!(centre_ns = header.window.centre_ns, "the cloud of this window differs");
            }
            None => self.compared.new += 1,
        }
    }

    /// Returns the numbers of clouds so far.
    #[must_use]
    pub fn compared(&self) -> Compared {
        Compared { missing: self.recorded.len() as u64, ..self.compared }
    }
}

/// Returns whether all images of a window are in the recording.
fn has_all_images(recording: &Recording, window: &Window) -> bool {
    let has = |[first, second]: [u64; 2]| {
        recording.has_image(1, window.cam1_session, first) && recording.has_image(2, window.cam2_session, second)
    };
    window.pairs().all(has)
}

/// Returns the start of the exposure of the first pattern event; `None` if the recording has no events.
fn first_event_ns(recording: &Recording) -> Result<Option<u64>, RecordingError> {
    let first = recording.messages_of(Topic::Pattern).next().transpose()?;
    Ok(first.and_then(|message| match message.content {
        Content::Pattern(event) => Some(event.exposure_start_ns),
        _ => None,
    }))
}

/// Returns whether a window does not start before the exposure of the first event. A recording that starts during a
/// scan may begin with an image whose event was sent before. An event belongs to the images exposed within half a
/// period.
fn has_all_events(window: &Window, first_ns: u64) -> bool {
    let periods = u64::from(window.images.saturating_sub(1)).max(1);
    let half_period_ns = window.last_exposure_ns.saturating_sub(window.first_exposure_ns) / (2 * periods);
    first_ns < window.first_exposure_ns.saturating_add(half_period_ns)
}

//! Comparing the clouds of a replay with those of the recording.

use std::collections::HashMap;

use fringeflow_message::{CloudHeader, Window};
use fringeflow_recording::{Content, Recording, RecordingError, Topic, WindowPrior};

/// Clouds of a recording, by their windows.
#[derive(Debug, Default)]
pub struct Comparison {
    recorded: HashMap<Key, Vec<u8>>,
    compared: Compared,
}

/// Clouds compared so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Compared {
    /// The same to the last byte.
    pub same: u64,
    /// Others.
    pub different: u64,
    /// Of windows that the recording has no cloud of.
    pub new: u64,
    /// Recorded clouds that have not come.
    pub missing: u64,
}

/// Sessions and numbers of a window's images.
type Key = ([u64; 2], Vec<[u64; 2]>);

fn key(window: &Window) -> Key {
    ([window.cam1_session, window.cam2_session], window.pairs().collect())
}

impl Comparison {
    /// Reads the clouds of a recording that can come again: their images are in it, the announcements of these, and the priors that
    /// they were made with.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn of(recording: &Recording) -> Result<Self, RecordingError> {
        let mut comparison = Self::default();
        let announced_ns = first_announced_ns(recording)?;
        let priors = recording.priors()?;
        for message in recording.messages_of(Topic::Cloud) {
            if let Content::Cloud(header, records) = message?.content
                && is_whole(recording, &header.window)
                && priors.used_by(&header.window) != WindowPrior::Missing
                && announced_ns.is_none_or(|time_ns| is_announced(&header.window, time_ns))
            {
                comparison.recorded.insert(key(&header.window), records.to_vec());
            }
        }
        Ok(comparison)
    }

    /// Compares a cloud.
    pub(crate) fn add(&mut self, header: &CloudHeader, records: &[u8]) {
        match self.recorded.remove(&key(&header.window)) {
            Some(recorded) if recorded == records => self.compared.same += 1,
            Some(_) => {
                self.compared.different += 1;
                tracing::error!(centre_ns = header.window.centre_ns, "the cloud of this window differs");
            }
            None => self.compared.new += 1,
        }
    }

    /// What came of it so far.
    #[must_use]
    pub fn compared(&self) -> Compared {
        Compared { missing: self.recorded.len() as u64, ..self.compared }
    }
}

/// Whether all images of a window are in the recording.
fn is_whole(recording: &Recording, window: &Window) -> bool {
    let has = |[first, second]: [u64; 2]| {
        recording.has_image(1, window.cam1_session, first) && recording.has_image(2, window.cam2_session, second)
    };
    window.pairs().all(has)
}

/// Start of the first exposure that the recording holds the pattern event of; `None` where it has no events.
fn first_announced_ns(recording: &Recording) -> Result<Option<u64>, RecordingError> {
    let first = recording.messages_of(Topic::Pattern).next().transpose()?;
    Ok(first.and_then(|message| match message.content {
        Content::Pattern(event) => Some(event.exposure_start_ns),
        _ => None,
    }))
}

/// Whether a window does not begin before the first exposure announced: a recording that is begun during a scan may hold
/// an image whose event it came too late for. An event belongs to what is exposed within half a period.
fn is_announced(window: &Window, first_ns: u64) -> bool {
    let periods = u64::from(window.images.saturating_sub(1)).max(1);
    let half_period_ns = window.last_exposure_ns.saturating_sub(window.first_exposure_ns) / (2 * periods);
    first_ns < window.first_exposure_ns.saturating_add(half_period_ns)
}

//! Comparing the clouds of a replay with those of the recording.

use std::collections::HashMap;

use fringeflow::message::{CloudHeader, Window};
use fringeflow::recording::{Content, Recording, RecordingError, Topic};

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
    /// Reads the clouds of a recording whose images are all in it.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn of(recording: &Recording) -> Result<Self, RecordingError> {
        let mut comparison = Self::default();
        for message in recording.messages_of(Topic::Cloud) {
            if let Content::Cloud(header, records) = message?.content
                && is_whole(recording, &header.window)
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

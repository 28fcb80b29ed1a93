//! Commands to a running instance, and its state.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use crate::codes::codes;

/// Size of a [`Text`], bytes.
const TEXT_BYTES: usize = 256;

/// A short UTF-8 text, padded with zeros.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Text.1")]
pub struct Text(
    /// The bytes.
    pub [u8; TEXT_BYTES],
);

codes! {
    /// A command to a running instance.
    pub enum Command {
        State = 0, "state", "reports the state";
        Start = 1, "start", "starts cameras and projector";
        Stop = 2, "stop", "stops cameras and projector; the services stay";
        RecordStart = 3, "record_start", "starts a recording; the text names its file, or is empty for a default name";
        RecordStop = 4, "record_stop", "ends the recording";
        Mark = 5, "mark", "writes the text into the recording, with the time";
        Quit = 6, "quit", "ends the instance";
    }
}

/// A request to a running instance.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.ControlRequest.1")]
pub struct ControlRequest {
    /// [`Command`].
    pub command: u32,
    /// Zero.
    pub reserved: u32,
    /// Argument of the command.
    pub text: Text,
}

/// The answer to a request.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.ControlResponse.1")]
pub struct ControlResponse {
    /// 0: done; 1: refused, the text says why.
    pub refused: u32,
    /// Zero.
    pub reserved: u32,
    /// The state after the command.
    pub state: ScanState,
    /// What was done, or why it was refused.
    pub text: Text,
}

/// Target state of the instance. The services follow it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.ScanState.1")]
pub struct ScanState {
    /// Increases with every change.
    pub revision: u64,
    /// 1 while cameras and projector should run.
    pub scanning: u32,
    /// 1 while a recording should run.
    pub recording: u32,
    /// Recordings started so far. A new number is a new recording.
    pub recordings: u64,
    /// Marks set so far.
    pub marks: u64,
    /// File of the recording.
    pub recording_file: Text,
    /// Text of the last mark.
    pub mark: Text,
}

impl Default for Text {
    fn default() -> Self {
        Self([0; TEXT_BYTES])
    }
}

impl Text {
    /// Copies a text. A text that is too long is cut after the last character that fits.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut bytes = [0; TEXT_BYTES];
        let end = (0..=text.len().min(TEXT_BYTES)).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// Returns the text; invalid UTF-8 is replaced.
    #[must_use]
    pub fn to_text(&self) -> String {
        let end = self.0.iter().position(|&b| b == 0).unwrap_or(TEXT_BYTES);
        String::from_utf8_lossy(&self.0[..end]).into_owned()
    }

    /// Whether the whole text fits.
    #[must_use]
    pub fn fits(text: &str) -> bool {
        text.len() <= TEXT_BYTES
    }
}

//! Commands to the instance, and its state.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Bytes of a [`Text`].
const TEXT_BYTES: usize = 256;

/// A short UTF-8 text, padded with zeros.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Text.1")]
pub struct Text(
    /// The bytes.
    pub [u8; TEXT_BYTES],
);

/// What can be asked of a running instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Command {
    /// Tell the state.
    State = 0,
    /// Cameras and projector start.
    Start = 1,
    /// Cameras and projector stop; the services stay.
    Stop = 2,
    /// Start a recording; the text names its file, or is empty for a name made of the time.
    RecordStart = 3,
    /// End the recording.
    RecordStop = 4,
    /// Write the text into the recording, with the time.
    Mark = 5,
    /// End the instance.
    Quit = 6,
}

/// A command.
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

/// What came of a command.
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

/// What the instance is to do; the services follow it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.ScanState.1")]
pub struct ScanState {
    /// Raised with every change.
    pub revision: u64,
    /// 1 while cameras and projector are to run.
    pub scanning: u32,
    /// 1 while a recording is to run.
    pub recording: u32,
    /// Recordings begun so far: tells a new one from the one before.
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
    /// A text, cut at the last character that fits.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut bytes = [0; TEXT_BYTES];
        let end = (0..=text.len().min(TEXT_BYTES)).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self(bytes)
    }

    /// The text; what is no UTF-8 is replaced.
    #[must_use]
    pub fn to_text(&self) -> String {
        let end = self.0.iter().position(|&b| b == 0).unwrap_or(TEXT_BYTES);
        String::from_utf8_lossy(&self.0[..end]).into_owned()
    }

    /// Whether a text of this length survives whole.
    #[must_use]
    pub fn fits(text: &str) -> bool {
        text.len() <= TEXT_BYTES
    }
}

impl Command {
    /// The command of a request; `None` for a number that is none.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        const ALL: [Command; 7] = [
            Command::State,
            Command::Start,
            Command::Stop,
            Command::RecordStart,
            Command::RecordStop,
            Command::Mark,
            Command::Quit,
        ];
        ALL.into_iter().find(|command| *command as u32 == code)
    }
}

//! `fringeflow control`: sends a command to a running instance.

use std::io::Write as _;
use std::path::PathBuf;

use fringeflow_message::{Command, ControlRequest, ControlResponse, Text};
use fringeflow_transport::{Instance, request};

use crate::acting_options::ActingOptions;
use crate::failure::Failure;

use super::status_list::RESPONSE_TIMEOUT;

/// Arguments of `fringeflow control`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Name of the instance, as `fringeflow status` lists it.
    #[arg(value_name = "NAME")]
    instance: String,
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand)]
enum Action {
    /// Start cameras and projector.
    Start,
    /// Stop cameras and projector. The services keep running.
    Stop,
    /// Start a recording.
    Record {
        /// File to write. The default is a name with the time, in the folder that the configuration sets.
        file: Option<PathBuf>,
    },
    /// End the recording.
    EndRecording,
    /// Write a remark into the recording, with the time.
    Mark {
        /// The remark, at most 256 bytes.
        text: String,
    },
    /// End the instance.
    Quit,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&["instance", "file", "text"]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let (command, text) = self.action.command()?;
        if !Text::fits(&text) {
            return Err(Failure::Usage(format!("{text:?} is too long; give at most 256 bytes")));
        }
        let instance = Instance::new(&self.instance)?;
        let command = ControlRequest { command: command as u32, reserved: 0, text: Text::new(&text) };
        let response = request(&instance, &command, RESPONSE_TIMEOUT)?;
        if response.refused != 0 {
            return Err(Failure::Usage(response.text.to_text()));
        }
        Ok(writeln!(std::io::stdout(), "{}: {}", self.instance, self.action.result_text(&response))?)
    }
}

impl Action {
    fn command(&self) -> Result<(Command, String), Failure> {
        let without_text = |command| Ok((command, String::new()));
        match self {
            Self::Start => without_text(Command::Start),
            Self::Stop => without_text(Command::Stop),
            Self::Record { file: None } => without_text(Command::RecordStart),
            // The instance may run in another working directory.
            Self::Record { file: Some(file) } => {
                Ok((Command::RecordStart, std::path::absolute(file)?.to_string_lossy().into_owned()))
            }
            Self::EndRecording => without_text(Command::RecordStop),
            Self::Mark { text } => Ok((Command::Mark, text.clone())),
            Self::Quit => without_text(Command::Quit),
        }
    }

    /// Describes what the instance did, and names the recording if the command is about one.
    fn result_text(&self, response: &ControlResponse) -> String {
        let done = response.text.to_text();
        match self {
            Self::Record { .. } | Self::EndRecording | Self::Mark { .. } => {
                format!("{done} ({})", response.state.recording_file.to_text())
            }
            Self::Start | Self::Stop | Self::Quit => done,
        }
    }
}

//! `fringeflow control`: commands to a running instance.

use std::io::Write as _;
use std::path::PathBuf;

use fringeflow_message::{Command, ControlRequest, ControlResponse, Text};
use fringeflow_transport::{Instance, request};

use crate::failure::Failure;

use super::status::ANSWER;

/// Arguments of `fringeflow control`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Name of the instance, as `fringeflow status` lists it.
    #[arg(value_name = "NAME")]
    instance: String,
    #[command(subcommand)]
    wish: Wish,
}

#[derive(clap::Subcommand)]
enum Wish {
    /// Start cameras and projector.
    Start,
    /// Stop cameras and projector. The services stay.
    Stop,
    /// Start a recording.
    Record {
        /// Its file. By default it is named by the time, in the folder of the configuration.
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

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let (command, text) = self.wish.command()?;
        if !Text::fits(&text) {
            return Err(Failure::Usage(format!("{text:?} is too long; give at most 256 bytes")));
        }
        let instance = Instance::new(&self.instance)?;
        let asked = ControlRequest { command: command as u32, reserved: 0, text: Text::new(&text) };
        let response = request(&instance, &asked, ANSWER)?;
        if response.refused != 0 {
            return Err(Failure::Usage(response.text.to_text()));
        }
        Ok(writeln!(std::io::stdout(), "{}: {}", self.instance, self.wish.answer(&response))?)
    }
}

impl Wish {
    fn command(&self) -> Result<(Command, String), Failure> {
        let plain = |command| Ok((command, String::new()));
        match self {
            Self::Start => plain(Command::Start),
            Self::Stop => plain(Command::Stop),
            Self::Record { file: None } => plain(Command::RecordStart),
            // The instance may run in another folder.
            Self::Record { file: Some(file) } => {
                Ok((Command::RecordStart, std::path::absolute(file)?.to_string_lossy().into_owned()))
            }
            Self::EndRecording => plain(Command::RecordStop),
            Self::Mark { text } => Ok((Command::Mark, text.clone())),
            Self::Quit => plain(Command::Quit),
        }
    }

    /// What the instance did, and the recording that it did it to.
    fn answer(&self, response: &ControlResponse) -> String {
        let done = response.text.to_text();
        match self {
            Self::Record { .. } | Self::EndRecording | Self::Mark { .. } => {
                format!("{done} ({})", response.state.recording_file.to_text())
            }
            Self::Start | Self::Stop | Self::Quit => done,
        }
    }
}

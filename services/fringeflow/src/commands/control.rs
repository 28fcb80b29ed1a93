//! `fringeflow control`: commands to a running instance.

use std::io::Write as _;
use std::path::PathBuf;

use fringeflow_message::{Command, ControlRequest, Text};
use fringeflow_supervisor::headline;
use fringeflow_transport::{Instance, request};

use crate::failure::Failure;

use super::status::ANSWER;

/// Arguments of `fringeflow control`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Name of the instance: key instance.name of its configuration.
    #[arg(long, default_value = "fringeflow", global = true)]
    instance: String,
    #[command(subcommand)]
    wish: Wish,
}

#[derive(clap::Subcommand)]
enum Wish {
    /// Cameras and projector start.
    Start,
    /// Cameras and projector stop; the services stay.
    Stop,
    /// Begin a recording.
    Record {
        /// Its file; by default one named by the time, in the folder of the configuration.
        file: Option<PathBuf>,
    },
    /// End the recording.
    EndRecording,
    /// Write a remark into the recording, with the time.
    Mark {
        /// The remark.
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
        Ok(writeln!(std::io::stdout(), "{}: {}", self.instance, headline(&response.state, &[]))?)
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
}

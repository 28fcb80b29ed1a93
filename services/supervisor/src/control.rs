//! Answers to `control`: what is asked changes the state, and the services follow the state.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use fringeflow_config::ScannerConfiguration;
use fringeflow_message::{Command, ControlRequest, ControlResponse, ScanState, Text};

use crate::named_by_time;

/// The state of an instance, and whether it is to end.
#[derive(Debug)]
pub(crate) struct Control {
    pub(crate) state: ScanState,
    pub(crate) is_to_end: bool,
    /// Folder and beginning of the names of recordings that are given no path.
    folder: PathBuf,
    name: String,
}

impl Control {
    pub(crate) fn new(configuration: &ScannerConfiguration) -> Self {
        let folder = configuration.recorder.folder.clone();
        Self { state: ScanState::default(), is_to_end: false, folder, name: configuration.name.clone() }
    }

    /// Carries out a request, and says what came of it.
    pub(crate) fn answer(&mut self, request: &ControlRequest) -> ControlResponse {
        let text = request.text.to_text();
        let done = match Command::from_code(request.command) {
            Some(command) => self.carry_out(command, &text),
            None => Err(format!("command {} does not exist; known are 0 to 6", request.command)),
        };
        let (refused, why) = done.map_or_else(|why| (1, why), |()| (0, String::new()));
        ControlResponse { refused, reserved: 0, state: self.state, text: Text::new(&why) }
    }

    fn carry_out(&mut self, command: Command, text: &str) -> Result<(), String> {
        match command {
            Command::State => return Ok(()),
            Command::Start => self.state.scanning = 1,
            Command::Stop => self.state.scanning = 0,
            Command::RecordStart => self.record(text)?,
            Command::RecordStop => self.state.recording = 0,
            Command::Mark => self.mark(text)?,
            Command::Quit => self.is_to_end = true,
        }
        self.state.revision += 1;
        Ok(())
    }

    /// Begins scanning.
    pub(crate) fn start(&mut self) {
        self.state.scanning = 1;
        self.state.revision += 1;
    }

    /// Begins a recording; an empty text asks for a name made of the time.
    pub(crate) fn record(&mut self, text: &str) -> Result<(), String> {
        if self.state.recording != 0 {
            return Err(format!("a recording runs already: {}", self.state.recording_file.to_text()));
        }
        let file = if text.is_empty() { self.named_by_time()? } else { PathBuf::from(text) };
        let file = std::path::absolute(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        check_new(&file)?;
        let name = file.to_str().filter(|name| Text::fits(name));
        let name = name.ok_or_else(|| format!("{}: the path is too long, or no UTF-8", file.display()))?;
        self.state.recording_file = Text::new(name);
        self.state.recording = 1;
        self.state.recordings += 1;
        self.state.revision += 1;
        Ok(())
    }

    fn named_by_time(&self) -> Result<PathBuf, String> {
        std::fs::create_dir_all(&self.folder).map_err(|e| format!("{}: {e}", self.folder.display()))?;
        Ok(named_by_time(&self.folder, &self.name, SystemTime::now(), "mcap"))
    }

    fn mark(&mut self, text: &str) -> Result<(), String> {
        if self.state.recording == 0 {
            return Err("no recording runs that could be marked; begin one first".to_owned());
        }
        self.state.mark = Text::new(text);
        self.state.marks += 1;
        Ok(())
    }
}

fn check_new(file: &Path) -> Result<(), String> {
    if file.exists() {
        return Err(format!("{} exists already; give another name, recordings are never overwritten", file.display()));
    }
    match file.parent() {
        Some(folder) if folder.is_dir() => Ok(()),
        _ => Err(format!("{}: its folder does not exist; create it first", file.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(folder: &Path) -> Control {
        let folder = folder.to_owned();
        Control { state: ScanState::default(), is_to_end: false, folder, name: "test".to_owned() }
    }

    fn ask(control: &mut Control, command: Command, text: &str) -> (u32, String) {
        let request = ControlRequest { command: command as u32, reserved: 0, text: Text::new(text) };
        let response = control.answer(&request);
        assert_eq!(response.state, control.state);
        (response.refused, response.text.to_text())
    }

    #[test]
    fn start_stop_and_quit_change_the_state() {
        let mut control = control(Path::new("/nowhere"));
        assert_eq!(ask(&mut control, Command::State, ""), (0, String::new()));
        assert_eq!(control.state.revision, 0);
        ask(&mut control, Command::Start, "");
        assert_eq!((control.state.scanning, control.state.revision), (1, 1));
        ask(&mut control, Command::Stop, "");
        assert_eq!((control.state.scanning, control.state.revision), (0, 2));
        assert!(!control.is_to_end);
        ask(&mut control, Command::Quit, "");
        assert!(control.is_to_end);
        let (refused, why) = {
            let response = control.answer(&ControlRequest { command: 99, ..ControlRequest::default() });
            (response.refused, response.text.to_text())
        };
        assert!(refused == 1 && why.contains("99"), "{why}");
    }

    #[test]
    fn recordings_get_a_name_and_never_overwrite() {
        let folder = tempfile::tempdir().unwrap();
        let mut control = control(folder.path());
        assert_eq!(ask(&mut control, Command::Mark, "here").0, 1);
        assert_eq!(ask(&mut control, Command::RecordStart, "").0, 0);
        let file = control.state.recording_file.to_text();
        assert!(file.starts_with(folder.path().to_str().unwrap()) && file.ends_with("Z.mcap"), "{file}");
        assert!(ask(&mut control, Command::RecordStart, "").1.contains("runs already"));
        assert_eq!(ask(&mut control, Command::Mark, "here").0, 0);
        assert_eq!((control.state.marks, control.state.mark.to_text().as_str()), (1, "here"));
        ask(&mut control, Command::RecordStop, "");
        let taken = folder.path().join("taken.mcap");
        std::fs::write(&taken, "").unwrap();
        let (refused, why) = ask(&mut control, Command::RecordStart, taken.to_str().unwrap());
        assert!(refused == 1 && why.contains("exists already"), "{why}");
        let (_, why) = ask(&mut control, Command::RecordStart, "/nowhere/at/all.mcap");
        assert!(why.contains("does not exist"), "{why}");
        assert_eq!((control.state.recording, control.state.recordings), (0, 1));
    }
}

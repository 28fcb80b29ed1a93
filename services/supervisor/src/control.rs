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

    /// Carries out a request, and says what was done or why not.
    pub(crate) fn answer(&mut self, request: &ControlRequest) -> ControlResponse {
        let text = request.text.to_text();
        let done = match Command::from_code(request.command) {
            Some(command) => self.carry_out(command, &text),
            None => Err(format!("command {} does not exist; use 0 to 6", request.command)),
        };
        let (refused, said) = done.map_or_else(|why| (1, why), |done| (0, done));
        ControlResponse { refused, reserved: 0, state: self.state, text: Text::new(&said) }
    }

    /// What was done, or why not.
    fn carry_out(&mut self, command: Command, text: &str) -> Result<String, String> {
        let done = match command {
            Command::State => return Ok(String::new()),
            Command::Start => self.scan(1, "scan started", "the scan was running already"),
            Command::Stop => self.scan(0, "scan stopped", "the scan was stopped already"),
            Command::RecordStart => self.record(text).map(|()| "recording started".to_owned())?,
            Command::RecordStop => self.end_recording()?,
            Command::Mark => self.mark(text)?,
            Command::Quit => self.quit(),
        };
        self.state.revision += 1;
        Ok(done)
    }

    fn scan(&mut self, scanning: u32, done: &str, already: &str) -> String {
        let was = std::mem::replace(&mut self.state.scanning, scanning);
        if was == scanning { already.to_owned() } else { done.to_owned() }
    }

    fn quit(&mut self) -> String {
        self.is_to_end = true;
        let recording = if self.state.recording != 0 { "recording and services end" } else { "services end" };
        format!("quits: {recording} in the order of the pipeline")
    }

    /// Begins scanning.
    pub(crate) fn start(&mut self) {
        self.state.scanning = 1;
        self.state.revision += 1;
    }

    /// Begins a recording; an empty text asks for a name made of the time.
    pub(crate) fn record(&mut self, text: &str) -> Result<(), String> {
        if self.state.recording != 0 {
            return Err(format!("a recording is running already: {}", self.state.recording_file.to_text()));
        }
        let file = if text.is_empty() { self.named_by_time()? } else { PathBuf::from(text) };
        let file = std::path::absolute(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        check_new(&file)?;
        let name = file.to_str().filter(|name| Text::fits(name));
        let name = name.ok_or_else(|| format!("{}: the path is too long or not UTF-8", file.display()))?;
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

    fn end_recording(&mut self) -> Result<String, String> {
        match std::mem::take(&mut self.state.recording) {
            0 => Err("no recording is running; there is nothing to end".to_owned()),
            _ => Ok("recording ended".to_owned()),
        }
    }

    fn mark(&mut self, text: &str) -> Result<String, String> {
        if self.state.recording == 0 {
            return Err("no recording is running; start one before you set a mark".to_owned());
        }
        self.state.mark = Text::new(text);
        self.state.marks += 1;
        Ok(format!("mark {} set", self.state.marks))
    }
}

fn check_new(file: &Path) -> Result<(), String> {
    if file.exists() {
        return Err(format!(
            "{} exists already; give another name, because recordings are never overwritten",
            file.display()
        ));
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
        assert_eq!(ask(&mut control, Command::Start, ""), (0, "scan started".to_owned()));
        assert_eq!((control.state.scanning, control.state.revision), (1, 1));
        assert_eq!(ask(&mut control, Command::Start, ""), (0, "the scan was running already".to_owned()));
        assert_eq!(ask(&mut control, Command::Stop, ""), (0, "scan stopped".to_owned()));
        assert_eq!((control.state.scanning, control.state.revision), (0, 3));
        assert!(!control.is_to_end);
        let (refused, done) = ask(&mut control, Command::Quit, "");
        assert!(control.is_to_end && refused == 0 && done.starts_with("quits: services end"), "{done}");
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
        assert!(ask(&mut control, Command::RecordStart, "").1.contains("running already"));
        assert_eq!(ask(&mut control, Command::Mark, "here"), (0, "mark 1 set".to_owned()));
        assert_eq!((control.state.marks, control.state.mark.to_text().as_str()), (1, "here"));
        assert_eq!(ask(&mut control, Command::RecordStop, ""), (0, "recording ended".to_owned()));
        assert_eq!(ask(&mut control, Command::RecordStop, "").0, 1);
        let taken = folder.path().join("taken.mcap");
        std::fs::write(&taken, "").unwrap();
        let (refused, why) = ask(&mut control, Command::RecordStart, taken.to_str().unwrap());
        assert!(refused == 1 && why.contains("exists already"), "{why}");
        let (_, why) = ask(&mut control, Command::RecordStart, "/nowhere/at/all.mcap");
        assert!(why.contains("does not exist"), "{why}");
        assert_eq!((control.state.recording, control.state.recordings), (0, 1));
    }
}

//! Answers control requests. A request changes the state of the scan, and the services follow the state.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use fringeflow_config::ScannerConfiguration;
use fringeflow_message::{Command, ControlRequest, ControlResponse, ScanState, Text};

use crate::timestamped_path;

/// State of an instance, as control requests change it.
#[derive(Debug)]
pub(crate) struct Control {
    pub(crate) state: ScanState,
    /// Why the recording that the state asks for ended early; `None` while it runs.
    pub(crate) early_end: Option<String>,
    /// Whether the instance should end.
    pub(crate) should_quit: bool,
    /// Folder of the recordings that are given no path.
    folder: PathBuf,
    /// Name of the instance.
    name: String,
}

impl Control {
    pub(crate) fn new(configuration: &ScannerConfiguration) -> Self {
        let folder = configuration.recorder.folder.clone();
        Self {
            state: ScanState::default(),
            early_end: None,
            should_quit: false,
            folder,
            name: configuration.name.clone(),
        }
    }

    /// Executes a request. The response has the new state, and a text for the user: what was done, or why not.
    pub(crate) fn answer(&mut self, request: &ControlRequest) -> ControlResponse {
        let text = request.text.to_text();
        let result = match Command::from_code(request.command) {
            Some(command) => self.execute(command, &text),
            None => Err(format!("command {} does not exist; use 0 to 6", request.command)),
        };
        let (refused, text) = result.map_or_else(|reason| (1, reason), |done| (0, done));
        ControlResponse { refused, reserved: 0, state: self.state, text: Text::new(&text) }
    }

    /// Executes a command. Returns what was done, or why it was refused.
    fn execute(&mut self, command: Command, text: &str) -> Result<String, String> {
        let done = match command {
            Command::State => return Ok(String::new()),
            Command::Start => self.set_scanning(1, "scan started", "the scan is already running"),
            Command::Stop => self.set_scanning(0, "scan stopped", "the scan is already stopped"),
            Command::RecordStart => self.start_recording(text).map(|()| "recording started".to_owned())?,
            Command::RecordStop => self.end_recording()?,
            Command::Mark => self.mark(text)?,
            Command::Quit => self.quit(),
        };
        self.state.revision += 1;
        Ok(done)
    }

    fn set_scanning(&mut self, scanning: u32, done: &str, already: &str) -> String {
        let was = std::mem::replace(&mut self.state.scanning, scanning);
        if was == scanning { already.to_owned() } else { done.to_owned() }
    }

    fn quit(&mut self) -> String {
        self.should_quit = true;
        let ending = if self.state.recording != 0 { "the recording and the services end" } else { "the services end" };
        format!("quitting: {ending} in pipeline order")
    }

    /// Starts the scan.
    pub(crate) fn start_scan(&mut self) {
        self.state.scanning = 1;
        self.state.revision += 1;
    }

    /// Starts a recording to the file `text`. If it is empty, the file gets a default name, made from the time.
    pub(crate) fn start_recording(&mut self, text: &str) -> Result<(), String> {
        if self.state.recording != 0 && self.early_end.is_none() {
            return Err(format!("a recording is already running: {}", self.state.recording_file.to_text()));
        }
        let file = if text.is_empty() { self.default_file()? } else { PathBuf::from(text) };
        let file = std::path::absolute(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        check_new_file(&file)?;
        let name = file.to_str().filter(|name| Text::fits(name));
        let name = name.ok_or_else(|| format!("{}: the path is too long or not UTF-8", file.display()))?;
        self.state.recording_file = Text::new(name);
        self.state.recording = 1;
        self.early_end = None;
        self.state.recordings += 1;
        self.state.revision += 1;
        Ok(())
    }

    fn default_file(&self) -> Result<PathBuf, String> {
        std::fs::create_dir_all(&self.folder).map_err(|e| format!("{}: {e}", self.folder.display()))?;
        Ok(timestamped_path(&self.folder, &self.name, SystemTime::now(), "mcap"))
    }

    fn end_recording(&mut self) -> Result<String, String> {
        if std::mem::take(&mut self.state.recording) == 0 {
            return Err("no recording is running; there is nothing to end".to_owned());
        }
        let early_end = self.early_end.take();
        Ok(early_end.map_or_else(|| "recording ended".to_owned(), |why| format!("the recording had ended: {why}")))
    }

    fn mark(&mut self, text: &str) -> Result<String, String> {
        if self.state.recording == 0 {
            return Err("no recording is running; start one before you set a mark".to_owned());
        }
        if let Some(why) = &self.early_end {
            return Err(format!("the recording has ended: {why}; start another one before you set a mark"));
        }
        self.state.mark = Text::new(text);
        self.state.marks += 1;
        Ok(format!("mark {} set", self.state.marks))
    }
}

/// Checks that a file does not exist, and that its folder does.
fn check_new_file(file: &Path) -> Result<(), String> {
    if file.exists() {
        return Err(format!(
            "{} already exists; give another name, because recordings are never overwritten",
            file.display()
        ));
    }
    match file.parent() {
        Some(folder) if folder.is_dir() => Ok(()),
        _ => Err(format!("{}: the folder does not exist; create it first", file.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(folder: &Path) -> Control {
        let folder = folder.to_owned();
        Control { state: ScanState::default(), early_end: None, should_quit: false, folder, name: "test".to_owned() }
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
        assert_eq!(ask(&mut control, Command::Start, ""), (0, "the scan is already running".to_owned()));
        assert_eq!(ask(&mut control, Command::Stop, ""), (0, "scan stopped".to_owned()));
        assert_eq!((control.state.scanning, control.state.revision), (0, 3));
        assert!(!control.should_quit);
        let (refused, done) = ask(&mut control, Command::Quit, "");
        assert!(control.should_quit && refused == 0 && done.starts_with("quitting: the services end"), "{done}");
        let (refused, reason) = {
            let response = control.answer(&ControlRequest { command: 99, ..ControlRequest::default() });
            (response.refused, response.text.to_text())
        };
        assert!(refused == 1 && reason.contains("99"), "{reason}");
    }

    #[test]
    fn recordings_get_a_default_name_and_never_overwrite_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let mut control = control(folder.path());
        assert_eq!(ask(&mut control, Command::Mark, "here").0, 1);
        assert_eq!(ask(&mut control, Command::RecordStart, "").0, 0);
        let file = control.state.recording_file.to_text();
        assert!(file.starts_with(folder.path().to_str().unwrap()) && file.ends_with("Z.mcap"), "{file}");
        assert!(ask(&mut control, Command::RecordStart, "").1.contains("already running"));
        assert_eq!(ask(&mut control, Command::Mark, "here"), (0, "mark 1 set".to_owned()));
        assert_eq!((control.state.marks, control.state.mark.to_text().as_str()), (1, "here"));
        assert_eq!(ask(&mut control, Command::RecordStop, ""), (0, "recording ended".to_owned()));
        assert_eq!(ask(&mut control, Command::RecordStop, "").0, 1);
        let taken = folder.path().join("taken.mcap");
        std::fs::write(&taken, "").unwrap();
        let (refused, reason) = ask(&mut control, Command::RecordStart, taken.to_str().unwrap());
        assert!(refused == 1 && reason.contains("already exists"), "{reason}");
        let (_, reason) = ask(&mut control, Command::RecordStart, "/nowhere/at/all.mcap");
        assert!(reason.contains("does not exist"), "{reason}");
        assert_eq!((control.state.recording, control.state.recordings), (0, 1));
    }

    #[test]
    fn a_recording_that_ended_early_takes_no_mark_and_gives_way_to_another() {
        let folder = tempfile::tempdir().unwrap();
        let mut control = control(folder.path());
        let [first, second] = ["1.mcap", "2.mcap"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
        assert_eq!(ask(&mut control, Command::RecordStart, &first).0, 0);
        control.early_end = Some("disk full".to_owned());
        assert!(ask(&mut control, Command::Mark, "here").1.contains("has ended: disk full"));
        assert_eq!(ask(&mut control, Command::RecordStart, &second).0, 0);
        assert_eq!((control.state.recordings, &control.early_end), (2, &None));
        assert_eq!(ask(&mut control, Command::Mark, "here").0, 0);
        control.early_end = Some("disk full".to_owned());
        assert_eq!(ask(&mut control, Command::RecordStop, ""), (0, "the recording had ended: disk full".to_owned()));
        assert_eq!((control.state.recording, &control.early_end), (0, &None));
    }
}

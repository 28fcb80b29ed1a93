//! The peers in Python: a process that runs what it is told, and says what that took.
//!
//! Its environment is made below `target/bench` from the package index that pip is set up for; where that cannot be had, the
//! lines that need it are skipped, and say so.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use npyz::WriterBuilder as _;
use serde_json::json;

use super::bench::Measured;
use super::clock::{Contender, Spent};
use super::scenes::bench_folder;

/// The folder of the program.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/peers");
/// Libraries that would start threads of their own.
const SINGLE_THREAD: [&str; 4] = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"];

/// The running process.
pub(crate) struct Peers {
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peers {
    /// Makes the environment if need be, starts the process, and hands it the images of a scene.
    pub(super) fn start(easy: &Measured) -> Result<Self, String> {
        let python = environment()?;
        let folder = bench_folder().join("peers");
        hand_over(easy, &folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let mut command = Command::new(python);
        command.arg(Path::new(FOLDER).join("peers.py")).arg(&folder).stdin(Stdio::piped()).stdout(Stdio::piped());
        SINGLE_THREAD.iter().for_each(|name| _ = command.env(name, "1"));
        let mut child = command.spawn().map_err(|e| format!("the peers do not start: {e}"))?;
        let requests = child.stdin.take().ok_or("no standard input")?;
        let answers = BufReader::new(child.stdout.take().ok_or("no standard output")?);
        let mut peers = Self { child, requests, answers };
        match peers.ask("version") {
            Ok(versions) => eprintln!("peers: {versions}"),
            Err(why) => return Err(why),
        }
        Ok(peers)
    }

    /// One of them as a contender; the times are those of the call of the library alone, measured where it is made.
    pub(crate) fn contender<'a>(&'a mut self, name: &'a str) -> Contender<'a> {
        Box::new(move || self.run(name))
    }

    /// Runs one once.
    pub(crate) fn run(&mut self, name: &str) -> Spent {
        let answer = self.ask(&format!("run {name}")).unwrap();
        let mut numbers = answer.split_ascii_whitespace().map(|number| number.parse().unwrap());
        Spent { cpu_ns: numbers.next().unwrap(), wall_ns: numbers.next().unwrap() }
    }

    fn ask(&mut self, request: &str) -> Result<String, String> {
        let mut answer = String::new();
        let asked = writeln!(self.requests, "{request}").and_then(|()| self.answers.read_line(&mut answer));
        match asked {
            Ok(bytes) if bytes > 0 => Ok(answer.trim().to_owned()),
            Ok(_) => Err(format!("the peers ended at {request:?}; what they said stands above")),
            Err(e) => Err(format!("the peers do not answer {request:?}: {e}")),
        }
    }
}

impl Drop for Peers {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Python with the packages of `requirements.txt`, made when missing or out of date.
fn environment() -> Result<PathBuf, String> {
    let (requirements, folder) = (Path::new(FOLDER).join("requirements.txt"), bench_folder().join("venv"));
    let (wanted, stamp) = (std::fs::read(&requirements).unwrap(), folder.join("installed.txt"));
    let python = folder.join("bin/python");
    if std::fs::read(&stamp).ok().as_ref() == Some(&wanted) {
        return Ok(python);
    }
    eprintln!("setting up the peers in {} ...", folder.display());
    let run = |command: &mut Command, what: &str| match command.stdout(Stdio::null()).status() {
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err(format!("{what} failed; what it said stands above")),
        Err(e) => Err(format!("{what} cannot be run: {e}")),
    };
    run(Command::new("python3").args(["-m", "venv"]).arg(&folder), "python3 -m venv")?;
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"]).arg(&requirements);
    run(&mut pip, "pip install of OpenCV, numpy and fringes")?;
    std::fs::write(&stamp, wanted).map_err(|e| format!("{}: {e}", stamp.display()))?;
    Ok(python)
}

/// The images of camera 1 as one array, and the cameras.
fn hand_over(easy: &Measured, folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let window = &easy.images.cameras[0];
    let shape = [window.len(), window[0].height, window[0].width].map(|side| side as u64);
    let file = std::io::BufWriter::new(std::fs::File::create(folder.join("images.npy"))?);
    let mut array = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(file).begin_nd()?;
    array.extend(window.iter().flat_map(|image| image.pixels.iter().copied()))?;
    array.finish()?;
    let rig = &easy.scene.rig.calibrated;
    let cameras = [&rig.cam1, &rig.cam2].map(|camera| {
        let ([fx, fy], [cx, cy]) = (camera.focal_px(), camera.principal_px());
        json!({ "K": [[fx, camera.skew_px(), cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], "D": camera.distortion().to_opencv() })
    });
    std::fs::write(folder.join("cameras.json"), json!(cameras).to_string())
}

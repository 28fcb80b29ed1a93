//! The peers in Python: a process that runs named calls and reports their times.
//!
//! Its Python environment is created in `target/bench`, with packages from the configured index of pip. If that fails,
//! the lines that need it are skipped, with the reason.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use npyz::WriterBuilder as _;
use serde_json::json;

use super::bench::PreparedScene;
use super::clock::{Contender, Spent};
use super::scenes::bench_folder;

/// Folder of the Python program.
const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/peers");
/// Variables that limit libraries to one thread.
const SINGLE_THREAD: [&str; 4] = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"];

/// The running process.
pub(crate) struct Peers {
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peers {
    /// Creates the environment if needed, writes the images of a scene for the process, and starts it.
    pub(super) fn start(easy: &PreparedScene) -> Result<Self, String> {
        let python = environment()?;
        let folder = bench_folder().join("peers");
        write_inputs(easy, &folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let mut command = Command::new(python);
        command.arg(Path::new(FOLDER).join("peers.py")).arg(&folder).stdin(Stdio::piped()).stdout(Stdio::piped());
        SINGLE_THREAD.iter().for_each(|name| _ = command.env(name, "1"));
        let mut child = command.spawn().map_err(|e| format!("the peers cannot be started: {e}"))?;
        let requests = child.stdin.take().ok_or("no standard input")?;
        let answers = BufReader::new(child.stdout.take().ok_or("no standard output")?);
        let mut peers = Self { child, requests, answers };
        match peers.ask("version") {
            Ok(versions) => eprintln!("peers: {versions}"),
            Err(why) => return Err(why),
        }
        Ok(peers)
    }

    /// Makes a contender of a peer. Its times are those of the library call alone, measured in the Python process.
    pub(crate) fn contender<'a>(&'a mut self, name: &'a str) -> Contender<'a> {
        Box::new(move || self.run(name))
    }

    /// Runs a peer once.
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
            Ok(_) => Err(format!("the peers ended during {request:?}; see their messages above")),
            Err(e) => Err(format!("the peers did not answer {request:?}: {e}")),
        }
    }
}

impl Drop for Peers {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns a Python with the packages of `requirements.txt`. Creates it if it is missing or out of date.
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
        Ok(_) => Err(format!("{what} failed; see its messages above")),
        Err(e) => Err(format!("{what} cannot be run: {e}")),
    };
    run(Command::new("python3").args(["-m", "venv"]).arg(&folder), "python3 -m venv")?;
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"]).arg(&requirements);
    run(&mut pip, "pip install of OpenCV, numpy and fringes")?;
    std::fs::write(&stamp, wanted).map_err(|e| format!("{}: {e}", stamp.display()))?;
    Ok(python)
}

/// Writes the images of camera 1 as one array, and the parameters of both cameras.
fn write_inputs(easy: &PreparedScene, folder: &Path) -> std::io::Result<()> {
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

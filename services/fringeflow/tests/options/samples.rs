//! The forms of the commands, the inputs, and a value for each option.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::outcome::run;

/// Options on which no result depends.
pub(crate) const WITHOUT_RESULT: &[&str] = &["--threads", "--simd", "--log-format"];

/// A way to use a command. In its arguments, `SET` and the other names of [`Inputs`] stand for paths.
pub(crate) struct Form {
    pub(crate) command: &'static str,
    pub(crate) arguments: &'static str,
    /// Pairs of which one says what holds anyway with the other.
    exceptions: &'static [[&'static str; 2]],
}

const fn form(command: &'static str, arguments: &'static str) -> Form {
    Form { command, arguments, exceptions: &[] }
}

/// A cycle without further images compensates no motion, so it has no prior. The few points of the resolution paper give
/// none either.
const WITHOUT_PRIOR: &[[&str; 2]] = &[["--steps", "--no-prior"], ["--resolution", "--no-prior"]];

/// Every third window of a second gives no prior either.
const FEW_WINDOWS: &[[&str; 2]] = &[WITHOUT_PRIOR[0], WITHOUT_PRIOR[1], ["--every", "--no-prior"]];

pub(crate) const FORMS: &[Form] = &[
    form("board", "chessboard:9x6:square=7 --output board.svg"),
    form("board", "chessboard:9x6:square=7 --json"),
    // A calibration from so few poses is refused.
    form("calibrate", "BOARDS --board chessboard:9x6:square=7 --output calibration.yml --force"),
    form("simulate", "--output set --size 128x96 --calibration-board chessboard:5x4:square=6 --views 1 --steps 3"),
    Form { command: "reconstruct", arguments: "SET --output cloud.ply", exceptions: WITHOUT_PRIOR },
    form("reconstruct", "SET --output cloud.ply --method egc"),
    // The pictures show changes that the rounded figures hide.
    Form { command: "evaluate", arguments: "SET --preview pictures", exceptions: WITHOUT_PRIOR },
    form("evaluate", "SET --method cgc"),
    form("simulate", "--output set --size 64x64 --supersampling 1"),
    // The tooth: its rays, traced anew in every image, take least time.
    form("simulate", "--output set --size 64x64 --supersampling 1 --object tooth --motion 0.3 --board 85"),
    form("simulate", "--output set --size 64x64"),
    form("simulate", "--output set --size 64x64 --supersampling 1 --format RGGB"),
    form("simulate", "--output set --supersampling 1 --no-gray --steps 4 --rig SET"),
    form("simulate", "--config SCANNER --output set"),
    form("simulate", "--config SCANNER --output scan.mcap"),
    form("rig", "SET --json"),
    form("rig", "SET"),
    form("rig", "SET --images SET"),
    form("fuse", "SCAN --output model.ply --every 2"),
    form("fuse", "SCAN --output model.ply --no-prior"),
    form("export", "SCAN --output cloud.ply"),
    form("export", "SCAN --output clouds"),
    form("export", "SCAN --output images --images"),
    form("import", "SET --output set.mcap"),
    form("info", "SCAN"),
    form("check", "SCAN"),
    form("recover", "SCAN --output again.mcap"),
    form("latency", "SCAN"),
    form("patterns", "--output set --size 64x48"),
    form("patterns", "--output set"),
    form("patterns", "--output set --calibration --size 64x48"),
    form("patterns", "--output set --config TOOTH"),
    form("verify", "PLATE --artefact plane"),
    // The object has all digits; the text rounds.
    Form { command: "verify", arguments: "BALL_SCAN --artefact sphere:20 --recompute --json", exceptions: FEW_WINDOWS },
];

impl Form {
    pub(crate) fn is_excepted(&self, [a, b]: [&str; 2]) -> bool {
        self.exceptions.iter().any(|pair| pair.contains(&a) && pair.contains(&b))
    }
}

/// The inputs of the commands.
pub(crate) struct Inputs {
    folder: TempDir,
    /// A dataset of a moving object with Gray code.
    set: PathBuf,
    /// A recording of a run, with clouds and reports.
    scan: PathBuf,
    /// The configuration of that run.
    scanner: PathBuf,
    /// A dataset of a plate, and a recording of a ball before a moving scanner.
    plate: PathBuf,
    ball_scan: PathBuf,
}

const BOARD: &str = "simulate --output boards --calibration-board chessboard:9x6:square=7 --views 4 --steps 3 \
                     --size 200x160";

const SIMULATION: &str = "simulate --output set --size 128x96 --period 32 --supersampling 1 --steps 4 \
                          --motion 0.5 --two-directions --noise low";

const PLATE: &str = "simulate --output plate --object plane --board none --size 256x200 --supersampling 1 --steps 4 \
                     --no-gray --motion 0.2 --noise high";
const BALL_SCAN: &str = "simulate --config ball.toml --output ball.mcap --seconds 1";

impl Inputs {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("ball.toml"), BALL_SCANNER).unwrap();
        for simulation in [SIMULATION, BOARD, PLATE, BALL_SCAN] {
            let made = run(folder.path(), &simulation.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
            assert!(made.is_success(), "{}", made.stderr);
        }
        std::fs::write(folder.path().join("settings.toml"), SETTINGS).unwrap();
        std::fs::write(folder.path().join("scanner.toml"), SCANNER).unwrap();
        let table: String = (0..256).map(|level| format!("{}\n", level / 2)).collect();
        std::fs::write(folder.path().join("table.txt"), table).unwrap();
        let recordings = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recordings");
        let (scan, scanner) = (recordings.join("tooth.mcap"), recordings.join("tooth.toml"));
        let made = |name: &str| folder.path().join(name);
        let (set, plate, ball_scan) = (made("set"), made("plate"), made("ball.mcap"));
        Self { set, scan, scanner, plate, ball_scan, folder }
    }

    /// Replaces the name of an input by its path.
    pub(crate) fn replace(&self, word: &str) -> String {
        let path = match word {
            "SET" => self.set.clone(),
            "SCAN" => self.scan.clone(),
            "TOOTH" => self.scanner.clone(),
            "TABLE" => self.folder.path().join("table.txt"),
            "BOARDS" => self.folder.path().join("boards"),
            "EXACT" => self.folder.path().join("boards/exact.yml"),
            "BOARD" => self.folder.path().join("boards/view_00/cam1/000.png"),
            "PLATE" => self.plate.clone(),
            "BALL_SCAN" => self.ball_scan.clone(),
            "SETTINGS" => self.folder.path().join("settings.toml"),
            "SCANNER" => self.folder.path().join("scanner.toml"),
            word => return word.to_owned(),
        };
        path.to_string_lossy().into_owned()
    }
}

/// Settings that differ from the default ones.
const SETTINGS: &str = "[phase]\nmin_modulation_grey = 40\n[health]\ndrift_rad = { warn = 0.000001, bad = 0.000002 }\n";

/// A small scanner. Its devices do not matter to a simulation.
const SCANNER: &str = "[cameras]\nsource = \"v4l2\"\nrate_hz = 50\nstereo_layout = \"top-bottom\"\n[cameras.both]\ndevice = \"/dev/video0\"\n\
                       [pattern]\nsteps = 4\nperiod_px = 48\n[virtual_scanner]\nobject = \"tooth\"\nsize_px = [96, 80]\n";

/// A scanner that moves before a ball, whose middle has enough points to measure.
const BALL_SCANNER: &str = "[cameras]\nsource = \"virtual\"\nrate_hz = 50\n[projector]\ndriver = \"virtual\"\n[pattern]\nsteps = 4\n\
                            period_px = 32\n[virtual_scanner]\nobject = \"sphere\"\nsize_px = [208, 160]\ndepth_mm = 40\n\
                            [virtual_scanner.sweep]\nposes = 24\ntravel_mm = [2.0, 1.5, 0.5]\n";

/// Returns an option with a value that the command accepts, and that differs from the default one.
pub(crate) fn sample(form: &Form, option: &str, inputs: &Inputs) -> Vec<String> {
    let value = match (form.command, option) {
        ("calibrate", "--report") => "report.html",
        ("calibrate", "--refine") => "SET",
        ("calibrate", "--from") => "EXACT",
        ("calibrate", "--compare") => "EXACT",
        ("calibrate", "--rulers") => "71,51",
        ("board", "--page") => "a3",
        ("board", "--find") => "BOARD",
        ("evaluate" | "reconstruct", "--method") => "cgc",
        ("evaluate", "--against") => "gray",
        ("export", "--format") => "npz",
        ("simulate", "--format") => "Y12",
        ("export", "--frames" | "--clouds") => "0..9",
        ("fuse", "--frames") => "0..24",
        ("rig" | "simulate", "--volume") => "--volume=-20,-20,290,20,20,310",
        ("simulate", "--rig") => "SET",
        ("simulate", "--size") => "96x64",
        ("rig", "--noise") => "9",
        ("simulate", "--noise") => "low",
        ("rig" | "simulate" | "patterns", "--period") => "48",
        ("patterns", "--size") => "80x64",
        ("patterns", "--steps") => "5",
        ("patterns", "--config") => "TOOTH",
        (_, "--shifts") => "0,1.5,3",
        (_, "--direction") => "both",
        (_, "--rotate") => "90",
        (_, "--flip") => "vertical",
        (_, "--bits") => "1",
        (_, "--gamma-table") => "TABLE",
        ("simulate", "--config") => "settings.toml",
        ("verify", "--report") => "page.html",
        (_, "--config") => "SETTINGS",
        (_, "--frames") => "4..11",
        ("rig", "--steps") => "3",
        (_, "--steps") => "4",
        (_, "--units") => "m",
        (_, "--resolution") => "paper",
        (_, "--min-confidence") => "0.95",
        (_, "--extra-images") => "1",
        (_, "--segment-table") => "rig.segments",
        (_, "--preview" | "--output") => "pictures",
        (_, "--trajectory") => "poses.csv",
        (_, "--html") => "page.html",
        (_, "--trace") => "trace.json",
        (_, "--worst") => "2",
        (_, "--every" | "--cloud" | "--windows" | "--seconds") => "3",
        (_, "--min-support") => "5",
        (_, "--rate") => "50",
        (_, "--scenes") => "build",
        (_, "--take") => "2",
        (_, "--only") => "plain",
        (_, "--objects") => "tooth",
        (_, "--series") => "sd",
        (_, "--sign") => "--sign=-1",
        (_, "--modulation") => "30",
        (_, "--calibration-error-px") => "0.2",
        (_, "--calibration-sd") => "0.1",
        (_, "--grid") => "4",
        (_, "--images") if form.command == "rig" => "SET",
        (_, "--object") => "tooth",
        (_, "--bayer") => "weighted",
        (_, "--stereo-layout") => "side-by-side",
        (_, "--board") => "40",
        (_, "--board-albedo") => "0.2",
        (_, "--board-tilt") => "10",
        (_, "--share") => "20",
        (_, "--shift") => "--shift=1,2,-3",
        (_, "--cover") => "cam2",
        (_, "--motion") => "0.4",
        (_, "--turn" | "--blur") => "0.5",
        (_, "--cycles") => "3",
        (_, "--tremor") => "0.1",
        (_, "--projector-at") => "--projector-at=150,-60,0",
        (_, "--calibration-board") => "chessboard:5x4:square=6",
        (_, "--views" | "--board-bend") => "2",
        (_, "--board-motion" | "--ambient") => "0.2",
        (_, "--defocus") => "3",
        (_, "--beat") => "0.1",
        (_, "--drawn-rig") => "5",
        (_, "--albedo") => "0.3",
        (_, "--gloss") => "2",
        (_, "--exposure") => "0.7",
        (_, "--gamma") => "1.5",
        (_, "--seed") => "7",
        (_, "--sd") => "0.08",
        (_, "--lens-error") => "2",
        (_, "--depth") => "60",
        (_, "--supersampling") => "1",
        // A switch.
        _ => return vec![option.to_owned()],
    };
    if value.starts_with("--") { vec![value.to_owned()] } else { vec![option.to_owned(), inputs.replace(value)] }
}

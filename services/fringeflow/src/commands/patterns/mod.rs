//! `fringeflow patterns`: writes the images that a projector shows, and their list.

mod mounting;

use std::io::Write as _;
use std::path::PathBuf;

use fringeflow_base::text_file::read_text;
use fringeflow_patterns::{Depth, Direction, FringeCycle, Output, PATTERNS_FILE, PatternSet, Response, usual_fringes};

use crate::acting_options::{ActingOptions, Mode};
use crate::calibrated_rig::configured_setup;
use crate::failure::Failure;
use crate::values::{one_of, parse_size};

use mounting::MountingArgs;

/// Arguments of `fringeflow patterns`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder to write: a new or an empty one. It gets the images, and patterns.toml, which says of each image what it
    /// shows.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Take size, period, shifts, sign and offset of the fringes from the configuration of a scanner.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Write all images of a calibration: white, black, fringes and Gray code of columns, those of rows, and white
    /// again.
    #[arg(long, conflicts_with = "chart")]
    calibration: bool,
    /// Write only a chart for focus and alignment.
    #[arg(long)]
    chart: bool,
    /// Width and height of the upright image, projector pixels [default: 1024x768].
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[usize; 2]>,
    /// Images of a cycle, evenly shifted, 3 to 16. The default is 4, with --calibration 8.
    #[arg(long, value_name = "N", conflicts_with = "shifts")]
    steps: Option<usize>,
    /// Phase shifts of the images instead, rad.
    #[arg(long, value_name = "RAD,…", value_delimiter = ',', allow_hyphen_values = true)]
    shifts: Option<Vec<f64>>,
    /// Fringe period, projector pixels [default: 16].
    #[arg(long, value_name = "PX")]
    period: Option<f64>,
    /// Direction in which the phase grows. A scan uses columns.
    #[arg(long, value_name = "DIRECTION", default_value = "columns", value_parser = one_of(&Across::ALL, Across::name))]
    direction: Across,
    /// Add the Gray code that counts the half periods.
    #[arg(long)]
    gray: bool,
    #[command(flatten)]
    mounting: MountingArgs,
    /// Bits of a pixel: 8 or 1. With 1, grey is dithered, for fast projectors that are set slightly out of focus.
    #[arg(long, value_name = "BITS", default_value = "8", value_parser = one_of(&[8_u8, 1], |bits| if bits == 1 { "1" } else { "8" }))]
    bits: u8,
    /// Put 24 images of 1 bit, or 3 of 8 bits, into each file, as DLP controllers store them. patterns.toml names the
    /// bits of each image.
    #[arg(long)]
    packed: bool,
    /// Exponent of the projector, 0.2 to 5: its light is the grey level to this power. The images correct it, so that the
    /// light is linear.
    #[arg(long, value_name = "G", conflicts_with = "gamma_table")]
    gamma: Option<f64>,
    /// Table that corrects the projector instead: 256 lines, the grey level (0 to 255) for each wanted light.
    #[arg(long, value_name = "FILE")]
    gamma_table: Option<PathBuf>,
}

/// Directions of the fringes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Across {
    Columns,
    Rows,
    Both,
}

impl Across {
    const ALL: [Self; 3] = [Self::Columns, Self::Rows, Self::Both];

    fn name(self) -> &'static str {
        match self {
            Self::Columns => Direction::Columns.name(),
            Self::Rows => Direction::Rows.name(),
            Self::Both => "both",
        }
    }

    fn directions(self) -> &'static [Direction] {
        match self {
            Self::Columns => &[Direction::Columns],
            Self::Rows => &[Direction::Rows],
            Self::Both => &Direction::BOTH,
        }
    }
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["output", "config", "rotate", "flip", "bits", "packed"],
    choices: &[
        &[
            Mode { name: "with --chart", is_chosen: |args| args.chart, options: &["chart"] },
            Mode {
                name: "with --calibration",
                is_chosen: |args| args.calibration,
                options: &["calibration", "steps", "shifts", "period"],
            },
            Mode {
                name: "for a cycle of fringes",
                is_chosen: |_| true,
                options: &["steps", "shifts", "period", "direction", "gray"],
            },
        ],
        &[
            Mode { name: "with --config", is_chosen: |args| args.config.is_some(), options: &["config"] },
            Mode { name: "without --config", is_chosen: |_| true, options: &["size", "steps", "shifts", "period"] },
        ],
        &[
            Mode { name: "with --bits 1", is_chosen: |args| args.bits == 1, options: &[] },
            Mode { name: "with --bits 8", is_chosen: |_| true, options: &["gamma", "gamma_table"] },
        ],
    ],
};

/// Default size of the image, pixels.
const SIZE_PX: [usize; 2] = [1024, 768];
/// Default period, pixels.
const PERIOD_PX: f64 = 16.0;
/// Default number of steps of a scan, and of a calibration.
const STEPS: [usize; 2] = [4, 8];

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let set = PatternSet { output: self.handed_over()?, ..self.upright()? };
        set.write(&self.output)?;
        let [width, height] = set.output_px();
        let (images, list) = (set.images.len(), self.output.join(PATTERNS_FILE));
        let s = if images == 1 { "" } else { "s" };
        writeln!(std::io::stdout().lock(), "{}: {images} image{s} of {width} × {height} pixels", list.display())?;
        Ok(())
    }

    /// The images, upright and without correction.
    fn upright(&self) -> Result<PatternSet, Failure> {
        let (size_px, cycle) = match &self.config {
            Some(config) => {
                let setup = configured_setup(config)?;
                let projector = &setup.rig.projector;
                let cycle = FringeCycle { pattern: setup.sequence.pattern, shifts_rad: setup.sequence.shifts_rad };
                ([projector.width_px(), projector.height_px()], cycle)
            }
            None => (self.size.unwrap_or(SIZE_PX), self.cycle()),
        };
        let set = if self.chart {
            PatternSet::chart(size_px)
        } else if self.calibration {
            PatternSet::calibration(size_px, &cycle)
        } else {
            PatternSet::fringes(size_px, self.direction.directions(), &cycle, self.gray)
        };
        set.map_err(Failure::unusable)
    }

    fn cycle(&self) -> FringeCycle {
        let pattern = usual_fringes(self.period.unwrap_or(PERIOD_PX));
        let steps = self.steps.unwrap_or(STEPS[usize::from(self.calibration)]);
        match &self.shifts {
            Some(shifts_rad) => FringeCycle { pattern, shifts_rad: shifts_rad.clone() },
            None => FringeCycle::even(steps, pattern.period_px),
        }
    }

    fn handed_over(&self) -> Result<Output, Failure> {
        let response = match (self.gamma, &self.gamma_table) {
            (Some(gamma), _) => Response::gamma(gamma).map_err(|e| Failure::Usage(format!("--gamma {gamma}: {e}")))?,
            (None, Some(file)) => {
                let unusable = |what: String| Failure::Usage(format!("{}: {what}", file.display()));
                let text = read_text(file).map_err(|e| unusable(e.to_string()))?;
                Response::parse_table(&text).map_err(|e| unusable(e.to_string()))?
            }
            (None, None) => Response::Linear,
        };
        let depth = if self.bits == 1 { Depth::One } else { Depth::Eight(response) };
        Ok(Output { orientation: self.mounting.orientation(), depth, packed: self.packed })
    }
}

//! `fringeflow export`: writes the clouds of a recording as files, or its images as a dataset folder.

use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use fringeflow::calibration::Unit;
use fringeflow::cloud::{CloudExport, CloudFormat};
use fringeflow_dataset::check_new;
use fringeflow_recording::{Recording, Topic, export_images};

use crate::acting_options::{ActingOptions, Mode};
use crate::failure::Failure;
use crate::proposed::parse_range;
use crate::values::unit;
use crate::{json, output_folder, progress};

/// Arguments of `fringeflow export`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording to export.
    input: PathBuf,
    /// File for one cloud (.ply, .pcd or .npz), or a new folder for several clouds or images.
    #[arg(short, long, value_name = "FILE|FOLDER")]
    output: PathBuf,
    /// With a file: number of the cloud to export, counted from 0.
    #[arg(long, value_name = "K", default_value_t = 0)]
    cloud: usize,
    /// With a folder: export clouds A to B, without B. The default is all.
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    clouds: Option<Range<usize>>,
    /// With a folder: format of the clouds.
    #[arg(long, value_name = "FORMAT", default_value = "ply", value_parser = ["ply", "pcd", "npz"])]
    format: String,
    /// Write the images as a dataset folder. This is the inverse of `import`.
    #[arg(long)]
    images: bool,
    /// With --images: export image pairs A to B, without B. The default is all.
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    frames: Option<Range<usize>>,
    /// Unit of the clouds.
    #[arg(long, value_name = "UNIT", default_value = "mm", value_parser = unit())]
    units: Unit,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(serde::Serialize)]
struct Report<'a> {
    output: &'a Path,
    clouds: usize,
    points: usize,
    image_pairs: usize,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["input", "output", "json"],
    choices: &[&[
        Mode { name: "with --images", is_chosen: |args| args.images, options: &["images", "frames"] },
        Mode {
            name: "with an output file and without --clouds",
            is_chosen: Args::writes_one_cloud,
            options: &["cloud", "units"],
        },
        Mode {
            name: "with --clouds or an output folder",
            is_chosen: |_| true,
            options: &["clouds", "format", "units"],
        },
    ]],
};

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let (mut clouds, mut points, mut image_pairs) = (0, 0, 0);
        if self.images {
            image_pairs = self.export_images()?;
        } else if self.writes_one_cloud() {
            CloudFormat::from_path(&self.output)?;
            let recording = Recording::open(&self.input)?;
            points = self.write_cloud(&recording, self.cloud, &self.output)?;
            clouds = 1;
        } else {
            check_new(&self.output)?;
            let recording = Recording::open(&self.input)?;
            let range = self.cloud_range(&recording)?;
            clouds = range.len();
            points = self.write_clouds(&recording, range)?;
        }
        let report = Report { output: &self.output, clouds, points, image_pairs };
        if self.json {
            return json::print(&report);
        }
        let mut out = std::io::stdout().lock();
        let to = self.output.display();
        if self.images {
            return Ok(writeln!(out, "{to}: {image_pairs} image pairs")?);
        }
        Ok(writeln!(out, "{to}: {clouds} clouds, {points} points")?)
    }

    /// Whether the output is a file with one cloud.
    fn writes_one_cloud(&self) -> bool {
        self.clouds.is_none() && self.output.extension().is_some()
    }

    fn cloud_range(&self, recording: &Recording) -> Result<Range<usize>, Failure> {
        let available = recording.count(Topic::Cloud);
        let range = self.clouds.clone().unwrap_or(0..available);
        if range.start < range.end && range.end <= available {
            return Ok(range);
        }
        Err(Failure::Usage(format!(
            "--clouds {}..{}: {} has clouds 0..{available}; give a range A..B of these",
            range.start,
            range.end,
            self.input.display()
        )))
    }

    fn write_clouds(&self, recording: &Recording, range: Range<usize>) -> Result<usize, Failure> {
        output_folder::prepare(&self.output)?;
        let bar = progress::bar("clouds", range.len() as u64);
        let mut points = 0;
        for number in range {
            let path = self.output.join(format!("cloud_{number:06}.{}", self.format));
            points += self.write_cloud(recording, number, &path)?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(points)
    }

    fn write_cloud(&self, recording: &Recording, number: usize, path: &Path) -> Result<usize, Failure> {
        let missing = || {
            let (file, count) = (self.input.display(), recording.count(Topic::Cloud));
            Failure::Usage(format!("--cloud {number}: {file} has {count} clouds, counted from 0"))
        };
        let cloud = recording.cloud(number)?.ok_or_else(missing)?;
        cloud.write(path, &CloudExport { unit: self.units, dataset: &recording.setup().name })?;
        Ok(cloud.points.len())
    }

    fn export_images(&self) -> Result<usize, Failure> {
        check_new(&self.output)?;
        let recording = Recording::open(&self.input)?;
        let pairs = fringeflow_replay::pairs(&recording)?;
        let range = self.frames.clone().unwrap_or(0..pairs.len());
        let steps = recording.setup().steps;
        let chosen = pairs.get(range.clone()).filter(|chosen| chosen.len() >= steps);
        let chosen = chosen.ok_or_else(|| {
            let (start, end, count) = (range.start, range.end, pairs.len());
            Failure::Usage(format!(
                "--frames {start}..{end}: {} has image pairs 0..{count}; give a range A..B of these, with at least \
                 the {steps} pairs of a cycle",
                self.input.display()
            ))
        })?;
        let bar = progress::bar("images", chosen.len() as u64);
        export_images(&recording, chosen, &self.output, || bar.inc(1))?;
        bar.finish_and_clear();
        Ok(chosen.len())
    }
}

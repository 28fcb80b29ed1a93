//! The proposed method (PA) on a dataset folder, as `reconstruct` and `evaluate` run it.

use std::ops::Range;
use std::path::PathBuf;

use fringeflow::config::Configuration;
use fringeflow::correspondence::{Fingerprint, SegmentTable};
use fringeflow::dataset::{CameraId, Dataset, GreyImage};
use fringeflow::geometry::MeasurementVolume;
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstruction, Reconstructor};

use crate::failure::Failure;
use crate::progress;

/// Arguments of the proposed method.
#[derive(clap::Args, Default)]
pub(crate) struct ProposedArgs {
    /// Use N phase images, evenly chosen; all of them by default.
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Use phase images A up to but without B; the first cycle by default.
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<usize>>,
    /// TOML file with settings, see configs/reconstruct.toml.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// File of the segment table: read if it exists, else computed and written.
    #[arg(long, value_name = "FILE")]
    segment_table: Option<PathBuf>,
}

impl ProposedArgs {
    /// Reconstructs a dataset.
    pub(crate) fn reconstruct(&self, dataset: &Dataset) -> Result<Reconstruction, Failure> {
        let configuration = self.config.as_deref().map(Configuration::read).transpose()?.unwrap_or_default();
        let numbers = self.images(dataset)?;
        let shifts: Vec<f64> = numbers.iter().map(|&n| dataset.setup.sequence.shifts_rad[n]).collect();
        let shifts = PhaseShifts::new(&shifts).map_err(|e| usage(dataset, &e))?;
        let volume = configuration.volume.or_else(|| dataset.setup.volume.clone()).ok_or_else(|| {
            usage(dataset, &"there is no measurement volume; give one with --config (key measurement_volume)")
        })?;
        let bar = progress::bar("segment table", 3);
        let table = self.segment_table(dataset, &volume)?;
        bar.inc(1);
        bar.set_message("images");
        let [cam1, cam2] = CameraId::BOTH.map(|camera| dataset.phase_images(camera, &numbers));
        let (cam1, cam2) = (cam1?, cam2?);
        bar.inc(1);
        bar.set_message("correspondences");
        let reconstructor = Reconstructor::new(&dataset.setup.rig, table, shifts, configuration.settings);
        let mut reconstructor = reconstructor.map_err(|e| usage(dataset, &e))?;
        let reconstruction = reconstructor.reconstruct(&views(&cam1), &views(&cam2));
        bar.finish_and_clear();
        reconstruction.map_err(|e| usage(dataset, &e))
    }

    /// Numbers of the phase images to use.
    fn images(&self, dataset: &Dataset) -> Result<Vec<usize>, Failure> {
        let available = dataset.setup.sequence.shifts_rad.len();
        let Range { start, end } = self.frames.clone().unwrap_or(0..dataset.setup.steps);
        if start >= end || end > available {
            return Err(Failure::Usage(format!(
                "--frames {start}..{end}: the dataset has phase images 0..{available}; give A below B within these"
            )));
        }
        let count = end - start;
        let steps = self.steps.unwrap_or(count);
        if steps == 0 || !count.is_multiple_of(steps) {
            return Err(Failure::Usage(format!(
                "--steps {steps}: {count} images cannot be thinned out evenly to {steps}; give a divisor of {count}"
            )));
        }
        Ok((start..end).step_by(count / steps).collect())
    }

    /// The segment table, from its file if there is one.
    fn segment_table(&self, dataset: &Dataset, volume: &MeasurementVolume) -> Result<SegmentTable, Failure> {
        let pattern = &dataset.setup.sequence.pattern;
        let build = || SegmentTable::build(&dataset.setup.rig, volume, pattern).map_err(|e| usage(dataset, &e));
        let Some(path) = &self.segment_table else { return build() };
        if path.exists() {
            return Ok(SegmentTable::load(path, Fingerprint::of(&dataset.setup.rig, volume, pattern))?);
        }
        let table = build()?;
        table.save(path)?;
        Ok(table)
    }
}

fn views(images: &[GreyImage]) -> Vec<&[u8]> {
    images.iter().map(|i| i.pixels.as_slice()).collect()
}

/// A dataset that can be read but not reconstructed.
fn usage(dataset: &Dataset, problem: &dyn std::fmt::Display) -> Failure {
    Failure::Usage(format!("{}: {problem}", dataset.folder.display()))
}

/// `A..B` as a range.
fn frames(text: &str) -> Result<Range<usize>, String> {
    let wrong = || format!("{text:?} is no range of images; write 0..4 for the first four");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    Ok(start.parse().map_err(|_| wrong())?..end.parse().map_err(|_| wrong())?)
}

//! The proposed method (PA) on a dataset folder or a recording, as `reconstruct` and `evaluate` run it.

use std::ops::Range;
use std::path::{Path, PathBuf};

use fringeflow::config::Configuration;
use fringeflow::correspondence::{DriftLimit, ResolutionMethod, SegmentFileError, SegmentTable};
use fringeflow::dataset::GreyImage;
use fringeflow::geometry::{FringePattern, MeasurementVolume, Rig};
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor};

use crate::failure::Failure;
use crate::input::Input;
use crate::progress;

/// Arguments of the proposed method.
#[derive(clap::Args, Default)]
pub(crate) struct ProposedArgs {
    /// Use N phase images, evenly chosen; all of them by default.
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Use phase images A up to but without B, of a recording its image pairs; the first complete cycle by default.
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<usize>>,
    #[command(flatten)]
    measuring: MeasuringArgs,
}

/// Arguments of how images are measured.
#[derive(clap::Args, Default)]
pub(crate) struct MeasuringArgs {
    /// TOML file with settings, see configs/reconstruct.toml; by default those of the recording.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// How pixels with several candidates are decided; by default as configured, else semi-global.
    #[arg(long, value_name = "METHOD", value_parser = resolution)]
    resolution: Option<ResolutionMethod>,
    /// Least confidence of a point, a probability; by default as configured, else 0.9.
    #[arg(long, value_name = "P", value_parser = probability)]
    min_confidence: Option<f32>,
    /// File of the segment table: read if it exists, else computed and written.
    #[arg(long, value_name = "FILE")]
    segment_table: Option<PathBuf>,
}

/// What the proposed method made of an input.
pub(crate) struct Proposed {
    pub(crate) reconstruction: Reconstruction,
    /// Drift of the calibration that is borne.
    pub(crate) drift_limit: DriftLimit,
}

impl ProposedArgs {
    /// Nothing but a resolution.
    pub(crate) fn with_resolution(method: ResolutionMethod) -> Self {
        let measuring = MeasuringArgs { resolution: Some(method), ..MeasuringArgs::default() };
        Self { measuring, ..Self::default() }
    }

    /// Reconstructs an input.
    pub(crate) fn reconstruct(&self, input: &Input) -> Result<Proposed, Failure> {
        let numbers = self.images(input)?;
        let bar = progress::bar("segment table", 2);
        let (mut reconstructor, drift_limit) = self.measuring.reconstructor(input, &numbers)?;
        bar.inc(1);
        bar.set_message("correspondences");
        let reconstruction = reconstruct(input, &mut reconstructor, &numbers);
        bar.finish_and_clear();
        Ok(Proposed { reconstruction: reconstruction?, drift_limit })
    }

    /// Numbers of the phase images to use.
    fn images(&self, input: &Input) -> Result<Vec<usize>, Failure> {
        let available = input.available();
        let Range { start, end } = match &self.frames {
            Some(frames) => frames.clone(),
            None => input.first_cycle()?,
        };
        if start >= end || end > available {
            let what = match input {
                Input::Folder(_) => "dataset has phase images",
                Input::Recording(..) => "recording has image pairs",
            };
            return Err(Failure::Usage(format!(
                "--frames {start}..{end}: the {what} 0..{available}; give A below B within these"
            )));
        }
        thinned_out(start..end, self.steps)
    }
}

impl MeasuringArgs {
    /// What reconstructs images that show the same steps as those of these numbers, and the drift that is borne.
    pub(crate) fn reconstructor(
        &self,
        input: &Input,
        numbers: &[usize],
    ) -> Result<(Reconstructor, DriftLimit), Failure> {
        let mut configuration = configuration(self.config.as_deref(), input)?;
        if let Some(method) = self.resolution {
            configuration.settings.matching.method = method;
        }
        if let Some(min_confidence) = self.min_confidence {
            configuration.settings.matching.min_confidence = min_confidence;
        }
        let setup = input.setup();
        let volume = configuration.volume.clone().or_else(|| setup.volume.clone()).ok_or_else(|| {
            input.unusable(&"there is no measurement volume; give one with --config (key measurement_volume)")
        })?;
        let measured = Measured { rig: &setup.rig, volume: &volume, pattern: &setup.sequence.pattern };
        let reconstructor = reconstructor(input, numbers, &measured, &configuration, self.segment_table.as_deref())?;
        Ok((reconstructor, configuration.drift_limit))
    }
}

/// What images are measured with.
pub(crate) struct Measured<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) volume: &'a MeasurementVolume,
    pub(crate) pattern: &'a FringePattern,
}

/// The settings of a file, or else those that were recorded with the input.
pub(crate) fn configuration(file: Option<&Path>, input: &Input) -> Result<Configuration, Failure> {
    file.map_or_else(|| input.configuration(), |file| Ok(Configuration::read(file)?))
}

/// So many of some images, evenly chosen; all of them unless they are to be thinned out.
pub(crate) fn thinned_out(images: Range<usize>, steps: Option<usize>) -> Result<Vec<usize>, Failure> {
    let count = images.len();
    let steps = steps.unwrap_or(count);
    if steps == 0 || !count.is_multiple_of(steps) {
        return Err(Failure::Usage(format!(
            "--steps {steps}: {count} images cannot be thinned out evenly to {steps}; give a divisor of {count}"
        )));
    }
    Ok(images.step_by(count / steps).collect())
}

/// What reconstructs images of an input that show the same steps as those of these numbers.
pub(crate) fn reconstructor(
    input: &Input,
    numbers: &[usize],
    measured: &Measured<'_>,
    configuration: &Configuration,
    segment_table: Option<&Path>,
) -> Result<Reconstructor, Failure> {
    let shifts: Vec<f64> = numbers.iter().filter_map(|&n| input.shift_rad(n)).collect();
    let shifts = PhaseShifts::new(&shifts).map_err(|e| input.unusable(&e))?;
    let Measured { rig, volume, pattern } = measured;
    let table = SegmentTable::load_or_build(segment_table, rig, volume, pattern).map_err(|e| match e {
        SegmentFileError::Table(problem) => input.unusable(&problem),
        e => Failure::SegmentFile(e),
    })?;
    Reconstructor::new(rig, table, shifts, configuration.settings).map_err(|e| input.unusable(&e))
}

/// Reconstructs the images of these numbers.
pub(crate) fn reconstruct(
    input: &Input,
    reconstructor: &mut Reconstructor,
    numbers: &[usize],
) -> Result<Reconstruction, Failure> {
    try_reconstruct(input, reconstructor, numbers)?.map_err(|e| input.unusable(&e))
}

/// Reconstructs the images of these numbers; that they yield no cloud is a result.
pub(crate) fn try_reconstruct(
    input: &Input,
    reconstructor: &mut Reconstructor,
    numbers: &[usize],
) -> Result<Result<Reconstruction, ReconstructionError>, Failure> {
    let [cam1, cam2] = input.images(numbers)?;
    let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
    Ok(reconstructor.reconstruct(&cam1, &cam2))
}

/// A resolution by its name.
fn resolution(name: &str) -> Result<ResolutionMethod, String> {
    let known = ResolutionMethod::ALL.into_iter().find(|method| method.name() == name);
    known.ok_or_else(|| format!("{name:?} is no resolution; use semi-global or paper"))
}

/// A number between 0 and 1.
fn probability(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|p| (0.0..=1.0).contains(p));
    number.ok_or_else(|| format!("{text:?} is no probability; give a number between 0 and 1"))
}

/// `A..B` as a range.
pub(crate) fn frames(text: &str) -> Result<Range<usize>, String> {
    let wrong = || format!("{text:?} is no range of images; write 0..4 for the first four");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    Ok(start.parse().map_err(|_| wrong())?..end.parse().map_err(|_| wrong())?)
}

//! The proposed method (PA) on a dataset folder or a recording, as `reconstruct` and `evaluate` run it.

use std::ops::Range;
use std::path::{Path, PathBuf};

use fringeflow::correspondence::{ResolutionMethod, SegmentFileError, SegmentTable};
use fringeflow::geometry::{FringePattern, MeasurementVolume, Rig};
use fringeflow::phase::PhaseShifts;
use fringeflow::prior::{Moment, Prior};
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor};
use fringeflow_config::Configuration;
use fringeflow_dataset::GreyImage;
use fringeflow_telemetry::health::HealthLimits;
use fringeflow_tracking::TrackedStream;
use fringeflow_tracking::fusion::{FusionSettings, Tracker};

use crate::failure::Failure;
use crate::input::Input;
use crate::progress;
use crate::values::one_of;

/// Arguments of the proposed method.
#[derive(clap::Args, Default)]
pub(crate) struct ProposedArgs {
    /// Use N phase images, evenly chosen. By default all are used.
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Use phase images A to B, without B; of a recording, image pairs. More images than a cycle compensate motion. The
    /// default is the first complete cycle, or for known motion the cycle about the moment of the truth, with the images
    /// around it that --extra-images adds.
    #[arg(long, value_name = "A..B", value_parser = frames, conflicts_with = "extra_images")]
    frames: Option<Range<usize>>,
    #[command(flatten)]
    measuring: MeasuringArgs,
}

/// Windows before the one that is asked for, of which it knows: two clouds tell a motion, four more of its noise than of what it
/// changed by.
const WINDOWS_BEFORE: usize = 9;

/// Arguments of how images are measured.
#[derive(clap::Args, Default)]
pub(crate) struct MeasuringArgs {
    /// Image pairs beyond a cycle that compensate motion, 0 to 8. The default is that of the configuration, else 2, with
    /// three steps 3.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(0..=8))]
    extra_images: Option<u8>,
    /// TOML file with settings, see configs/reconstruct.toml. The default is those of the recording.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Use no prior: ignore what earlier windows showed of the motion and the scene.
    #[arg(long)]
    pub(crate) no_prior: bool,
    /// How pixels with several candidates are decided. paper is a slow reference. The default is that of the configuration,
    /// else semi-global.
    #[arg(long, value_name = "METHOD", value_parser = one_of(&ResolutionMethod::ALL, ResolutionMethod::name))]
    resolution: Option<ResolutionMethod>,
    /// Least confidence of a point, 0 to 1. The default is that of the configuration, else 0.8.
    #[arg(long, value_name = "P", value_parser = probability)]
    min_confidence: Option<f32>,
    /// File of the segment table. It is read if it exists, else computed and written.
    #[arg(long, value_name = "FILE")]
    segment_table: Option<PathBuf>,
}

/// What the proposed method made of an input.
pub(crate) struct Proposed {
    pub(crate) reconstruction: Reconstruction,
    /// Middle of its images, counted in those of the input.
    pub(crate) image: f64,
    /// What is as it should be.
    pub(crate) limits: HealthLimits,
}

impl ProposedArgs {
    /// Nothing but a resolution.
    pub(crate) fn with_resolution(method: ResolutionMethod) -> Self {
        let measuring = MeasuringArgs { resolution: Some(method), ..MeasuringArgs::default() };
        Self { measuring, ..Self::default() }
    }

    /// The resolution alone, all else by default.
    pub(crate) fn resolution_alone(&self) -> Self {
        self.measuring.resolution.map_or_else(Self::default, Self::with_resolution)
    }

    /// Reconstructs an input.
    pub(crate) fn reconstruct(&self, input: &Input) -> Result<Proposed, Failure> {
        let configuration = self.measuring.configuration(input)?;
        let chosen = self.images(input, &configuration)?;
        let bar = progress::bar("segment table", 2);
        let reconstructor = self.measuring.reconstructor(input, &chosen, &configuration)?;
        bar.inc(1);
        bar.set_message("correspondences");
        let reconstruction = self.reconstruct_knowing(input, &chosen, &configuration, reconstructor)?;
        let reconstruction = reconstruction.map_err(|e| input.unusable(&e));
        bar.finish_and_clear();
        let image = input.middle(&chosen.numbers);
        Ok(Proposed { reconstruction: reconstruction?, image, limits: configuration.health })
    }

    /// Reconstructs images with what is known of them beforehand: what the recording says, or else what the windows before them
    /// tell.
    fn reconstruct_knowing(
        &self,
        input: &Input,
        chosen: &Images,
        configuration: &Configuration,
        mut reconstructor: Reconstructor,
    ) -> Result<Result<Reconstruction, ReconstructionError>, Failure> {
        if !self.measuring.takes_prior(input, configuration) {
            return try_reconstruct(input, &mut reconstructor, chosen, None);
        }
        let priors = input.priors()?;
        if !priors.is_empty() {
            let settled = priors.last_settled(input.received_ns(&chosen.numbers), &input.times(&chosen.numbers));
            let known = settled.and_then(|(_, prior)| prior);
            return try_reconstruct(input, &mut reconstructor, chosen, known);
        }
        let tracker = Tracker::new(input.setup().rig.cam1.clone(), FusionSettings::default());
        let mut stream = TrackedStream::new(reconstructor, tracker);
        for images in self.windows_before(input, chosen) {
            if let Ok(made) = try_reconstruct_next(input, &mut stream, &images)? {
                stream.track(&made, &input.times(&images.numbers));
            }
        }
        try_reconstruct_next(input, &mut stream, chosen)
    }

    /// The windows that tell what is known of the images beforehand: those just before, each an image pair behind the last; none
    /// where images compensate no motion.
    fn windows_before(&self, input: &Input, chosen: &Images) -> Vec<Images> {
        let (count, first) = (chosen.numbers.len(), chosen.numbers.first().copied().unwrap_or_default());
        if count <= chosen.cycle_rad.len() {
            return Vec::new();
        }
        let starts = (1..=WINDOWS_BEFORE).map_while(|back| {
            let start = first.checked_sub(back)?;
            input.follows(start + 1).then_some(start)
        });
        let mut windows: Vec<Images> =
            starts.filter_map(|start| Images::in_turn(input, start..start + count).ok()).collect();
        windows.reverse();
        windows
    }

    /// The phase images to use.
    fn images(&self, input: &Input, configuration: &Configuration) -> Result<Images, Failure> {
        let (available, steps) = (input.available(), input.setup().steps);
        let Range { start, end } = match &self.frames {
            Some(frames) => frames.clone(),
            None if self.steps.is_some() => input.usual_images(0)?,
            None => input.usual_images(configuration.settings.window_images(steps) - steps)?,
        };
        if start >= end || end > available {
            let what = match input {
                Input::Folder(_) => "dataset has phase images",
                Input::Recording(..) => "recording has image pairs",
            };
            return Err(Failure::Usage(format!(
                "--frames {start}..{end}: the {what} 0..{available}; give a range A..B of these"
            )));
        }
        match self.steps {
            None => Images::in_turn(input, start..end),
            Some(steps) => Images::thinned_out(input, start..end, steps),
        }
    }
}

/// Phase images that make one cloud, by number, in the order of their times.
pub(crate) struct Images {
    pub(crate) numbers: Vec<usize>,
    /// Phase shifts of one cycle, rad; where there are more images than these, the scene may have moved.
    cycle_rad: Vec<f64>,
    /// Place of the first image in the cycle.
    first_step: usize,
}

impl Images {
    /// Images that show the steps of the cycle in turn; fewer than a cycle are one of their own.
    pub(crate) fn in_turn(input: &Input, images: Range<usize>) -> Result<Self, Failure> {
        let (numbers, shifts): (Vec<usize>, Vec<f64>) =
            images.filter_map(|number| Some((number, input.shift_rad(number)?))).unzip();
        let cycle_rad = input.setup().cycle_shifts_rad();
        if numbers.len() < cycle_rad.len() {
            return Ok(Self { numbers, cycle_rad: shifts, first_step: 0 });
        }
        let first_step = cycle_rad.iter().position(|shift| Some(shift) == shifts.first()).unwrap_or(0);
        match shifts.iter().zip(cycle_rad.iter().cycle().skip(first_step)).position(|(shift, next)| shift != next) {
            None => Ok(Self { numbers, cycle_rad: cycle_rad.to_vec(), first_step }),
            Some(place) => Err(input.unusable(&format!(
                "image {} has a phase shift of {} rad, which is not the next of its cycle; give --frames that show the \
                 steps in order",
                numbers[place], shifts[place]
            ))),
        }
    }

    /// So many images, evenly chosen, as a cycle of their own.
    pub(crate) fn thinned_out(input: &Input, images: Range<usize>, steps: usize) -> Result<Self, Failure> {
        let count = images.len();
        if steps == 0 || !count.is_multiple_of(steps) {
            return Err(Failure::Usage(format!(
                "--steps {steps}: {count} images cannot be thinned out evenly; give a divisor of {count}"
            )));
        }
        let numbers: Vec<usize> = images.step_by(count / steps).collect();
        let cycle_rad = numbers.iter().filter_map(|&number| input.shift_rad(number)).collect();
        Ok(Self { numbers, cycle_rad, first_step: 0 })
    }
}

impl MeasuringArgs {
    /// The settings of the file, or else those recorded with the input, and what the arguments change of them.
    pub(crate) fn configuration(&self, input: &Input) -> Result<Configuration, Failure> {
        let mut configuration = configuration(self.config.as_deref(), input)?;
        if let Some(method) = self.resolution {
            configuration.settings.matching.method = method;
        }
        if let Some(min_confidence) = self.min_confidence {
            configuration.settings.matching.min_confidence = min_confidence;
        }
        if let Some(extra) = self.extra_images {
            configuration.settings.extra_images = Some(usize::from(extra));
        }
        Ok(configuration)
    }

    /// Whether a window is given what those before it tell: as the recording was made, and of dataset folders.
    pub(crate) fn takes_prior(&self, input: &Input, configuration: &Configuration) -> bool {
        !self.no_prior && (configuration.tracking.takes_priors() || matches!(input, Input::Folder(_)))
    }

    /// What reconstructs images that show the same steps as these.
    pub(crate) fn reconstructor(
        &self,
        input: &Input,
        images: &Images,
        configuration: &Configuration,
    ) -> Result<Reconstructor, Failure> {
        let setup = input.setup();
        let volume = configuration.volume.clone().or_else(|| setup.volume.clone()).ok_or_else(|| {
            input.unusable(&"there is no measurement volume; give one with --config (key measurement_volume)")
        })?;
        let measured = Measured { rig: &setup.rig, volume: &volume, pattern: &setup.sequence.pattern };
        reconstructor(input, images, &measured, configuration, self.segment_table.as_deref())
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

/// What reconstructs images of an input that show the same steps as these.
pub(crate) fn reconstructor(
    input: &Input,
    images: &Images,
    measured: &Measured<'_>,
    configuration: &Configuration,
    segment_table: Option<&Path>,
) -> Result<Reconstructor, Failure> {
    let shifts = PhaseShifts::new(&images.cycle_rad).map_err(|e| input.unusable(&e))?;
    let Measured { rig, volume, pattern } = measured;
    let table = SegmentTable::load_or_build(segment_table, rig, volume, pattern).map_err(|e| match e {
        SegmentFileError::Table(problem) => input.unusable(&problem),
        e => Failure::SegmentFile(e),
    })?;
    Reconstructor::new(rig, pattern, table, &shifts, configuration.settings).map_err(|e| input.unusable(&e))
}

/// Reconstructs these images.
pub(crate) fn reconstruct(
    input: &Input,
    reconstructor: &mut Reconstructor,
    images: &Images,
) -> Result<Reconstruction, Failure> {
    try_reconstruct(input, reconstructor, images, None)?.map_err(|e| input.unusable(&e))
}

/// Reconstructs these images; that they yield no cloud is a result.
fn try_reconstruct(
    input: &Input,
    reconstructor: &mut Reconstructor,
    images: &Images,
    known: Option<(&Prior, Moment)>,
) -> Result<Result<Reconstruction, ReconstructionError>, Failure> {
    let [cam1, cam2] = input.images(&images.numbers)?;
    let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
    Ok(reconstructor.reconstruct(images.first_step, &cam1, &cam2, known))
}

/// Reconstructs the next images of a stream; that they yield no cloud is a result.
pub(crate) fn try_reconstruct_next(
    input: &Input,
    stream: &mut TrackedStream,
    images: &Images,
) -> Result<Result<Reconstruction, ReconstructionError>, Failure> {
    let [cam1, cam2] = input.images(&images.numbers)?;
    let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
    Ok(stream.reconstruct(images.first_step, &cam1, &cam2, &input.times(&images.numbers)))
}

/// A number between 0 and 1.
fn probability(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|p| (0.0..=1.0).contains(p));
    number.ok_or_else(|| format!("{text:?} is not a probability; give a number from 0 to 1"))
}

/// `A..B` as a range.
pub(crate) fn frames(text: &str) -> Result<Range<usize>, String> {
    let wrong = || format!("{text:?} is not a range; write 0..4 for the first four");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    Ok(start.parse().map_err(|_| wrong())?..end.parse().map_err(|_| wrong())?)
}

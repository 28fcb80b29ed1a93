//! The proposed method (PA) on a dataset folder or a recording, as `reconstruct` and `evaluate` run it.

use std::io::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use fringeflow::correspondence::{Matches, ResolutionMethod, SegmentFileError, SegmentTable};
use fringeflow::geometry::{FringePattern, MeasurementVolume, Rig};
use fringeflow::phase::{PhaseMap, PhaseShifts};
use fringeflow::prior::{Moment, Prior};
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor};
use fringeflow::worker::PhasePair;
use fringeflow_config::Configuration;
use fringeflow_dataset::GreyImage;
use fringeflow_telemetry::HealthFigures;
use fringeflow_tracking::TrackedStream;
use fringeflow_tracking::fusion::{FusionSettings, Tracker};
use fringeflow_wire::health::health_measures;
use fringeflow_wire::maps::fit;

use crate::diagnosis::{self, Described};
use crate::failure::Failure;
use crate::image_health::image_health;
use crate::images::Images;
use crate::input::Input;
use crate::progress;
use crate::statistics::faults;
use crate::values::one_of;

/// Arguments of the proposed method.
#[derive(clap::Args, Default)]
pub(crate) struct ProposedArgs {
    /// Use N of the phase images, evenly spaced. The default is all.
    #[arg(long, value_name = "N", conflicts_with = "extra_images")]
    steps: Option<usize>,
    /// Use phase images A to B, without B; for a recording, image pairs. More images than a cycle compensate motion.
    /// The default is the first complete cycle, or with known motion the cycle around the time of the truth, and the
    /// images that --extra-images adds around it.
    #[arg(long, value_name = "A..B", value_parser = parse_range, conflicts_with = "extra_images")]
    frames: Option<Range<usize>>,
    #[command(flatten)]
    measuring: MeasuringArgs,
}

/// Identifiers of these arguments.
pub(crate) const PROPOSED_OPTIONS: &[&str] =
    &["steps", "frames", "extra_images", "config", "no_prior", "resolution", "min_confidence", "segment_table"];

/// Number of windows before the requested one from which its prior is computed. Two clouds give a motion of the
/// scanner; further clouds reduce its noise.
const PRECEDING_WINDOWS: usize = 9;

/// Options for the reconstruction of a window of images.
#[derive(clap::Args, Default)]
pub(crate) struct MeasuringArgs {
    /// Image pairs beyond a cycle that compensate motion, 0 to 8. The default is that of the configuration, else 2, or
    /// 3 with three steps.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(0..=8))]
    extra_images: Option<u8>,
    /// TOML file with settings, see configs/reconstruct.toml. The default is the settings of the recording.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Use no prior: ignore what earlier windows showed of motion and scene.
    #[arg(long)]
    pub(crate) no_prior: bool,
    /// Standard deviation of δ that is taken as known.
    #[arg(skip)]
    known_sd_rad: Option<f64>,
    /// Method that decides pixels with several candidates. moments judges δ over whole surfaces; paper is a slow
    /// reference. The default is that of the configuration, else moments.
    #[arg(long, value_name = "METHOD", value_parser = one_of(&ResolutionMethod::ALL, ResolutionMethod::name))]
    resolution: Option<ResolutionMethod>,
    /// Minimum confidence of a point, 0 to 1. The default is that of the configuration, else 0.8.
    #[arg(long, value_name = "P", value_parser = parse_probability)]
    min_confidence: Option<f32>,
    /// File of the segment table. It is read if it exists, else computed and written.
    #[arg(long, value_name = "FILE")]
    segment_table: Option<PathBuf>,
}

/// Result of the proposed method.
pub(crate) struct ProposedOutput {
    pub(crate) reconstruction: Reconstruction,
    /// Mean number of its images, as the input numbers them.
    pub(crate) middle_image: f64,
    /// The health quantities of the images and the result.
    pub(crate) health: HealthFigures,
    /// What seems to be wrong in calibration, pattern or images.
    pub(crate) likely_cause: Option<String>,
}

impl ProposedArgs {
    /// The resolution method that the options ask for, else the default one.
    pub(crate) fn resolution(&self) -> ResolutionMethod {
        self.measuring.resolution.unwrap_or_default()
    }

    /// Default options with this resolution.
    pub(crate) fn with_resolution(method: ResolutionMethod) -> Self {
        let measuring = MeasuringArgs { resolution: Some(method), ..MeasuringArgs::default() };
        Self { measuring, ..Self::default() }
    }

    /// These options with a known standard deviation of δ, rad.
    pub(crate) fn with_known_sd(mut self, sd_rad: f64) -> Self {
        self.measuring.known_sd_rad = Some(sd_rad);
        self
    }

    /// Reconstructs an input.
    pub(crate) fn reconstruct(&self, input: &Input) -> Result<ProposedOutput, Failure> {
        let configuration = self.measuring.configuration(input)?;
        let chosen = self.images(input, &configuration)?;
        let bar = progress::bar("segment table", 2);
        let reconstructor = self.measuring.reconstructor(input, &chosen, &configuration)?;
        bar.inc(1);
        bar.set_message("correspondences");
        let reconstruction = self.reconstruct_with_prior(input, &chosen, &configuration, reconstructor)?;
        bar.finish_and_clear();
        self.judge(input, &chosen, &configuration, reconstruction)
    }

    /// Judges a result by the health of its images, and tells what seems to be wrong if there is little or none.
    fn judge(
        &self,
        input: &Input,
        chosen: &Images,
        configuration: &Configuration,
        result: Result<Reconstruction, ReconstructionError>,
    ) -> Result<ProposedOutput, Failure> {
        let limits = &configuration.health;
        match result {
            Ok(reconstruction) => {
                let Reconstruction { cam1, cam2, matches, .. } = &reconstruction;
                let fits = [cam1, cam2].map(fit);
                let measures = health_measures([&fits[0], &fits[1]], 0, matches, true);
                let measuring = &self.measuring;
                let likely_cause = measuring.likely_cause(input, chosen, configuration, [cam1, cam2], Some(matches))?;
                let health = HealthFigures::of_window(&measures, limits);
                let middle_image = input.middle_image(&chosen.numbers);
                Ok(ProposedOutput { reconstruction, middle_image, health, likely_cause })
            }
            Err(ReconstructionError::Images(error)) => Err(input.unusable(&error)),
            Err(ReconstructionError::Match(error)) => {
                let mut reconstructor = self.measuring.reconstructor(input, chosen, configuration)?;
                let maps = decode(input, &mut reconstructor, chosen)?;
                let cameras = [&maps.cam1, &maps.cam2];
                let likely_cause = self.measuring.likely_cause(input, chosen, configuration, cameras, None)?;
                let faults = faults(&image_health(&maps, limits), likely_cause.as_deref());
                let lines: Vec<String> = faults.into_iter().chain([error.to_string()]).collect();
                Err(input.unusable(&lines.join("\n")))
            }
        }
    }

    /// Reconstructs images with their recorded prior, or else with one computed from the windows before them. The inner
    /// error means that the images yield no cloud.
    fn reconstruct_with_prior(
        &self,
        input: &Input,
        chosen: &Images,
        configuration: &Configuration,
        mut reconstructor: Reconstructor,
    ) -> Result<Result<Reconstruction, ReconstructionError>, Failure> {
        if !self.measuring.uses_priors(input, configuration) {
            return try_reconstruct(input, &mut reconstructor, chosen, None);
        }
        let priors = input.priors()?;
        if !priors.is_empty() {
            let settled = priors.last_settled(input.received_ns(&chosen.numbers), &input.times(&chosen.numbers));
            let prior = settled.and_then(|(_, prior)| prior);
            return try_reconstruct(input, &mut reconstructor, chosen, prior);
        }
        let tracker = Tracker::new(input.setup().rig.cam1, FusionSettings::default());
        let mut stream = TrackedStream::new(reconstructor, tracker);
        for images in self.preceding_windows(input, chosen) {
            if let Ok(reconstruction) = try_reconstruct_next(input, &mut stream, &images)? {
                stream.track(&reconstruction, &input.times(&images.numbers));
            }
        }
        try_reconstruct_next(input, &mut stream, chosen)
    }

    /// The windows just before the chosen images, each one image pair after the other, oldest first. None if the chosen
    /// images are at most a cycle, which compensates no motion.
    fn preceding_windows(&self, input: &Input, chosen: &Images) -> Vec<Images> {
        let (count, first) = (chosen.numbers.len(), chosen.numbers.first().copied().unwrap_or_default());
        if count <= chosen.cycle_rad.len() {
            return Vec::new();
        }
        let starts = (1..=PRECEDING_WINDOWS).map_while(|back| {
            let start = first.checked_sub(back)?;
            input.follows(start + 1).then_some(start)
        });
        let mut windows: Vec<Images> =
            starts.filter_map(|start| Images::consecutive(input, start..start + count).ok()).collect();
        windows.reverse();
        windows
    }

    /// The phase images to use.
    fn images(&self, input: &Input, configuration: &Configuration) -> Result<Images, Failure> {
        let (available, steps) = (input.pair_count(), input.setup().steps);
        let Range { start, end } = match &self.frames {
            Some(frames) => frames.clone(),
            None if self.steps.is_some() => input.default_images(0)?,
            None => input.default_images(configuration.settings.window_images(steps) - steps)?,
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
            None => Images::consecutive(input, start..end),
            Some(steps) => Images::evenly_spaced(input, start..end, steps),
        }
    }
}

impl MeasuringArgs {
    /// The settings of the file, or else those of the input, changed by the other options.
    pub(crate) fn configuration(&self, input: &Input) -> Result<Configuration, Failure> {
        let mut configuration = read_configuration(self.config.as_deref(), input)?;
        if let Some(file) = self.config.as_deref().filter(|_| is_recorded(&configuration, input)) {
            // A failure is ignored: the note has no other place, and the result is right without it.
            let _ = writeln!(
                std::io::stderr(),
                "fringeflow: --config {} changes nothing: its settings equal those of {}",
                file.display(),
                input.path().display()
            );
        }
        if let Some(method) = self.resolution {
            configuration.settings.matching.method = method;
        }
        if self.known_sd_rad.is_some() {
            configuration.settings.matching.delta_sd_rad = self.known_sd_rad;
        }
        if let Some(min_confidence) = self.min_confidence {
            if configuration.settings.matching.method == ResolutionMethod::Paper {
                return Err(Failure::Usage(format!(
                    "--min-confidence {min_confidence} has no effect with the resolution paper, which states no \
                     confidence: leave it out, or use --resolution moments"
                )));
            }
            configuration.settings.matching.min_confidence = min_confidence;
        }
        if let Some(extra) = self.extra_images {
            configuration.settings.extra_images = Some(usize::from(extra));
        }
        Ok(configuration)
    }

    /// Whether windows use a prior: always for a dataset folder, for a recording if its configuration provides priors.
    /// `--no-prior` switches them off.
    pub(crate) fn uses_priors(&self, input: &Input, configuration: &Configuration) -> bool {
        !self.no_prior && (configuration.tracking.takes_priors() || matches!(input, Input::Folder(_)))
    }

    /// A reconstructor for images with the same steps as these.
    pub(crate) fn reconstructor(
        &self,
        input: &Input,
        images: &Images,
        configuration: &Configuration,
    ) -> Result<Reconstructor, Failure> {
        let (setup, volume) = (input.setup(), volume(input, configuration)?);
        let geometry = Geometry { rig: &setup.rig, volume: &volume, pattern: &setup.sequence.pattern };
        reconstructor(input, images, &geometry, configuration, self.segment_table.as_deref())
    }
}

impl MeasuringArgs {
    /// What seems to be wrong in calibration, pattern or images, if they yield no result or a poor one.
    fn likely_cause(
        &self,
        input: &Input,
        images: &Images,
        configuration: &Configuration,
        maps: [&PhaseMap; 2],
        matches: Option<&Matches>,
    ) -> Result<Option<String>, Failure> {
        let shifts = PhaseShifts::new(&images.cycle_rad).map_err(|e| input.unusable(&e))?;
        let setup = input.setup();
        let described = Described {
            rig: &setup.rig,
            volume: &volume(input, configuration)?,
            pattern: &setup.sequence.pattern,
            shifts: &shifts,
            settings: configuration.settings.matching,
        };
        Ok(diagnosis::likely_cause(&described, maps, matches))
    }
}

/// The measurement volume of the settings, or else of the input.
fn volume(input: &Input, configuration: &Configuration) -> Result<MeasurementVolume, Failure> {
    configuration.volume.or(input.setup().volume).ok_or_else(|| {
        input.unusable(&"there is no measurement volume; give one with --config (key measurement_volume)")
    })
}

/// Geometry of a measurement.
pub(crate) struct Geometry<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) volume: &'a MeasurementVolume,
    pub(crate) pattern: &'a FringePattern,
}

/// Whether a recording was made with settings that measure the same.
fn is_recorded(configuration: &Configuration, input: &Input) -> bool {
    let measuring = |c: &Configuration| {
        (c.settings, c.volume.or(input.setup().volume), c.health.clone(), c.tracking.takes_priors())
    };
    let recorded = || input.configuration().ok();
    matches!(input, Input::Recording(..)) && recorded().is_some_and(|r| measuring(&r) == measuring(configuration))
}

/// Reads the settings of a file, or else those of the input.
pub(crate) fn read_configuration(file: Option<&Path>, input: &Input) -> Result<Configuration, Failure> {
    file.map_or_else(|| input.configuration(), |file| Ok(Configuration::read(file)?))
}

/// A reconstructor for images of an input with the same steps as these.
pub(crate) fn reconstructor(
    input: &Input,
    images: &Images,
    geometry: &Geometry<'_>,
    configuration: &Configuration,
    segment_table: Option<&Path>,
) -> Result<Reconstructor, Failure> {
    let shifts = PhaseShifts::new(&images.cycle_rad).map_err(|e| input.unusable(&e))?;
    let Geometry { rig, volume, pattern } = geometry;
    let table = SegmentTable::load_or_build(segment_table, rig, volume, pattern).map_err(|e| match e {
        SegmentFileError::Table(problem) => input.unusable(&problem),
        e => Failure::SegmentFile(e),
    })?;
    Reconstructor::new(rig, pattern, table, &shifts, configuration.settings).map_err(|e| input.unusable(&e))
}

/// Reconstructs these images without a prior.
pub(crate) fn reconstruct(
    input: &Input,
    reconstructor: &mut Reconstructor,
    images: &Images,
) -> Result<Reconstruction, Failure> {
    try_reconstruct(input, reconstructor, images, None)?.map_err(|e| input.unusable(&e))
}

/// Reconstructs these images. The inner error means that they yield no cloud.
fn try_reconstruct(
    input: &Input,
    reconstructor: &mut Reconstructor,
    images: &Images,
    prior: Option<(&Prior, Moment)>,
) -> Result<Result<Reconstruction, ReconstructionError>, Failure> {
    let [cam1, cam2] = input.images(&images.numbers)?;
    let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
    Ok(reconstructor.reconstruct(images.first_step, &cam1, &cam2, prior))
}

/// Decodes the phase of these images.
fn decode(input: &Input, reconstructor: &mut Reconstructor, images: &Images) -> Result<PhasePair, Failure> {
    let [cam1, cam2] = input.images(&images.numbers)?;
    let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
    reconstructor.decode(images.first_step, &cam1, &cam2, None).map_err(|e| input.unusable(&e))
}

/// Reconstructs the next images of a stream. The inner error means that they yield no cloud.
pub(crate) fn try_reconstruct_next(
    input: &Input,
    stream: &mut TrackedStream,
    images: &Images,
) -> Result<Result<Reconstruction, ReconstructionError>, Failure> {
    let [cam1, cam2] = input.images(&images.numbers)?;
    let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
    Ok(stream.reconstruct(images.first_step, &cam1, &cam2, &input.times(&images.numbers)))
}

/// Parses a number from 0 to 1.
fn parse_probability(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|p| (0.0..=1.0).contains(p));
    number.ok_or_else(|| format!("{text:?} is not a probability; give a number from 0 to 1"))
}

/// Parses a range written as `A..B`.
pub(crate) fn parse_range(text: &str) -> Result<Range<usize>, String> {
    let wrong = || format!("{text:?} is not a range; write 0..4 for the first four");
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    Ok(start.parse().map_err(|_| wrong())?..end.parse().map_err(|_| wrong())?)
}

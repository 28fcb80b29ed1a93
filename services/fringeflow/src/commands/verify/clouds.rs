//! The clouds of an input, one after the other: recorded ones, computed ones, or that of a file.

use std::f64::consts::TAU;
use std::path::Path;

use fringeflow::cloud::Cloud;
use fringeflow::geometry::{Point3, Rig};
use fringeflow_dataset::Setup;
use fringeflow_lab::artefact::{MeasuredPoints, Views};
use fringeflow_recording::{Recording, Topic};
use fringeflow_tracking::TrackedStream;
use fringeflow_tracking::fusion::{FusionSettings, Tracker};

use crate::failure::Failure;
use crate::images::Images;
use crate::input::Input;
use crate::output_folder::has_extension;
use crate::progress;
use crate::proposed::try_reconstruct_next;

use super::{Args, cloud_file};

/// A cloud to measure.
pub(super) struct TimedCloud {
    /// Its number: of the clouds of a recording, or of its first image pair.
    pub(super) number: usize,
    /// Time since the first exposure of the recording, seconds.
    pub(super) time_s: Option<f64>,
    /// The points, or why there are none.
    pub(super) points: Result<Points, String>,
}

/// Points with the phase of the fringes on them.
pub(super) struct Points {
    points_m: Vec<Point3>,
    views: Views,
    /// Phases, rad, and number of steps.
    fringes: Option<(Vec<f64>, usize)>,
    /// Points of the file without coordinates.
    pub(super) skipped: usize,
}

impl Points {
    fn of_cloud(cloud: &Cloud, setup: &Setup) -> Self {
        let points_m: Vec<Point3> = cloud.points.iter().map(|point| point.position_m.map(f64::from).into()).collect();
        let phases = phases_rad(&points_m, &setup.rig, setup.sequence.pattern.period_px);
        Self { fringes: phases.map(|phases| (phases, setup.steps)), points_m, views: Views::Cam1, skipped: 0 }
    }

    pub(super) fn measured(&self) -> MeasuredPoints<'_> {
        let fringes = self.fringes.as_ref().map(|(phases, steps)| (phases.as_slice(), *steps));
        MeasuredPoints { points_m: &self.points_m, views: self.views, fringes }
    }
}

/// Phase of the fringes at each point, rad; `None` if the projector does not light a point.
fn phases_rad(points_m: &[Point3], rig: &Rig, period_px: f64) -> Option<Vec<f64>> {
    points_m.iter().map(|point| Some(TAU * rig.project_projector(point)?.x / period_px)).collect()
}

/// How the clouds were made, for people.
#[derive(Clone, Copy, Debug, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Origin {
    Recorded,
    Computed,
    File,
}

impl Args {
    /// Gives each chosen cloud to `each`, in the order of time.
    pub(super) fn for_each_cloud(&self, mut each: impl FnMut(TimedCloud)) -> Result<Origin, Failure> {
        if self.is_cloud_file() {
            let file = cloud_file::read(&self.input, self.units)?;
            let points = Points { points_m: file.points_m, views: file.views, fringes: None, skipped: file.skipped };
            each(TimedCloud { number: 0, time_s: None, points: Ok(points) });
            return Ok(Origin::File);
        }
        let input = Input::open(&self.input, self.units)?;
        input.check_unit(self.units)?;
        match &input {
            Input::Recording(recording, _) if !self.recompute => {
                self.recorded(&input, recording, each)?;
                Ok(Origin::Recorded)
            }
            _ => {
                self.computed(&input, each)?;
                Ok(Origin::Computed)
            }
        }
    }

    /// Whether the input is the file of a cloud.
    pub(super) fn is_cloud_file(&self) -> bool {
        has_extension(Path::new(&self.input), "ply")
    }

    fn recorded(&self, input: &Input, recording: &Recording, mut each: impl FnMut(TimedCloud)) -> Result<(), Failure> {
        if recording.count(Topic::Cloud) == 0 {
            return Err(input.unusable(&"it has no clouds; give --recompute to compute them from its images"));
        }
        let headers: Vec<_> = recording.cloud_headers().map(|header| header.window.centre_ns).collect();
        let bar = progress::bar("clouds", headers.len().div_ceil(self.every.get()) as u64);
        for (number, centre_ns) in headers.into_iter().enumerate().step_by(self.every.get()) {
            let points = match recording.cloud(number)? {
                Some(cloud) => Ok(Points::of_cloud(&cloud, recording.setup())),
                None => Err("the cloud is not in the recording".to_owned()),
            };
            each(TimedCloud { number, time_s: Some(input.seconds_since_first(centre_ns)), points });
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(())
    }

    fn computed(&self, input: &Input, mut each: impl FnMut(TimedCloud)) -> Result<(), Failure> {
        let configuration = self.measuring.configuration(input)?;
        let steps = input.setup().steps;
        let images = configuration.settings.window_images(steps);
        let chosen = match input {
            Input::Folder(_) => vec![input.default_images(images - steps)?],
            Input::Recording(..) => {
                input.windows(&(0..input.pair_count()), images, steps.saturating_mul(self.every.get()))
            }
        };
        let windows: Vec<Images> =
            chosen.into_iter().map(|window| Images::consecutive(input, window)).collect::<Result<_, _>>()?;
        let Some(first) = windows.first() else {
            let count = input.pair_count();
            return Err(input.unusable(&format!("{count} image pairs hold no complete window of {images}")));
        };
        let reconstructor = self.measuring.reconstructor(input, first, &configuration)?;
        let tracker = Tracker::new(input.setup().rig.cam1, FusionSettings::default());
        let mut stream = TrackedStream::new(reconstructor, tracker).with_priors(!self.measuring.no_prior);
        let bar = progress::bar("clouds", windows.len() as u64);
        for images in &windows {
            let times = input.times(&images.numbers);
            let points = match try_reconstruct_next(input, &mut stream, images)? {
                Ok(reconstruction) => {
                    stream.track(&reconstruction, &times);
                    Ok(Points::of_cloud(&reconstruction.cloud, input.setup()))
                }
                Err(error) => Err(error.to_string()),
            };
            let time_s = matches!(input, Input::Recording(..)).then(|| input.seconds_since_first(times.centre_ns()));
            each(TimedCloud { number: images.numbers.first().copied().unwrap_or_default(), time_s, points });
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(())
    }
}

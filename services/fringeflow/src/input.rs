//! Input of the reconstruction: the phase images of a dataset folder or of a recording, by number.

use std::ops::Range;
use std::path::Path;

use fringeflow::calibration::Unit;
use fringeflow::prior::WindowTimes;
use fringeflow_config::Configuration;
use fringeflow_dataset::{CameraId, Dataset, GreyImage, Setup, Truth};
use fringeflow_recording::{ImagePair, Priors, Recording, TruthPoses, cycle_starts, window_starts};

use crate::failure::Failure;

/// Assumed time between two images of a folder. Only their order matters.
const FOLDER_SPACING_NS: u64 = 10_000_000;

/// An opened input.
pub(crate) enum Input {
    /// A dataset folder.
    Folder(Box<Dataset>),
    /// A recording, and its image pairs in the order of their exposures.
    Recording(Box<Recording>, Vec<ImagePair>),
}

impl Input {
    /// Opens a folder or a recording. `unit` applies if a folder does not state one.
    pub(crate) fn open(path: &Path, unit: Option<Unit>) -> Result<Self, Failure> {
        if !path.is_file() {
            return Ok(Self::Folder(Box::new(Dataset::open(path, unit)?)));
        }
        let recording = Recording::open(path)?;
        let pairs = fringeflow_replay::pairs(&recording)?;
        Ok(Self::Recording(Box::new(recording), pairs))
    }

    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::Folder(dataset) => &dataset.folder,
            Self::Recording(recording, _) => recording.path(),
        }
    }

    pub(crate) fn setup(&self) -> &Setup {
        match self {
            Self::Folder(dataset) => &dataset.setup,
            Self::Recording(recording, _) => recording.setup(),
        }
    }

    /// Checks the unit of --units against the unit that the input states.
    ///
    /// # Errors
    /// They contradict each other.
    pub(crate) fn check_unit(&self, unit: Option<Unit>) -> Result<(), Failure> {
        let (stated, Some(given)) = (self.setup().unit, unit) else { return Ok(()) };
        if stated == given {
            return Ok(());
        }
        let (stated, given) = (stated.symbol(), given.symbol());
        Err(self.unusable(&format!("--units {given} contradicts the unit {stated} that it states; leave --units out")))
    }

    /// The default settings: those of the recording, or the built-in ones for a folder.
    pub(crate) fn configuration(&self) -> Result<Configuration, Failure> {
        match self {
            Self::Folder(_) => Ok(Configuration::default()),
            Self::Recording(recording, _) => Ok(fringeflow_replay::configuration(recording)?),
        }
    }

    /// The truth of the scene; `None` if it is unknown.
    pub(crate) fn truth(&self) -> Result<Option<Truth>, Failure> {
        match self {
            Self::Folder(dataset) => Ok(dataset.truth()?),
            Self::Recording(recording, _) => Ok(recording.truth()?),
        }
    }

    /// The dataset folder, for methods that need Gray-code images.
    ///
    /// # Errors
    /// The input is a recording, which has only phase images.
    pub(crate) fn folder(&self) -> Result<&Dataset, Failure> {
        match self {
            Self::Folder(dataset) => Ok(dataset),
            Self::Recording(..) => {
                Err(self.unusable(&"a recording has no Gray-code images; give the dataset folder that has them"))
            }
        }
    }

    /// Number of image pairs.
    pub(crate) fn pair_count(&self) -> usize {
        match self {
            Self::Folder(dataset) => dataset.setup.sequence.shifts_rad.len(),
            Self::Recording(_, pairs) => pairs.len(),
        }
    }

    /// The default image pairs: a cycle and `extra` more, or fewer if the input lacks them. If the motion of the object
    /// is known, they are those around the time of the truth. Otherwise they are the first complete cycle and the pairs
    /// around it.
    pub(crate) fn default_images(&self, extra: usize) -> Result<Range<usize>, Failure> {
        if self.setup().motion.is_some() {
            let wanted = self.setup().reference_images(self.setup().steps + extra);
            let start = (0..self.pair_count()).find(|&n| self.image_number(n) == Some(wanted.start as u64));
            let found = start.map(|start| start..start + wanted.len());
            // A recording may lack some of these images.
            let is_complete = |found: &Range<usize>| {
                found.clone().map(|n| self.image_number(n)).eq(wanted.clone().map(|k| Some(k as u64)))
            };
            if let Some(found) = found.filter(is_complete) {
                return Ok(found);
            }
        }
        Ok(self.widened(self.cycles()?.swap_remove(0), extra))
    }

    /// Mean image number of some image pairs, as the description of the input numbers its images.
    pub(crate) fn middle_image(&self, numbers: &[usize]) -> f64 {
        let images: Vec<f64> = numbers.iter().filter_map(|&n| self.image_number(n)).map(|image| image as f64).collect();
        images.iter().sum::<f64>() / images.len().max(1) as f64
    }

    /// Number of an image pair in the description of the input; in a recording, its sequence number.
    fn image_number(&self, number: usize) -> Option<u64> {
        match self {
            Self::Folder(_) => (number < self.pair_count()).then_some(number as u64),
            Self::Recording(_, pairs) => pairs.get(number).map(|pair| pair.cam1.sequence),
        }
    }

    /// The image pairs of all complete cycles, at least one; for a folder only the first cycle.
    ///
    /// # Errors
    /// The recording has no complete cycle.
    pub(crate) fn cycles(&self) -> Result<Vec<Range<usize>>, Failure> {
        let steps = self.setup().steps;
        let starts = match self {
            Self::Folder(_) => vec![0],
            Self::Recording(_, pairs) => cycle_starts(pairs, steps).collect(),
        };
        if starts.is_empty() {
            let what = format!("its {} image pairs hold no complete cycle of {steps} steps", self.pair_count());
            return Err(self.unusable(&what));
        }
        Ok(starts.into_iter().map(|start| start..start + steps).collect())
    }

    /// Extends a cycle by `extra` image pairs, half of them before it if possible; by fewer if the input lacks them.
    pub(crate) fn widened(&self, cycle: Range<usize>, extra: usize) -> Range<usize> {
        let Range { mut start, mut end } = cycle;
        let wanted = end - start + extra;
        let mut before = extra / 2;
        loop {
            let (can_start, can_end) = (start > 0 && self.follows(start), self.follows(end));
            let extends_start = can_start && (before > 0 || !can_end);
            if end - start >= wanted || !(extends_start || can_end) {
                return start..end;
            }
            if extends_start {
                (start, before) = (start - 1, before.saturating_sub(1));
            } else {
                end += 1;
            }
        }
    }

    /// The recorded priors; none for a folder.
    pub(crate) fn priors(&self) -> Result<Priors, Failure> {
        match self {
            Self::Folder(_) => Ok(Priors::default()),
            Self::Recording(recording, _) => Ok(recording.priors()?),
        }
    }

    /// Arrival time of the last of some image pairs, nanoseconds; 0 for a folder.
    pub(crate) fn received_ns(&self, numbers: &[usize]) -> u64 {
        let Self::Recording(_, pairs) = self else { return 0 };
        let pairs = numbers.iter().filter_map(|&number| pairs.get(number));
        pairs.map(|pair| pair.cam1.received_ns.max(pair.cam2.received_ns)).max().unwrap_or_default()
    }

    /// Exposure times of some image pairs; those of a folder are taken to be [`FOLDER_SPACING_NS`] apart.
    pub(crate) fn times(&self, numbers: &[usize]) -> WindowTimes {
        let time = |number: usize| self.exposure_ns(number).unwrap_or(number as u64 * FOLDER_SPACING_NS);
        let times = || numbers.iter().map(|&number| time(number));
        let exposures_ns = [times().min().unwrap_or_default(), times().max().unwrap_or_default()];
        WindowTimes { exposures_ns, images: numbers.len() }
    }

    /// Whether an image pair directly follows the previous one.
    pub(crate) fn follows(&self, number: usize) -> bool {
        let (steps, Some(before)) = (self.setup().steps, number.checked_sub(1)) else { return false };
        match self {
            Self::Folder(dataset) => {
                let shifts = &dataset.setup.sequence.shifts_rad;
                number < shifts.len() && shifts.get(number % steps.max(1)) == shifts.get(number)
            }
            Self::Recording(_, pairs) => {
                pairs.get(number).zip(pairs.get(before)).is_some_and(|(pair, before)| pair.follows(before, steps))
            }
        }
    }

    /// The complete windows of `images` image pairs within a range, their starts at least `every` pairs apart. For a
    /// folder the range itself is the only window.
    pub(crate) fn windows(&self, within: &Range<usize>, images: usize, every: usize) -> Vec<Range<usize>> {
        let Self::Recording(_, pairs) = self else { return vec![within.clone()] };
        let mut next = within.start;
        let mut found = Vec::new();
        for start in window_starts(pairs, self.setup().steps, images).filter(|start| start + images <= within.end) {
            if start >= next {
                found.push(start..start + images);
                next = start + every;
            }
        }
        found
    }

    /// Start of the exposure of an image pair after that of the first, seconds; `None` for a folder.
    pub(crate) fn exposure_s(&self, number: usize) -> Option<f64> {
        Some(self.seconds_since_first(self.exposure_ns(number)?))
    }

    /// Time since the start of the first exposure, seconds.
    pub(crate) fn seconds_since_first(&self, time_ns: u64) -> f64 {
        time_ns.saturating_sub(self.exposure_ns(0).unwrap_or_default()) as f64 * 1e-9
    }

    /// Start of the exposure of an image pair, nanoseconds; `None` for a folder.
    pub(crate) fn exposure_ns(&self, number: usize) -> Option<u64> {
        let Self::Recording(_, pairs) = self else { return None };
        Some(pairs.get(number)?.cam1.exposure_start_ns)
    }

    /// The true poses of the object; empty if they are unknown.
    pub(crate) fn truth_poses(&self) -> Result<TruthPoses, Failure> {
        match self {
            Self::Folder(_) => Ok(TruthPoses::default()),
            Self::Recording(recording, _) => Ok(recording.truth_poses()?),
        }
    }

    /// Phase shift of an image pair, rad.
    pub(crate) fn shift_rad(&self, number: usize) -> Option<f64> {
        let shifts = &self.setup().sequence.shifts_rad;
        match self {
            Self::Folder(_) => shifts.get(number).copied(),
            Self::Recording(_, pairs) => shifts.get(pairs.get(number)?.step).copied(),
        }
    }

    /// The images of both cameras for these image pairs.
    pub(crate) fn images(&self, numbers: &[usize]) -> Result<[Vec<GreyImage>; 2], Failure> {
        let [cam1, cam2] = CameraId::BOTH.map(|camera| match self {
            Self::Folder(dataset) => Ok(dataset.phase_images(camera, numbers)?),
            Self::Recording(recording, pairs) => {
                let chosen: Vec<ImagePair> = numbers.iter().filter_map(|&n| pairs.get(n).copied()).collect();
                Ok::<_, Failure>(recording.pair_images(&chosen, camera)?)
            }
        });
        Ok([cam1?, cam2?])
    }

    /// An error that names the input: it can be read, but not used.
    pub(crate) fn unusable(&self, problem: &dyn std::fmt::Display) -> Failure {
        Failure::Usage(format!("{}: {problem}", self.path().display()))
    }
}

//! What a cloud is made of: the phase images of a dataset folder or of a recording, by number.

use std::ops::Range;
use std::path::Path;

use fringeflow::calibration::Unit;
use fringeflow::config::Configuration;
use fringeflow::dataset::{CameraId, Dataset, GreyImage, Setup, Truth};
use fringeflow::recording::{ImagePair, Recording, cycles, windows};

use crate::failure::Failure;

/// An opened input.
pub(crate) enum Input {
    /// A dataset folder.
    Folder(Box<Dataset>),
    /// A recording, and its image pairs in the order of their exposures.
    Recording(Box<Recording>, Vec<ImagePair>),
}

impl Input {
    /// Opens a folder or a recording; `unit` is used where a folder states none.
    pub(crate) fn open(path: &Path, unit: Option<Unit>) -> Result<Self, Failure> {
        if !path.is_file() {
            return Ok(Self::Folder(Box::new(Dataset::open(path, unit)?)));
        }
        let recording = Recording::open(path)?;
        let pairs = recording.pairs()?;
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

    /// The settings that apply unless others are given: those that were recorded.
    pub(crate) fn configuration(&self) -> Result<Configuration, Failure> {
        match self {
            Self::Folder(_) => Ok(Configuration::default()),
            Self::Recording(recording, _) => Ok(recording.configuration()?),
        }
    }

    /// What is true of the scene, where it is known.
    pub(crate) fn truth(&self) -> Result<Option<Truth>, Failure> {
        match self {
            Self::Folder(dataset) => Ok(dataset.truth()?),
            Self::Recording(recording, _) => Ok(recording.truth()?),
        }
    }

    /// The folder, for methods that need more images than a recording has.
    pub(crate) fn folder(&self) -> Result<&Dataset, Failure> {
        match self {
            Self::Folder(dataset) => Ok(dataset),
            Self::Recording(..) => {
                Err(self.unusable(&"a recording has no Gray-code images; give the dataset folder they are in"))
            }
        }
    }

    /// Number of image pairs.
    pub(crate) fn available(&self) -> usize {
        match self {
            Self::Folder(dataset) => dataset.setup.sequence.shifts_rad.len(),
            Self::Recording(_, pairs) => pairs.len(),
        }
    }

    /// The image pairs that are used unless others are asked for: the first complete cycle.
    pub(crate) fn first_cycle(&self) -> Result<Range<usize>, Failure> {
        Ok(self.cycles()?.swap_remove(0))
    }

    /// The image pairs of all complete cycles, one at least; a folder is one.
    pub(crate) fn cycles(&self) -> Result<Vec<Range<usize>>, Failure> {
        let steps = self.setup().steps;
        let starts = match self {
            Self::Folder(_) => vec![0],
            Self::Recording(_, pairs) => cycles(pairs, steps).collect(),
        };
        if starts.is_empty() {
            let what = format!("among its {} image pairs is no complete cycle of {steps} steps", self.available());
            return Err(self.unusable(&what));
        }
        Ok(starts.into_iter().map(|start| start..start + steps).collect())
    }

    /// The image pairs of complete windows within a range, each in the order of its steps; from one to the next at least
    /// `every` pairs. A folder has no windows but its one cycle.
    pub(crate) fn windows(&self, within: &Range<usize>, every: usize) -> Vec<Vec<usize>> {
        let Self::Recording(_, pairs) = self else { return vec![within.clone().collect()] };
        let (steps, mut next) = (self.setup().steps, within.start);
        let mut found = Vec::new();
        for start in windows(pairs, steps).filter(|start| start + steps <= within.end) {
            if start >= next {
                let mut numbers: Vec<usize> = (start..start + steps).collect();
                numbers.sort_by_key(|&n| pairs.get(n).map(|pair| pair.step));
                found.push(numbers);
                next = start + every;
            }
        }
        found
    }

    /// Start of the exposure of an image pair since that of the first, seconds; a folder knows no times.
    pub(crate) fn exposure_s(&self, number: usize) -> Option<f64> {
        let Self::Recording(_, pairs) = self else { return None };
        let [own_ns, first_ns] = [pairs.get(number)?, pairs.first()?].map(|pair| pair.cam1.exposure_start_ns);
        let since_ns = own_ns.saturating_sub(first_ns);
        Some(since_ns as f64 * 1e-9)
    }

    /// Phase shift of an image pair, rad.
    pub(crate) fn shift_rad(&self, number: usize) -> Option<f64> {
        let shifts = &self.setup().sequence.shifts_rad;
        match self {
            Self::Folder(_) => shifts.get(number).copied(),
            Self::Recording(_, pairs) => shifts.get(pairs.get(number)?.step).copied(),
        }
    }

    /// Images of both cameras by number.
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

    /// The input can be read, but not worked with.
    pub(crate) fn unusable(&self, problem: &dyn std::fmt::Display) -> Failure {
        Failure::Usage(format!("{}: {problem}", self.path().display()))
    }
}

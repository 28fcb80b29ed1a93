//! Adds a stage between two workers: it removes correspondences with a low confidence, so they become no points.
//!
//! ```text
//!  images ─► PhaseWorker ─► CorrespondenceWorker ─► ConfidenceFilter ─► CloudWorker ─► cloud
//!                                                   (this example)
//! cargo run --release --example custom_stage -- FOLDER CLOUD.ply MIN_CONFIDENCE
//! ```
//!
//! A worker is a type with `step(input, &mut output)`. It uses no channel, file or clock, so the same stage runs here,
//! in a service and in a test.

#![expect(clippy::print_stdout, reason = "an example prints its results")]

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use fringeflow::calibration::Unit;
use fringeflow::cloud::{Cloud, CloudExport};
use fringeflow::correspondence::{Confidence, MatchSettings, Outcome, SegmentTable};
use fringeflow::phase::{PhaseShifts, Validity};
use fringeflow::worker::{CloudWorker, CorrespondenceWorker, Correspondences, PhasePair, PhaseWorker};
use fringeflow_dataset::{CameraId, Dataset, GreyImage};

/// Removes correspondences below a confidence limit, and counts them.
struct ConfidenceFilter {
    min_confidence: f32,
    passed: u64,
    dropped: u64,
}

impl ConfidenceFilter {
    fn new(min_confidence: f32) -> Self {
        Self { min_confidence, passed: 0, dropped: 0 }
    }

    /// Filters in place. Counts each correspondence as passed or dropped.
    fn step(&mut self, correspondences: &mut Correspondences) {
        let matches = &mut correspondences.matches;
        for pixel in 0..matches.outcomes.len() {
            if !matches.outcomes[pixel].is_found() {
                continue;
            }
            if matches.confidence[pixel].probability() >= self.min_confidence {
                self.passed += 1;
                continue;
            }
            self.dropped += 1;
            // A pixel without a correspondence must have neither candidate nor confidence.
            matches.outcomes[pixel] = Outcome::Ambiguous;
            matches.chosen.clear(pixel);
            matches.confidence[pixel] = Confidence::NONE;
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, target, min_confidence] = &arguments[..] else {
        return Err("usage: custom_stage FOLDER CLOUD.ply MIN_CONFIDENCE".into());
    };
    let dataset = Dataset::open(Path::new(folder), None)?;
    let setup = &dataset.setup;
    let volume = setup.volume.as_ref().ok_or("meta.json states no measurement volume")?;
    let (pattern, shifts) = (&setup.sequence.pattern, PhaseShifts::new(setup.cycle_shifts_rad())?);
    let table = Arc::new(SegmentTable::build(&setup.rig, volume, pattern)?);

    let mut phase = PhaseWorker::new(&setup.rig, pattern, &shifts, Validity::default());
    let mut correspondence = CorrespondenceWorker::new(Arc::clone(&table), &shifts, MatchSettings::default());
    let mut filter = ConfidenceFilter::new(min_confidence.parse()?);
    let mut cloud = CloudWorker::new(&setup.rig, table)?;

    let image_numbers: Vec<usize> = (0..setup.steps).collect();
    let images = [CameraId::Cam1, CameraId::Cam2].map(|camera| dataset.phase_images(camera, &image_numbers));
    let [cam1, cam2] = images;
    let (cam1, cam2) = (cam1?, cam2?);

    // Keep the outputs as long as the workers: each window reuses their memory.
    let (mut maps, mut correspondences) = (PhasePair::default(), Correspondences::default());
    let mut points = Cloud::default();
    phase.step(0, &GreyImage::levels_of(&cam1), &GreyImage::levels_of(&cam2), None, &mut maps)?;
    correspondence.step(&maps, &mut correspondences)?;
    filter.step(&mut correspondences);
    cloud.step(&correspondences, &mut points);

    points.write(Path::new(target), &CloudExport { unit: Unit::Millimetre, dataset: &setup.name })?;
    println!("{} correspondences passed, {} dropped for low confidence", filter.passed, filter.dropped);
    println!("{} points in {target}", points.points.len());
    Ok(())
}

//! Turns a dataset folder into a point cloud: reads images and rig, builds the segment table, reconstructs, writes a
//! PLY file.
//!
//! ```text
//! cargo run --release --example reconstruct_dataset -- FOLDER CLOUD.ply
//! ```
//!
//! `fringeflow simulate --object nose -o FOLDER` makes such a folder.

#![expect(clippy::print_stdout, reason = "an example prints its results")]

use std::error::Error;
use std::path::PathBuf;

use fringeflow::calibration::Unit;
use fringeflow::cloud::CloudExport;
use fringeflow::correspondence::{Outcome, SegmentTable};
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstructor, Settings};
use fringeflow_dataset::{CameraId, Dataset, GreyImage};

fn main() -> Result<(), Box<dyn Error>> {
    let [folder, target] = arguments().ok_or("usage: reconstruct_dataset FOLDER CLOUD.ply")?;

    // The README quotes the lines from here to the next empty line.
    let dataset = Dataset::open(&folder, None)?;
    let (setup, pattern) = (&dataset.setup, &dataset.setup.sequence.pattern);
    let volume = setup.volume.as_ref().ok_or("meta.json states no measurement volume")?;
    // Table and reconstructor depend only on the rig and the pattern: build them once, for any number of windows.
    let table = SegmentTable::build(&setup.rig, volume, pattern)?;
    let shifts = PhaseShifts::new(setup.cycle_shifts_rad())?;
    let mut reconstructor = Reconstructor::new(&setup.rig, pattern, table, &shifts, Settings::default())?;
    let images = |camera| dataset.phase_images(camera, &(0..setup.steps).collect::<Vec<_>>());
    let (cam1, cam2) = (images(CameraId::Cam1)?, images(CameraId::Cam2)?);
    let result = reconstructor.reconstruct(0, &GreyImage::levels_of(&cam1), &GreyImage::levels_of(&cam2), None)?;
    result.cloud.write(&target, &CloudExport { unit: Unit::Millimetre, dataset: &setup.name })?;

    // Every pixel of camera 1 has one outcome: a point, or the reason why it has none.
    for outcome in Outcome::ALL {
        let pixels = result.matches.outcomes.iter().filter(|&&o| o == outcome).count();
        println!("{:<18} {pixels:>8} pixels", outcome.name());
    }
    println!("{} points in {}", result.cloud.points.len(), target.display());
    Ok(())
}

fn arguments() -> Option<[PathBuf; 2]> {
    std::env::args_os().skip(1).map(PathBuf::from).collect::<Vec<_>>().try_into().ok()
}

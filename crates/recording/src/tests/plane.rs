//! The dataset of the tests of recordings; those of `crates/replay` use it too.

use std::sync::OnceLock;

use tempfile::TempDir;

use fringeflow_dataset::Dataset;
use fringeflow_lab::simulation::{Board, NoiseLevel, Object, RigOptions, Simulation, SimulationOptions};

/// Width and height of the images, pixels: the minimum of the virtual scanner.
pub(super) const SIZE_PX: [usize; 2] = [64, 64];

/// A simulated plane with fringes wide enough for so few pixels.
pub(super) fn dataset() -> &'static Dataset {
    static DATASET: OnceLock<(TempDir, Dataset)> = OnceLock::new();
    let make = || {
        let options = SimulationOptions {
            board: Board::None,
            rig: RigOptions { size_px: SIZE_PX, period_px: 64.0, sd_rad: 0.0, ..RigOptions::usual(0.025) },
            steps: 4,
            gray: false,
            noise: NoiseLevel::None,
            supersampling: 1,
            ..SimulationOptions::usual(Object::Plane)
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plane");
        Simulation::new(options).unwrap().write(&path, || ()).unwrap();
        (folder, Dataset::open(&path, None).unwrap())
    };
    &DATASET.get_or_init(make).1
}

//! Scenes of the virtual scanner for the benches, rendered once and kept in `target/bench/scenes`.

mod cache;
mod workers;

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use fringeflow::correspondence::{Matches, SegmentTable};
use fringeflow::phase::PhaseShifts;
use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_dataset::{CameraId, GreyImage, SetupText};
use fringeflow_lab::simulation::{
    Arrangement, Board, BoardApart, ImageSeed, NoiseLevel, Object, PoseImages, RigOptions, Sensor, Simulation,
    SimulationOptions, SweepOptions, VirtualRig, VirtualScanner, VirtualScannerOptions,
};
use fringeflow_patterns::{Direction, Pattern};

pub(crate) use workers::Workers;

/// Image size of all measurements.
pub(crate) const FULL_PX: [usize; 2] = [1280, 1024];
/// Image size when `cargo test` only checks that the benches run.
pub(crate) const SMALL_PX: [usize; 2] = [320, 256];
/// Images of a moving scanner, one per pose.
pub(crate) const MOVING_IMAGES: usize = 16;

/// Arrangement of cameras and projector, and what lies behind the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Geometry {
    /// Projector inside the base, where hardly any wrong fringe order passes the back-projection test.
    Easy,
    /// Projector outside the base, at a place where every third order passes it.
    Hard,
    /// Like `Easy`, in a volume of twice the depth with twice the fringe period: segments are twice as long and have
    /// the same number of periods. The same part of the object is hidden, and as many pixels have several candidates.
    DeepVolume,
    /// Like `Easy`, in a volume of four times the depth with the same fringe period: four times as many fringe orders
    /// per segment.
    ManyOrders,
    /// Like `Easy`, with nothing under the object.
    NoBoard,
    /// Like `Easy`, with a board far behind the volume instead of the one under the object.
    BoardBehind,
}

/// A scene, seen by cameras of one image size.
pub(crate) struct Scene {
    pub(crate) geometry: Geometry,
    pub(crate) size_px: [usize; 2],
    pub(crate) rig: VirtualRig,
    /// Traced rays; computed when an image is not in the cache.
    traced: OnceLock<Simulation>,
}

/// Images of both cameras, one per step or pose.
pub(crate) struct Images {
    pub(crate) cameras: [Vec<GreyImage>; 2],
}

impl Geometry {
    fn rig_options(self, size_px: [usize; 2]) -> RigOptions {
        // Camera lenses are longer than in the table-top arrangement, and the projector lens is shorter, so the object
        // fills the images. Then costs per point are also costs per pixel.
        let table_top = Arrangement { camera_focal_px: 2150.0, projector_focal_px: 2900.0, ..Arrangement::TABLE_TOP };
        let depth_m = OBJECT.usual_depth_m();
        let easy = RigOptions {
            arrangement: Arrangement { projector_place: EASY_PLACE, ..table_top },
            size_px,
            period_px: PERIOD_PX,
            sd_rad: SD_RAD,
            ..RigOptions::usual(depth_m)
        };
        match self {
            Self::Easy | Self::NoBoard | Self::BoardBehind => easy,
            Self::Hard => RigOptions {
                arrangement: Arrangement { projector_place: HARD_PLACE, ..table_top },
                sd_rad: HARD_SD_RAD,
                ..easy
            },
            Self::DeepVolume => RigOptions {
                arrangement: Arrangement { projector_place: DEEP_PLACE, ..table_top },
                depth_m: 2.0 * depth_m,
                period_px: 2.0 * PERIOD_PX,
                ..easy
            },
            Self::ManyOrders => RigOptions { depth_m: 4.0 * depth_m, ..easy },
        }
    }

    fn board(self) -> Board {
        match self {
            Self::NoBoard => Board::None,
            Self::BoardBehind => {
                Board::Apart(BoardApart { distance_mm: BEHIND_MM, albedo: BEHIND_ALBEDO, tilt_deg: 0.0 })
            }
            Self::Easy | Self::Hard | Self::DeepVolume | Self::ManyOrders => OBJECT.usual_board(),
        }
    }
}

const OBJECT: Object = Object::Teeth;
/// Distance of the board behind the volume, and its albedo.
const BEHIND_MM: f64 = 85.0;
const BEHIND_ALBEDO: f64 = 0.3;
const NOISE: NoiseLevel = NoiseLevel::Low;
const PERIOD_PX: f64 = 16.0;
/// sd of δ from the calibration error alone, rad.
const SD_RAD: f64 = 0.015;
const HARD_SD_RAD: f64 = 0.017;
/// Places of the projector along the base, found by measurement. Easy: that of the table-top arrangement, moved by half
/// a millimetre; 2 to 3 % of the pixels with candidates have several that pass the test. Hard: with its calibration
/// error, 15 % have several. Deep: with fringes of twice the period, another place is needed so that as many pixels
/// have several candidates that might be readmitted, one in six.
const EASY_PLACE: f64 = 0.375;
const HARD_PLACE: f64 = 1.332;
const DEEP_PLACE: f64 = 0.342;

impl Scene {
    /// Creates a scene. Nothing is rendered yet.
    pub(crate) fn new(geometry: Geometry, size_px: [usize; 2]) -> Self {
        let rig = VirtualRig::new(&geometry.rig_options(size_px)).unwrap();
        Self { geometry, size_px, rig, traced: OnceLock::new() }
    }

    /// Its segment table.
    pub(crate) fn table(&self) -> SegmentTable {
        SegmentTable::build(&self.rig.calibrated, &self.rig.volume, &self.rig.columns).unwrap()
    }

    /// Images of the scene at rest, one cycle of `steps`.
    pub(crate) fn images(&self, steps: usize, format: PixelFormat) -> Images {
        let (rig, board) = (self.geometry.rig_options(self.size_px), self.geometry.board());
        let key = format!("{rig:?} {OBJECT:?} {board:?} {NOISE:?} N{steps} {format:?}");
        cache::read_or_render(&key, self.size_px, format, steps, || self.render(steps, format))
    }

    /// Images of a scanner that moves by 0.03 mm from image to image. Steps repeat in a cycle.
    pub(crate) fn moving_images(&self, steps: usize) -> Images {
        let options = self.moving_options(steps);
        let key = format!("{options:?}");
        cache::read_or_render(&key, self.size_px, options.format, MOVING_IMAGES, || {
            let scanner = VirtualScanner::new(options).unwrap();
            let mut poses = PoseImages::new(&scanner);
            let pairs: Vec<[GreyImage; 2]> = (0..MOVING_IMAGES).map(|k| poses.take(k % steps).unwrap()).collect();
            let (cam1, cam2) = pairs.into_iter().map(|[cam1, cam2]| (cam1, cam2)).unzip();
            [cam1, cam2]
        })
    }

    /// Description and calibration of its rig.
    pub(crate) fn setup_text(&self) -> SetupText {
        VirtualScanner::new(self.moving_options(4)).unwrap().setup_text().unwrap()
    }

    fn moving_options(&self, steps: usize) -> VirtualScannerOptions {
        let sweep = SweepOptions {
            poses: MOVING_IMAGES,
            travel_mm: [0.07, 0.06, 0.01],
            turn_deg: [0.008, 0.013, 0.02],
            tremor_mm: 0.0,
            tremor_deg: 0.0,
            outside_mm: 5.0,
            seed: 1,
        };
        let rig = self.geometry.rig_options(self.size_px);
        let usual = VirtualScannerOptions::usual(OBJECT);
        VirtualScannerOptions { rig, steps, noise: NOISE, sweep, ..usual }
    }

    fn render(&self, steps: usize, format: PixelFormat) -> [Vec<GreyImage>; 2] {
        let simulation = self.traced.get_or_init(|| {
            let usual = SimulationOptions::usual(OBJECT);
            let rig = self.geometry.rig_options(self.size_px);
            let board = self.geometry.board();
            Simulation::new(SimulationOptions { rig, board, noise: NOISE, gray: false, ..usual }).unwrap()
        });
        let sensor = Sensor { format, ..Sensor::exposed(NOISE.noise(), 1.0) };
        CameraId::BOTH.map(|camera| {
            let image = |(number, &shift_rad): (usize, &f64)| {
                let pattern = self.rig.columns;
                let projected = Pattern::Fringes { direction: Direction::Columns, pattern, shift_rad };
                let seed = ImageSeed { seed: 1, camera: camera as u8, image: number as u32 };
                sensor.image(&simulation.views()[camera as usize], &projected, seed)
            };
            shifts_rad(steps).iter().enumerate().map(image).collect()
        })
    }
}

impl Images {
    /// Grey levels of both cameras, as input of the workers.
    pub(crate) fn levels(&self) -> [Vec<GreyLevels<'_>>; 2] {
        [0, 1].map(|camera| GreyImage::levels_of(&self.cameras[camera]))
    }
}

/// Evenly spaced shifts of a cycle, rad.
pub(crate) fn shifts_rad(steps: usize) -> Vec<f64> {
    (0..steps).map(|k| TAU * k as f64 / steps as f64).collect()
}

/// The same, as input of the decoder.
pub(crate) fn shifts(steps: usize) -> PhaseShifts {
    PhaseShifts::new(&shifts_rad(steps)).unwrap()
}

/// Of the pixels with candidates that pass the back-projection test, the share with more than one.
pub(crate) fn ambiguous_share(matches: &Matches) -> f64 {
    let at_least = |count: u8| matches.passing.iter().filter(|&&passing| passing >= count).count();
    at_least(2) as f64 / at_least(1).max(1) as f64
}

/// Folder for all files of the benches: `target/bench`.
pub(crate) fn bench_folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("bench");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

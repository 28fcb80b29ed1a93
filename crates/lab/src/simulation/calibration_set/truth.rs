//! What is true of a simulated calibration: `truth.json` and `volume.json`. Lengths in millimetres.

use fringeflow::geometry::{Camera, Pose};
use serde::Serialize;

use super::surface::in_cam1;
use super::{CalibrationSet, CalibrationSetSummary};
use crate::simulation::SimulationError;
use crate::simulation::solid::MM_PER_M;

/// Content of `truth.json`.
#[derive(Serialize)]
pub(super) struct Truth {
    board: String,
    settings: Settings,
    volume: Volume,
    /// Position of each feature on the board, bent as it is.
    features_mm: Vec<[f64; 3]>,
    views: Vec<View>,
}

#[derive(Serialize)]
struct Settings {
    steps: usize,
    noise: &'static str,
    gamma: f64,
    exposure: f64,
    ambient: f64,
    board_bend_mm: f64,
    defocus_px: f64,
    beat: f64,
    board_motion_mm: f64,
    blur: f64,
    seed: u64,
}

/// A measurement volume as `--volume` reads it.
#[derive(Serialize)]
struct Volume {
    #[serde(rename = "R_v")]
    rotation: [[f64; 3]; 3],
    #[serde(rename = "T_v")]
    translation: [f64; 3],
    min: [f64; 3],
    max: [f64; 3],
}

/// A view. The pose and the points are those of its first image.
#[derive(Serialize)]
struct View {
    /// `x_cam1 = R · x_board + T`.
    #[serde(rename = "R")]
    rotation: [[f64; 3]; 3],
    #[serde(rename = "T")]
    translation: [f64; 3],
    /// The pose of the last image, if the board moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    last: Option<LastPose>,
    /// Where each feature is in the image; null outside.
    cam1_px: Vec<Option<[f64; 2]>>,
    cam2_px: Vec<Option<[f64; 2]>>,
    projector_px: Vec<Option<[f64; 2]>>,
}

#[derive(Serialize)]
struct LastPose {
    #[serde(rename = "R")]
    rotation: [[f64; 3]; 3],
    #[serde(rename = "T")]
    translation: [f64; 3],
}

impl Truth {
    pub(super) fn new(set: &CalibrationSet) -> Self {
        let o = &set.options;
        let volume = &set.rig.exact_volume;
        let features_mm = set.surface().features();
        let last = (set.patterns.images.len() - 1) as f64;
        let view = |view: usize| {
            let pose = set.pose(view, 0.0);
            let exact = &set.rig.exact;
            let seen = |lens: &Camera, device_from_cam1: &Pose| {
                let pixel = |feature: &[f64; 3]| {
                    let pixel = lens.project(&(device_from_cam1 * in_cam1(&pose, feature)))?;
                    lens.sees(&pixel).then_some([pixel.x, pixel.y])
                };
                features_mm.iter().map(pixel).collect()
            };
            let moved = set.pose(view, last);
            View {
                rotation: rotation(&pose),
                translation: translation_mm(&pose),
                last: (o.motion_mm > 0.0)
                    .then(|| LastPose { rotation: rotation(&moved), translation: translation_mm(&moved) }),
                cam1_px: seen(&exact.cam1, &Pose::identity()),
                cam2_px: seen(&exact.cam2, &exact.cam2_from_cam1),
                projector_px: seen(&exact.projector, &exact.projector_from_cam1),
            }
        };
        Self {
            board: o.board.to_string(),
            settings: Settings {
                steps: o.steps,
                noise: o.noise.name(),
                gamma: o.gamma,
                exposure: o.exposure,
                ambient: o.ambient,
                board_bend_mm: o.bend_mm,
                defocus_px: o.defocus_px,
                beat: o.beat,
                board_motion_mm: o.motion_mm,
                blur: o.blur,
                seed: o.seed,
            },
            volume: Volume {
                rotation: rotation(volume.cam1_from_volume()),
                translation: translation_mm(volume.cam1_from_volume()),
                min: (volume.min().coords * MM_PER_M).into(),
                max: (volume.max().coords * MM_PER_M).into(),
            },
            views: (0..set.poses.len()).map(view).collect(),
            features_mm,
        }
    }

    pub(super) fn text(&self) -> Result<String, SimulationError> {
        Ok(serde_json::to_string(self)?)
    }

    pub(super) fn volume_text(&self) -> Result<String, SimulationError> {
        Ok(serde_json::to_string_pretty(&self.volume)?)
    }

    pub(super) fn summary(&self, images: usize) -> CalibrationSetSummary {
        let views = self.views.len();
        let mean = |of: fn(&View) -> &Vec<Option<[f64; 2]>>| {
            let seen: usize = self.views.iter().map(|view| of(view).iter().flatten().count()).sum();
            seen as f64 / views.max(1) as f64
        };
        let features_seen = [mean(|view| &view.cam1_px), mean(|view| &view.cam2_px), mean(|view| &view.projector_px)];
        CalibrationSetSummary { views, images, features_seen }
    }
}

fn rotation(pose: &Pose) -> [[f64; 3]; 3] {
    let matrix = pose.rotation.to_rotation_matrix();
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[(row, column)]))
}

fn translation_mm(pose: &Pose) -> [f64; 3] {
    (pose.translation.vector * MM_PER_M).into()
}

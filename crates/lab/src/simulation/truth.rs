//! Computes the truth of a simulated dataset, per pixel of C1.

use rayon::prelude::*;

use fringeflow::calibration::Unit;
use fringeflow::geometry::{MeasurementVolume, Rig};
use fringeflow_dataset::RenderedTruth;

use super::scene::Scene;
use super::trace::is_free;
use super::view::{Centre, View};

/// The truth at the centre of one pixel of C1.
#[derive(Clone, Copy, Debug)]
struct PixelTruth {
    cam2_px: [f32; 2],
    point: [f32; 3],
    seen_by_cam2: bool,
    lit: bool,
    in_volume: bool,
    bright: bool,
}

/// The truth of a pixel whose ray hits nothing.
const NOTHING: PixelTruth = PixelTruth {
    cam2_px: [f32::NAN; 2],
    point: [0.0; 3],
    seen_by_cam2: false,
    lit: false,
    in_volume: false,
    bright: false,
};

/// Returns the truth of a scene that `rig` sees. `view` is the view of C1. Points are in `unit`, in the frame of the
/// exact C1.
///
/// `reference` contains all measurable points that are bright enough, so not those of a dark board. Only images can
/// show which of them Gray code finds. A board or a hand apart from the volume is seen and lit, but never in the
/// volume.
#[must_use]
pub fn truth(rig: &Rig, volume: &MeasurementVolume, scene: &Scene, view: &View, unit: Unit) -> RenderedTruth {
    let cam2 = scene.to_object(&rig.centre_of_cam2());
    let pixel_truth = |centre: &Centre| {
        let hit = centre.hit?;
        let point = scene.to_cam1(&hit.point);
        let seen = rig.project_cam2(&point)?;
        Some(PixelTruth {
            cam2_px: [seen.x as f32, seen.y as f32],
            point: (point.coords / unit.in_metres()).map(|c| c as f32).into(),
            seen_by_cam2: rig.cam2.sees(&seen) && is_free(scene, &hit, &cam2),
            lit: centre.sample.reflected > 0.0,
            in_volume: volume.contains(&point) && !scene.is_apart(hit.surface),
            bright: scene.is_bright(hit.surface),
        })
    };
    let pixels: Vec<_> = view.centres.par_iter().map(|centre| pixel_truth(centre).unwrap_or(NOTHING)).collect();
    let measurable: Vec<bool> = pixels.iter().map(|p| p.seen_by_cam2 && p.lit && p.in_volume).collect();
    RenderedTruth {
        cam2_px: pixels.iter().map(|p| p.cam2_px).collect(),
        point: pixels.iter().map(|p| p.point).collect(),
        seen_by_cam2: pixels.iter().map(|p| p.seen_by_cam2).collect(),
        lit: pixels.iter().map(|p| p.lit).collect(),
        in_volume: pixels.iter().map(|p| p.in_volume).collect(),
        reference: pixels.iter().zip(&measurable).map(|(p, &measurable)| measurable && p.bright).collect(),
        measurable,
        gray_cam2_px: None,
    }
}

//! One device alone, from points of a plane and their images in several views.

use fringeflow::geometry::{Pixel, Pose};
use nalgebra::Vector2;

use super::homography::homography;
use super::intrinsics::{closed_form, pose_of_plane, with_principal_point};
use crate::adjustment::{Adjusted, Device, Measured, Measurement, Problem, State, adjust};
use crate::lens::Lens;
use crate::shape::BoardShape;

/// Points of the board as one device images them, by view.
#[derive(Clone, Debug)]
pub struct DeviceViews {
    /// Positions of the features in the plane of the board, metres.
    pub features_m: Vec<Vector2<f64>>,
    /// Width and height of the image, pixels.
    pub size_px: [usize; 2],
    /// For each view the points that are seen.
    pub views: Vec<PlaneImage>,
}

/// Features of the board and where a device images them.
pub type PlaneImage = Vec<(usize, Pixel)>;

/// A device calibrated alone.
#[derive(Clone, Debug)]
pub struct SingleDevice {
    /// Its lens.
    pub lens: Lens,
    /// Pose of the board in its frame for each view; `None` where too little is seen.
    pub poses: Vec<Option<Pose>>,
    /// Root mean square of the residuals that were used, pixels.
    pub rms_px: f64,
}

/// Calibrates a device alone; `None` if its views do not determine it.
///
/// The closed form fails on few or noisy views. So there are several first guesses, one with its principal point and
/// others with the middle of the image, above and below it as in projectors with an offset lens; the adjustment that
/// fits best counts.
#[must_use]
pub fn calibrate_device(device: &DeviceViews) -> Option<SingleDevice> {
    let pairs = |view: &PlaneImage| {
        view.iter().map(|&(feature, pixel)| (device.features_m[feature], pixel)).collect::<Vec<_>>()
    };
    let homographies: Vec<_> = device.views.iter().map(|view| homography(&pairs(view))).collect();
    let known: Vec<_> = homographies.iter().flatten().copied().collect();
    let [width, height] = device.size_px.map(|side| side as f64);
    let middles = [0.5, 1.0, 0.0].map(|share| [(width - 1.0) / 2.0, height * share]);
    let guesses = std::iter::once(closed_form(&known, device.size_px))
        .chain(middles.map(|principal_px| with_principal_point(&known, principal_px)))
        .flatten();
    let poses = |lens: &Lens| -> Vec<Option<Pose>> {
        homographies.iter().map(|h| h.as_ref().and_then(|h| pose_of_plane(h, lens))).collect()
    };
    let solutions = guesses.filter_map(|lens| adjusted(device, lens, &poses(&lens)));
    let (best, used) = solutions.min_by(|(a, _), (b, _)| a.groups[0].noise.total_cmp(&b.groups[0].noise))?;
    let mut poses = vec![None; device.views.len()];
    for (pose, view) in best.state.boards.iter().zip(used) {
        poses[view] = Some(*pose);
    }
    Some(SingleDevice { lens: best.state.devices[0].lens, poses, rms_px: best.groups[0].rms_px })
}

/// Adjusts a first guess to the views whose pose is known. Returns their numbers too.
fn adjusted(device: &DeviceViews, lens: Lens, poses: &[Option<Pose>]) -> Option<(Adjusted, Vec<usize>)> {
    let (used, boards): (Vec<_>, Vec<_>) =
        poses.iter().enumerate().filter_map(|(view, pose)| pose.map(|pose| (view, pose))).unzip();
    let measurements = used.iter().enumerate().flat_map(|(number, &view)| {
        device.views[view].iter().map(move |&(feature, pixel)| Measurement {
            view: number,
            feature,
            device: 0,
            group: 0,
            measured: Measured::Pixel(pixel, 1.0),
        })
    });
    let problem = Problem {
        features_m: device.features_m.clone(),
        measurements: measurements.collect(),
        sizes_px: vec![device.size_px],
        groups: 1,
    };
    let devices = vec![Device { lens, from_first: Pose::identity() }];
    Some((adjust(&problem, State { devices, boards, shape: BoardShape::flat() })?, used))
}

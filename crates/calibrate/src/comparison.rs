//! What moved between an earlier calibration and this one.
//!
//! In: an earlier rig, and a calibration with its covariance. Out: the changes in the words of a mechanic. A change within
//! three standard deviations of the new calibration is said to be none.

use fringeflow::geometry::{Camera, Pose, Rig};
use nalgebra::DMatrix;

use crate::adjustment::{Layout, PROJECTOR};
use crate::refinement::state_of;
use crate::rig::DeviceName;

/// Standard deviations within which a change is noise.
const SIGNIFICANT_SDS: f64 = 3.0;
/// Changes below these are of no use to anybody: relative focal length, pixels, degrees, millimetres.
const LEAST: [f64; 4] = [1e-4, 0.1, 0.005, 0.01];

/// One quantity of one device, before and now.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Change {
    /// The device.
    pub device: String,
    /// What changed.
    pub what: &'static str,
    /// By how much.
    pub by: f64,
    /// Unit of `by`.
    pub unit: &'static str,
    /// Standard deviation of the new value.
    pub sd: f64,
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { device, what, by, unit, sd } = self;
        write!(f, "{device}: {what} changed by {by:+.3} {unit} (± {sd:.3})")
    }
}

/// The significant changes, device by device. `covariance` is that of the parameters of the new rig.
#[must_use]
pub fn changes(old: &Rig, new: &Rig, covariance: &DMatrix<f64>) -> Vec<Change> {
    let layout = Layout::of(&state_of(new));
    let sd = |parameter: usize| covariance[(parameter, parameter)].sqrt();
    let mut changes = Vec::new();
    let devices = [(&old.cam1, &new.cam1), (&old.cam2, &new.cam2), (&old.projector, &new.projector)];
    for (device, (before, now)) in devices.into_iter().enumerate() {
        let mut say = |what, by: f64, unit, sd: f64, least: f64| {
            if by.abs() > (SIGNIFICANT_SDS * sd).max(least) {
                changes.push(Change { device: DeviceName::of(device).to_string(), what, by, unit, sd });
            }
        };
        let at = layout.lens(device);
        let focal = now.focal_px()[0] / before.focal_px()[0] - 1.0;
        say("focal length", 100.0 * focal, "%", 100.0 * sd(at) / now.focal_px()[0], 100.0 * LEAST[0]);
        for (axis, what) in ["principal point in x", "principal point in y"].into_iter().enumerate() {
            let by = now.principal_px()[axis] - before.principal_px()[axis];
            say(what, by, "pixels", sd(at + 2 + axis), LEAST[1]);
        }
        let Some(at) = layout.arrangement(device) else { continue };
        let (before, now) = poses(old, new, device);
        let turn = (now.rotation * before.rotation.inverse()).scaled_axis();
        let axes = ["turn about x", "turn about y", "turn about z"];
        for (axis, what) in axes.into_iter().enumerate() {
            say(what, turn[axis].to_degrees(), "degrees", sd(at + axis).to_degrees(), LEAST[2]);
        }
        // The place of a device, not the translation of its pose, which a turn changes too.
        let shift = (now.inverse().translation.vector - before.inverse().translation.vector) * 1e3;
        for (axis, what) in ["place in x", "place in y", "place in z"].into_iter().enumerate() {
            say(what, shift[axis], "mm", 1e3 * sd(at + 3 + axis), LEAST[3]);
        }
    }
    changes
}

/// Whether the earlier calibration fits better with its cameras exchanged: the intrinsic parameters of each are those of
/// the other now.
#[must_use]
pub fn cameras_exchanged(old: &Rig, new: &Rig) -> bool {
    let distance = |a: &Camera, b: &Camera| {
        let ([fa, _], [fb, _]) = (a.focal_px(), b.focal_px());
        let ([xa, ya], [xb, yb]) = (a.principal_px(), b.principal_px());
        (fa - fb).abs() + (xa - xb).hypot(ya - yb)
    };
    let straight = distance(&old.cam1, &new.cam1) + distance(&old.cam2, &new.cam2);
    let crossed = distance(&old.cam1, &new.cam2) + distance(&old.cam2, &new.cam1);
    let base = |rig: &Rig| rig.centre_of_cam2().x;
    crossed < straight && base(old) * base(new) < 0.0
}

fn poses(old: &Rig, new: &Rig, device: usize) -> (Pose, Pose) {
    if device == PROJECTOR {
        (old.projector_from_cam1, new.projector_from_cam1)
    } else {
        (old.cam2_from_cam1, new.cam2_from_cam1)
    }
}

//! Writes a rig as an OpenCV FileStorage YAML file. In: a rig and a unit. Out: text of some 3 kB.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use fringeflow_base::atomic_file::{WriteError, write_atomically};

use crate::geometry::{Camera, Pose, Rig};

use super::{Cameras, Unit};

/// Writes a calibration file with translations in `unit`. [`super::read_calibration`] reads the same rig back.
///
/// # Errors
/// The file cannot be written; an existing file stays as it is.
pub fn write_calibration(path: &Path, rig: &Rig, unit: Unit) -> Result<(), WriteError> {
    write_atomically(path, |out| out.write_all(calibration_text(rig, unit).as_bytes()))
}

/// The text that [`write_calibration`] writes.
#[must_use]
pub fn calibration_text(rig: &Rig, unit: Unit) -> String {
    let cameras = [("1", &rig.cam1), ("2", &rig.cam2), ("p", &rig.projector)];
    text_of(&cameras, &[("2", &rig.cam2_from_cam1), ("p", &rig.projector_from_cam1)], unit)
}

/// The text of a file of both cameras. [`super::read_cameras`] reads them back.
#[must_use]
pub fn cameras_text(cameras: &Cameras, unit: Unit) -> String {
    text_of(&[("1", &cameras.cam1), ("2", &cameras.cam2)], &[("2", &cameras.cam2_from_cam1)], unit)
}

fn text_of(cameras: &[(&str, &Camera)], poses: &[(&str, &Pose)], unit: Unit) -> String {
    let mut out = String::from("%YAML:1.0\n---\n");
    cameras.iter().for_each(|(suffix, camera)| push_camera(&mut out, suffix, camera));
    poses.iter().for_each(|(suffix, pose)| push_pose(&mut out, suffix, pose, unit));
    out
}

fn push_camera(out: &mut String, suffix: &str, camera: &Camera) {
    let ([fx, fy], [cx, cy]) = (camera.focal_px(), camera.principal_px());
    push_matrix(out, &format!("K{suffix}"), 3, 3, &[fx, camera.skew_px(), cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
    push_matrix(out, &format!("D{suffix}"), 1, 12, &camera.distortion().to_opencv());
    let size = [camera.width_px(), camera.height_px()];
    let _ = writeln!(
        out,
        "size{suffix}: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: i\n   data: [ {}, {} ]",
        size[0], size[1]
    );
}

fn push_pose(out: &mut String, suffix: &str, pose: &Pose, unit: Unit) {
    let rotation = pose.rotation.to_rotation_matrix();
    // nalgebra stores columns; the transpose's columns are the rows.
    push_matrix(out, &format!("R{suffix}"), 3, 3, rotation.matrix().transpose().as_slice());
    push_matrix(out, &format!("T{suffix}"), 3, 1, (pose.translation.vector / unit.in_metres()).as_slice());
}

/// Appends a matrix as FileStorage writes it, its values row by row.
pub fn push_matrix(out: &mut String, name: &str, rows: usize, cols: usize, values: &[f64]) {
    // `{:?}` prints the shortest digits that read back to the same number; writing to a String cannot fail.
    let values: Vec<String> = values.iter().map(|v| format!("{v:?}")).collect();
    let _ = writeln!(
        out,
        "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {} ]",
        values.join(", ")
    );
}

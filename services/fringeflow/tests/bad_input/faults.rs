//! The table of faults: what is damaged, and what the error has to name.

use std::path::Path;

use png::{BitDepth, ColorType};
use serde_json::json;

use fringeflow::calibration::{Unit, write_calibration};
use fringeflow::geometry::Camera;

use crate::input::{self, SIZE_PX, calibration_field, image, meta_field};

/// What a command must read to come upon a fault.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum FoundIn {
    /// `meta.json`, the calibration or the names of the images: every command.
    Folder,
    /// The content of an image.
    Images,
}

/// A fault of a dataset folder.
pub(crate) struct Fault {
    pub(crate) name: &'static str,
    pub(crate) found_in: FoundIn,
    /// Damages an intact dataset folder.
    pub(crate) damage: fn(&Path),
    /// Part of a path that the error has to name.
    pub(crate) file: &'static str,
    /// The field, or the words for what is wrong.
    pub(crate) says: &'static str,
}

const PHASE_IMAGE: &str = "cam2/phase_01.png";
const OTHER_SIZE: [u32; 2] = [SIZE_PX[0] as u32 / 2, SIZE_PX[1] as u32];
const SAME_SIZE: [u32; 2] = [SIZE_PX[0] as u32, SIZE_PX[1] as u32];

pub(crate) const FAULTS: &[Fault] = &[
    fault("missing folder", remove_all, "/set: ", ""),
    fault("missing calibration", |f| remove(f, "calibration.yml"), "calibration.yml", "cannot be read"),
    fault("missing description", |f| remove(f, "meta.json"), "meta.json", "cannot be read"),
    fault("missing image", |f| remove(f, PHASE_IMAGE), PHASE_IMAGE, "is missing"),
    fault("extra image", extra_image, "cam1/phase_04.png", "one image too many"),
    fault("no number", |f| calibration_field(f, "K1", ".Nan, 0, 31.5, 0, 184, 31.5, 0, 0, 1"), CALIBRATION, "field K1"),
    fault("infinite number", |f| calibration_field(f, "T2", ".Inf, 0, 0"), CALIBRATION, "field T2"),
    fault("no rotation", |f| calibration_field(f, "R2", "2, 0, 0, 0, 2, 0, 0, 0, 2"), CALIBRATION, "field R2"),
    fault("mirrored rotation", |f| calibration_field(f, "Rp", "1, 0, 0, 0, 1, 0, 0, 0, -1"), CALIBRATION, "field Rp"),
    fault("negative focal length", negative_focal_length, CALIBRATION, "field K2"),
    fault("inverted rotation", inverted_rotation, CALIBRATION, "field R2"),
    fault("swapped cameras of unlike images", unlike_cameras_swapped, CALIBRATION, "field size1"),
    fault("calibration of another image size", |f| calibration_field(f, "size2", "32, 64"), CALIBRATION, "field size2"),
    fault("volume behind the camera", volume_behind_camera, META, "field volume: the volume is behind camera 1"),
    fault("volume turned inside out", |f| meta_field(f, "/volume/min", json!([50, 40, 12.5])), META, "field volume"),
    fault("impossible period", |f| meta_field(f, "/period_px", json!(0)), META, "field period_px"),
    fault("impossible depth", |f| state_bits(f, 9), META, "field bits: is 9"),
    image_fault("truncated image", truncate_image, "is not an intact PNG"),
    image_fault(
        "image of another size",
        |f| phase_image(f, ColorType::Grayscale, BitDepth::Eight, OTHER_SIZE, &[]),
        "32 × 64",
    ),
    image_fault(
        "16-bit image",
        |f| phase_image(f, ColorType::Grayscale, BitDepth::Sixteen, SAME_SIZE, &[1, 2]),
        "16-bit",
    ),
    Fault {
        name: "8-bit images that are to be deeper",
        found_in: FoundIn::Images,
        damage: |f| state_bits(f, 12),
        file: "phase_0",
        says: "is an 8-bit image among those of 12 bits",
    },
    image_fault(
        "colour image",
        |f| phase_image(f, ColorType::Rgb, BitDepth::Eight, SAME_SIZE, &[9, 8, 7]),
        "has colours",
    ),
];

const CALIBRATION: &str = "calibration.yml";
const META: &str = "meta.json";

const fn fault(name: &'static str, damage: fn(&Path), file: &'static str, says: &'static str) -> Fault {
    Fault { name, found_in: FoundIn::Folder, damage, file, says }
}

const fn image_fault(name: &'static str, damage: fn(&Path), says: &'static str) -> Fault {
    Fault { name, found_in: FoundIn::Images, damage, file: PHASE_IMAGE, says }
}

fn remove_all(folder: &Path) {
    std::fs::remove_dir_all(folder).unwrap();
}

fn remove(folder: &Path, name: &str) {
    std::fs::remove_file(folder.join(name)).unwrap();
}

fn extra_image(folder: &Path) {
    std::fs::copy(folder.join("cam1/phase_00.png"), folder.join("cam1/phase_04.png")).unwrap();
}

fn truncate_image(folder: &Path) {
    let file = std::fs::File::options().write(true).open(folder.join(PHASE_IMAGE)).unwrap();
    file.set_len(file.metadata().unwrap().len() / 2).unwrap();
}

fn phase_image(folder: &Path, color: ColorType, depth: BitDepth, size: [u32; 2], first: &[u8]) {
    image(&folder.join(PHASE_IMAGE), color, depth, size, first);
}

fn negative_focal_length(folder: &Path) {
    calibration_field(folder, "K2", "-184, 0, 31.5, 0, 184, 31.5, 0, 0, 1");
}

/// 8 bits are not stated by themselves.
fn state_bits(folder: &Path, bits: u8) {
    let path = folder.join(META);
    let mut meta: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    meta["bits"] = json!(bits);
    std::fs::write(&path, meta.to_string()).unwrap();
}

fn volume_behind_camera(folder: &Path) {
    meta_field(folder, "/volume/T_v", json!([0, 0, -310]));
}

/// R2 the other way round, as of x1 = R2·x2.
fn inverted_rotation(folder: &Path) {
    let mut rig = input::rig();
    rig.cam2_from_cam1.rotation = rig.cam2_from_cam1.rotation.inverse();
    write_calibration(&folder.join(CALIBRATION), &rig, Unit::Millimetre).unwrap();
}

/// A rig whose C1 has smaller images than the dataset has.
fn unlike_cameras_swapped(folder: &Path) {
    let mut rig = input::rig();
    let half = Camera::new(rig.cam2.focal_px(), rig.cam2.principal_px(), *rig.cam2.distortion(), [32, 64]);
    (rig.cam1, rig.cam2) = (half, rig.cam1);
    write_calibration(&folder.join(CALIBRATION), &rig, Unit::Millimetre).unwrap();
}

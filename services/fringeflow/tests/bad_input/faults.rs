//! The table of faults: how a dataset folder is damaged, and what the error must name.

use std::path::Path;

use png::{BitDepth, ColorType};
use serde_json::json;

use fringeflow::calibration::{Unit, write_calibration};
use fringeflow::geometry::Camera;

use crate::input::{self, SIZE_PX, edit_calibration, edit_meta, write_image};

/// What a command must read to find a fault.
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
    /// Part of the path that the error must name.
    pub(crate) file: &'static str,
    /// The field or the problem that the error must name.
    pub(crate) says: &'static str,
}

const PHASE_IMAGE: &str = "cam2/phase_01.png";
const OTHER_SIZE: [u32; 2] = [SIZE_PX[0] as u32 / 2, SIZE_PX[1] as u32];
const SAME_SIZE: [u32; 2] = [SIZE_PX[0] as u32, SIZE_PX[1] as u32];

pub(crate) const FAULTS: &[Fault] = &[
    fault("missing folder", remove_folder, "/set: ", ""),
    fault("missing calibration", |f| remove_file(f, "calibration.yml"), "/set: ", "it has no calibration.yml"),
    fault("missing description", |f| remove_file(f, "meta.json"), "/set: ", "it has no meta.json"),
    fault("two calibrations", add_second_calibration, "calibration.xml", "is a second calibration beside"),
    fault("misspelt field", |f| add_field(f, "bit", json!(12)), META, "field bit is not known; is bits meant?"),
    fault(
        "shifts in degrees",
        |f| edit_meta(f, "/phase_shift_rad", json!([0, 90, 180, 270])),
        META,
        "field phase_shift_rad: [0.0, 90.0, 180.0, 270.0]: these look like degrees",
    ),
    fault(
        "shifts in turns",
        |f| edit_meta(f, "/phase_shift_rad", json!([0.0, 0.25, 0.5, 0.75])),
        META,
        "field phase_shift_rad: [0.0, 0.25, 0.5, 0.75]: these look like turns",
    ),
    fault("JPEG images", |f| rename_images(f, "jpg"), "cam1/phase_00.jpg", "is a JPEG image"),
    fault(
        "images of another kind",
        |f| rename_images(f, "webp"),
        "cam1/phase_00.png",
        "its folder holds phase_00.webp",
    ),
    fault("lengths in squares of a board", scale_lengths, "/set", "another unit than the measurement volume"),
    fault("the projector in another unit", |f| edit_calibration(f, "Tp", "-0.04, 0.0, 0.01"), CALIBRATION, "field Tp"),
    fault(
        "a focal length in millimetres",
        |f| edit_calibration(f, "K1", "8, 0, 31.5, 0, 8, 31.5, 0, 0, 1"),
        CALIBRATION,
        "field K1: fx is 8 px",
    ),
    fault(
        "cameras of two sizes",
        shrink_camera_2,
        "set/cam2",
        "is 32 × 64 pixels, and the images of camera 1 are 64 × 64",
    ),
    fault("missing image", |f| remove_file(f, PHASE_IMAGE), PHASE_IMAGE, "is missing"),
    fault("extra image", add_image, "cam1/phase_04.png", "one image too many"),
    fault(
        "not a number",
        |f| edit_calibration(f, "K1", ".Nan, 0, 31.5, 0, 184, 31.5, 0, 0, 1"),
        CALIBRATION,
        "field K1",
    ),
    fault("infinite number", |f| edit_calibration(f, "T2", ".Inf, 0, 0"), CALIBRATION, "field T2"),
    fault("not a rotation", |f| edit_calibration(f, "R2", "2, 0, 0, 0, 2, 0, 0, 0, 2"), CALIBRATION, "field R2"),
    fault("mirrored rotation", |f| edit_calibration(f, "Rp", "1, 0, 0, 0, 1, 0, 0, 0, -1"), CALIBRATION, "field Rp"),
    fault("negative focal length", negate_focal_length, CALIBRATION, "field K2"),
    fault("inverted rotation", invert_rotation, CALIBRATION, "field R2"),
    fault("swapped cameras with different image sizes", swap_cameras_of_different_sizes, CALIBRATION, "field size1"),
    fault("calibration for another image size", |f| edit_calibration(f, "size2", "32, 64"), CALIBRATION, "field size2"),
    fault("volume behind the camera", move_volume_behind_camera, META, "field volume: the volume is behind camera 1"),
    fault("volume turned inside out", |f| edit_meta(f, "/volume/min", json!([50, 40, 12.5])), META, "field volume"),
    fault("impossible period", |f| edit_meta(f, "/period_px", json!(0)), META, "field period_px"),
    fault("impossible bit depth", |f| set_bits(f, 9), META, "field bits: is 9"),
    fault("raw image without a format", add_raw_image, "cam1/phase_00.raw", "add the field source"),
    fault("unknown camera format", |f| set_source(f, json!({"format": "RGBB"})), META, "field source.format: \"RGBB\""),
    fault(
        "unknown layout",
        |f| set_source(f, json!({"format": "GREY", "stereo_layout": "left-right"})),
        META,
        "field source.stereo_layout: is \"left-right\"; it must be one of",
    ),
    fault(
        "grey level of a mosaic for a grey format",
        |f| set_source(f, json!({"format": "GREY", "bayer": "raw"})),
        META,
        "field source: GREY images are no Bayer mosaic",
    ),
    fault(
        "unknown key of the source",
        |f| set_source(f, json!({"format": "GREY", "layout": "side-by-side"})),
        META,
        "unknown field `layout`",
    ),
    fault(
        "layout of a format that has its own",
        |f| set_source(f, json!({"format": "Y8I", "stereo_layout": "top-bottom"})),
        META,
        "remove the layout top-bottom",
    ),
    fault(
        "images of both views that do not exist",
        |f| set_source(f, json!({"format": "Y8I"})),
        "set/both",
        "both cameras",
    ),
    fault("images of both views without a format", add_images_of_both, "set/cam1", "add the field source"),
    fault("missing camera", |f| remove_folder(&f.join("cam2")), "set/cam2", "images of a camera"),
    fault("depth beside a source", set_bits_and_source, META, "field bits: is 12, but the depth follows from"),
    fault("an image in two files", add_second_file, "cam1/phase_00", "is the same image as"),
    Fault {
        name: "PNG of a packed format",
        found_in: FoundIn::Images,
        damage: |f| set_source(f, json!({"format": "Y12P"})),
        file: "phase_0",
        says: "is a PNG image, but field source of meta.json says Y12P",
    },
    Fault {
        name: "grey PNG declared as colours",
        found_in: FoundIn::Images,
        damage: |f| set_source(f, json!({"format": "RGB3"})),
        file: "phase_0",
        says: "field source of meta.json says RGB3",
    },
    Fault {
        name: "raw image of the wrong length",
        found_in: FoundIn::Images,
        damage: |f| replace_by_raw(f, SIZE_PX[0] * SIZE_PX[1] - 1),
        file: "cam2/phase_01.raw",
        says: "has 4095 bytes; a GREY image of 64 × 64 pixels has 4096",
    },
    image_fault("truncated image", truncate_image, "is not an intact image"),
    image_fault(
        "image of another size",
        |f| replace_image(f, ColorType::Grayscale, BitDepth::Eight, OTHER_SIZE, &[]),
        "32 × 64",
    ),
    image_fault(
        "16-bit image",
        |f| replace_image(f, ColorType::Grayscale, BitDepth::Sixteen, SAME_SIZE, &[1, 2]),
        "16-bit",
    ),
    Fault {
        name: "8-bit images declared as 12-bit",
        found_in: FoundIn::Images,
        damage: |f| set_bits(f, 12),
        file: "phase_0",
        says: "is an 8-bit image among those of 12 bits",
    },
    image_fault(
        "colour image",
        |f| replace_image(f, ColorType::Rgb, BitDepth::Eight, SAME_SIZE, &[9, 8, 7]),
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

/// Copies the calibration to a file with another ending that OpenCV writes.
fn add_second_calibration(folder: &Path) {
    std::fs::copy(folder.join(CALIBRATION), folder.join("calibration.xml")).unwrap();
}

/// Gives the images of both cameras another ending.
fn rename_images(folder: &Path, ending: &str) {
    for camera in ["cam1", "cam2"] {
        for step in 0..4 {
            let image = folder.join(format!("{camera}/phase_{step:02}.png"));
            std::fs::rename(&image, image.with_extension(ending)).unwrap();
        }
    }
}

/// Writes the lengths of the calibration in squares of 20 mm.
fn scale_lengths(folder: &Path) {
    let mut rig = input::rig();
    for pose in [&mut rig.cam2_from_cam1, &mut rig.projector_from_cam1] {
        pose.translation.vector /= 20.0;
    }
    write_calibration(&folder.join(CALIBRATION), &rig, Unit::Millimetre).unwrap();
}

/// Makes the images of camera 2 smaller, and its calibration with them.
fn shrink_camera_2(folder: &Path) {
    let mut rig = input::rig();
    rig.cam2 = Camera::new(rig.cam2.focal_px(), rig.cam2.principal_px(), *rig.cam2.distortion(), [32, 64]);
    write_calibration(&folder.join(CALIBRATION), &rig, Unit::Millimetre).unwrap();
    for step in 0..4 {
        let image = folder.join(format!("cam2/phase_{step:02}.png"));
        write_image(&image, ColorType::Grayscale, BitDepth::Eight, OTHER_SIZE, &[]);
    }
}

fn remove_folder(folder: &Path) {
    std::fs::remove_dir_all(folder).unwrap();
}

fn remove_file(folder: &Path, name: &str) {
    std::fs::remove_file(folder.join(name)).unwrap();
}

fn add_image(folder: &Path) {
    std::fs::copy(folder.join("cam1/phase_00.png"), folder.join("cam1/phase_04.png")).unwrap();
}

fn truncate_image(folder: &Path) {
    let file = std::fs::File::options().write(true).open(folder.join(PHASE_IMAGE)).unwrap();
    file.set_len(file.metadata().unwrap().len() / 2).unwrap();
}

fn replace_image(folder: &Path, color: ColorType, depth: BitDepth, size: [u32; 2], first: &[u8]) {
    write_image(&folder.join(PHASE_IMAGE), color, depth, size, first);
}

fn negate_focal_length(folder: &Path) {
    edit_calibration(folder, "K2", "-184, 0, 31.5, 0, 184, 31.5, 0, 0, 1");
}

/// Adds the field `bits` to `meta.json`, which 8-bit datasets leave out.
fn set_bits(folder: &Path, bits: u8) {
    add_field(folder, "bits", json!(bits));
}

fn set_source(folder: &Path, source: serde_json::Value) {
    add_field(folder, "source", source);
}

fn set_bits_and_source(folder: &Path) {
    set_bits(folder, 12);
    set_source(folder, json!({"format": "Y12"}));
}

fn add_field(folder: &Path, field: &str, value: serde_json::Value) {
    let path = folder.join(META);
    let mut meta: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    meta[field] = value;
    std::fs::write(&path, meta.to_string()).unwrap();
}

fn add_raw_image(folder: &Path) {
    std::fs::rename(folder.join("cam1/phase_00.png"), folder.join("cam1/phase_00.raw")).unwrap();
}

/// Puts images of both views in place of those of the cameras.
fn add_images_of_both(folder: &Path) {
    std::fs::rename(folder.join("cam1"), folder.join("both")).unwrap();
    remove_folder(&folder.join("cam2"));
}

fn add_second_file(folder: &Path) {
    set_source(folder, json!({"format": "GREY"}));
    std::fs::write(folder.join("cam1/phase_00.raw"), vec![0; SIZE_PX[0] * SIZE_PX[1]]).unwrap();
}

/// Replaces an image by a raw file of this length.
fn replace_by_raw(folder: &Path, bytes: usize) {
    set_source(folder, json!({"format": "GREY"}));
    remove_file(folder, PHASE_IMAGE);
    std::fs::write(folder.join("cam2/phase_01.raw"), vec![0; bytes]).unwrap();
}

fn move_volume_behind_camera(folder: &Path) {
    edit_meta(folder, "/volume/T_v", json!([0, 0, -310]));
}

/// Inverts R2, as if the convention were x1 = R2·x2.
fn invert_rotation(folder: &Path) {
    let mut rig = input::rig();
    rig.cam2_from_cam1.rotation = rig.cam2_from_cam1.rotation.inverse();
    write_calibration(&folder.join(CALIBRATION), &rig, Unit::Millimetre).unwrap();
}

/// Swaps the cameras of a rig in which C1 has smaller images than the dataset.
fn swap_cameras_of_different_sizes(folder: &Path) {
    let mut rig = input::rig();
    let half = Camera::new(rig.cam2.focal_px(), rig.cam2.principal_px(), *rig.cam2.distortion(), [32, 64]);
    (rig.cam1, rig.cam2) = (half, rig.cam1);
    write_calibration(&folder.join(CALIBRATION), &rig, Unit::Millimetre).unwrap();
}

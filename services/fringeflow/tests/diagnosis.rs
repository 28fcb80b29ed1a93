//! What is said first about images and calibrations that do not belong together, or hold no good fringes.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

use fringeflow::calibration::{Mistake, Unit, write_calibration};
use fringeflow::geometry::Rig;
use fringeflow_base::grey::PixelFormat;
use fringeflow_dataset::{CALIBRATION_FILE, GreyImage, read_grey, write_png};
use fringeflow_lab::simulation::{NoiseLevel, Object, RigOptions, Simulation, SimulationOptions};

const STEPS: usize = 4;
const CAMERAS: [&str; 2] = ["cam1", "cam2"];

fn simulation() -> Simulation {
    let usual = SimulationOptions::usual(Object::Nose);
    let rig = RigOptions { size_px: [240, 192], ..usual.rig };
    let options = SimulationOptions { rig, steps: STEPS, noise: NoiseLevel::Low, supersampling: 1, ..usual };
    Simulation::new(options).unwrap()
}

/// A change of a dataset folder, and the beginning of the first line that is printed.
type Case = (&'static str, fn(&Path, &Rig), &'static str);

const CASES: &[Case] = &[
    ("intact", |_, _| (), "nose: "),
    ("camera 2 is black", |set, _| change(set, &CAMERAS[1..], |_| 0), "unused grey levels, camera 2: bad, 100.0 %"),
    ("one image four times", |set, _| order(set, [0; STEPS]), "pixels without fringes, camera 1: bad, 100.0 %"),
    (
        "three times overexposed",
        |set, _| change(set, &CAMERAS, |grey| grey.saturating_mul(3)),
        "saturated pixels, camera",
    ),
    ("12 bits in 16", write_12_bits, "unused grey levels, camera 1: bad, 9"),
    ("reverse order", |set, _| order(set, [0, 3, 2, 1]), "the fringes seem to run the other way"),
    ("two steps exchanged", |set, _| order(set, [0, 1, 3, 2]), "fit residual, camera 1: bad"),
    ("camera 2 upside down", |set, _| turn(set, &CAMERAS[1..]), "the images of camera 2 seem to be upside down"),
    ("both upside down", |set, _| turn(set, &CAMERAS), "the images of both cameras seem to be upside down"),
    ("R2, T2 inverted", |set, rig| write(set, rig, Mistake::Cam2Inverted), "R2 and T2 seem to be inverted"),
    ("Rp, Tp inverted", |set, rig| write(set, rig, Mistake::ProjectorInverted), "Rp and Tp seem to be inverted"),
    (
        "calibrated at half the resolution",
        |set, rig| write(set, rig, Mistake::Resolution(0.5)),
        "K1 and K2 seem to be those of images of another resolution; fx, fy, cx and cy must be 2 times",
    ),
    ("camera 1 twice", write_camera_1_twice, "the images of both cameras are the same"),
    (
        "projector from camera 2",
        |set, rig| write_projector_from_camera_2(set, rig),
        "Rp and Tp seem to start from camera 2",
    ),
];

#[test]
fn the_first_line_says_what_is_wrong() {
    let (simulation, folder) = (simulation(), tempfile::tempdir().unwrap());
    let rig = simulation.rig().calibrated;
    for (case, change, expected) in CASES {
        let set = folder.path().join(case);
        simulation.write(&set, || ()).unwrap();
        change(&set, &rig);
        let output = fringeflow(&["reconstruct".as_ref(), &set, "-o".as_ref(), &folder.path().join("cloud.ply")]);
        let line = first_line(&output, &set);
        assert!(line.starts_with(expected), "{case}: {line}");
        // Only images that yield points may end well.
        assert!(output.status.code() == Some(if output.stdout.is_empty() { 2 } else { 0 }), "{case}: {output:?}");
    }
}

#[test]
fn import_says_what_is_wrong_with_the_images() {
    let (simulation, folder) = (simulation(), tempfile::tempdir().unwrap());
    let set = folder.path().join("nose");
    simulation.write(&set, || ()).unwrap();
    change(&set, &CAMERAS, |grey| grey.saturating_mul(3));
    let output = fringeflow(&["import".as_ref(), &set, "-o".as_ref(), &folder.path().join("nose.mcap")]);
    assert!(output.status.success(), "{output:?}");
    assert!(first_line(&output, &set).starts_with("saturated pixels, camera 1: bad"), "{output:?}");
}

fn fringeflow(arguments: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fringeflow")).args(arguments).output().unwrap()
}

/// The first line of what a person reads, without its marks.
fn first_line(output: &Output, set: &Path) -> String {
    let text = if output.stdout.is_empty() { &output.stderr } else { &output.stdout };
    let line = String::from_utf8_lossy(text).lines().next().unwrap().to_owned();
    let line = line.strip_prefix("fringeflow: ").unwrap_or(&line);
    let line = line.strip_prefix(&format!("{}: ", set.display())).unwrap_or(line);
    line.strip_prefix("warning: ").unwrap_or(line).to_owned()
}

fn image_path(set: &Path, camera: &str, step: usize) -> std::path::PathBuf {
    set.join(camera).join(format!("phase_{step:02}.png"))
}

fn images(set: &Path, camera: &str) -> Vec<GreyImage> {
    (0..STEPS).map(|step| read_grey(&image_path(set, camera, step), None, None).unwrap()).collect()
}

fn rewrite(set: &Path, cameras: &[&str], new: impl Fn(Vec<GreyImage>) -> Vec<GreyImage>) {
    for camera in cameras {
        for (step, image) in new(images(set, camera)).iter().enumerate() {
            write_png(&image_path(set, camera, step), image).unwrap();
        }
    }
}

fn change(set: &Path, cameras: &[&str], new: fn(u8) -> u8) {
    rewrite(set, cameras, |mut images| {
        images.iter_mut().flat_map(|image| &mut image.pixels).for_each(|grey| *grey = new(*grey));
        images
    });
}

fn order(set: &Path, steps: [usize; STEPS]) {
    rewrite(set, &CAMERAS, |images| steps.map(|step| images[step].clone()).into());
}

fn turn(set: &Path, cameras: &[&str]) {
    rewrite(set, cameras, |mut images| {
        images.iter_mut().for_each(|image| image.pixels.reverse());
        images
    });
}

fn write_12_bits(set: &Path, _: &Rig) {
    rewrite(set, &CAMERAS, |images| {
        let deep = |image: GreyImage| {
            let pixels = image.pixels.iter().flat_map(|&grey| (u16::from(grey) << 4).to_le_bytes()).collect();
            GreyImage { format: PixelFormat::Y16, pixels, ..image }
        };
        images.into_iter().map(deep).collect()
    });
}

fn write_camera_1_twice(set: &Path, _: &Rig) {
    let of_camera_1 = images(set, CAMERAS[0]);
    rewrite(set, &CAMERAS[1..], |_| of_camera_1.clone());
}

/// Writes the calibration with a mistake, by what would undo its opposite.
fn write(set: &Path, rig: &Rig, mistake: Mistake) {
    write_calibration(&set.join(CALIBRATION_FILE), &mistake.corrected(rig), Unit::Millimetre).unwrap();
}

fn write_projector_from_camera_2(set: &Path, rig: &Rig) {
    let wrong = Rig { projector_from_cam1: rig.projector_from_cam1 * rig.cam2_from_cam1.inverse(), ..*rig };
    write_calibration(&set.join(CALIBRATION_FILE), &wrong, Unit::Millimetre).unwrap();
}

//! Images of the virtual scanner for the virtual machine. The host makes datasets and reconstructs their clouds. The
//! guest feeds the images to its cameras and compares the resulting clouds.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use fringeflow_pixels::{SourceFormat, StereoLayout};

use crate::machine::{SHARE, program};

/// Objects of the scenes: one window each, with the same rig.
const OBJECTS: [&str; 3] = ["plane", "tooth", "prism"];
const FOLDER: &str = "scenes";
/// Size of each camera's images in the scene of a device.
pub(crate) const DEVICE_SIZE_PX: [usize; 2] = [320, 180];
/// Steps of a window.
pub(crate) const STEPS: usize = 4;

/// A dataset, and the cloud that `fringeflow reconstruct` makes from it.
#[derive(Debug)]
pub(crate) struct Scene {
    dataset: PathBuf,
}

impl Scene {
    /// Grey levels of the image of a camera (1 or 2) and a step, and its width and height.
    pub(crate) fn image(&self, camera: u32, step: usize) -> (Vec<u8>, [u32; 2]) {
        let file = self.dataset.join(format!("cam{camera}/phase_{step:02}.png"));
        read_png(&file)
    }

    /// The bytes of an image as a device sends it: a raw file, or the grey levels of a PNG.
    pub(crate) fn device_image(&self, folder: &str, step: usize) -> Vec<u8> {
        let raw = self.dataset.join(format!("{folder}/phase_{step:02}.raw"));
        if raw.exists() {
            return fs::read(raw).unwrap();
        }
        let (mut bytes, [width, height]) = read_png(&raw.with_extension("png"));
        if bytes.len() > width as usize * height as usize {
            // Deep levels are big endian in a PNG, and little endian in the formats of devices.
            bytes.as_chunks_mut::<2>().0.iter_mut().for_each(|level| level.reverse());
        }
        bytes
    }

    /// The PLY file of the cloud, with its dataset name replaced by `name`.
    pub(crate) fn cloud(&self, name: &str) -> Vec<u8> {
        let file = fs::read(self.dataset.with_extension("ply")).unwrap();
        let named = |name: &str| format!("\ncomment dataset {name}\n").into_bytes();
        let own = named(self.dataset.file_name().unwrap().to_str().unwrap());
        let start = file.windows(own.len()).position(|bytes| bytes == own).unwrap();
        [&file[..start], &named(name), &file[start + own.len()..]].concat()
    }

    /// The tables of a configuration that describe rig, pattern and volume.
    pub(crate) fn rig_tables(&self) -> String {
        let meta: Value = serde_json::from_slice(&fs::read(self.dataset.join("meta.json")).unwrap()).unwrap();
        let unit = meta["unit"].clone();
        let tables = serde_json::json!({
            "rig": { "calibration": self.dataset.join("calibration.yml"), "unit": unit },
            "pattern": {
                "steps": meta["steps"],
                "period_px": meta["period_px"],
                "phase_sign": meta["phase_sign"],
                "phase_offset_rad": meta["phase_offset_rad"],
                "phase_shift_rad": meta["phase_shift_rad"],
            },
            "measurement_volume": { "unit": unit, "box": meta["volume"] },
        });
        toml::to_string(&tables).unwrap()
    }
}

/// Makes all scenes and their clouds in the share. Runs on the host.
pub(crate) fn make_scenes(share: &Path) {
    let folder = share.join(FOLDER);
    fs::create_dir(&folder).unwrap();
    for object in OBJECTS {
        let scene = Scene { dataset: folder.join(object) };
        simulate(&scene, &["--object", object, "--size", "320x180", "--period", "32"]);
        let mut reconstruct = Command::new(program());
        run_command(
            reconstruct.arg("reconstruct").arg(&scene.dataset).arg("-o").arg(scene.dataset.with_extension("ply")),
        );
    }
}

/// Makes a scene with images of a device with this format. [`of_name`] finds it.
pub(crate) fn make_device_scene(share: &Path, name: &str, format: SourceFormat, layout: Option<StereoLayout>) {
    let folder = share.join(FOLDER);
    fs::create_dir_all(&folder).unwrap();
    let size = DEVICE_SIZE_PX.map(|side| side.to_string()).join("x");
    let mut options = vec!["--object", "plane", "--size", &size, "--period", "32"];
    if format != SourceFormat::Grey {
        options.extend(["--format", format.name()]);
    }
    if let Some(layout) = layout {
        options.extend(["--stereo-layout", layout.name()]);
    }
    simulate(&Scene { dataset: folder.join(name) }, &options);
}

/// Makes a scene with images of another size, for example "80x72". [`of_name`] finds it by the size.
pub(crate) fn make_scene_of_size(share: &Path, size: &str) {
    simulate(&Scene { dataset: share.join(FOLDER).join(size) }, &["--object", "plane", "--size", size]);
}

/// The scenes of [`make_scenes`], in the guest.
pub(crate) fn all() -> Vec<Scene> {
    OBJECTS.map(of_name).into()
}

/// A scene of [`make_scene_of_size`] or [`make_device_scene`], in the guest.
pub(crate) fn of_name(name: &str) -> Scene {
    Scene { dataset: Path::new(SHARE).join(FOLDER).join(name) }
}

/// Bytes of the pixels of a PNG file, and its width and height.
fn read_png(file: &Path) -> (Vec<u8>, [u32; 2]) {
    let mut image = png::Decoder::new(BufReader::new(File::open(file).unwrap())).read_info().unwrap();
    let mut pixels = vec![0; image.output_buffer_size().unwrap()];
    let info = image.next_frame(&mut pixels).unwrap();
    (pixels, [info.width, info.height])
}

fn simulate(scene: &Scene, options: &[&str]) {
    let common = "--board none --depth 25 --sd 0 --no-gray --noise low --supersampling 1";
    let mut simulate = Command::new(program());
    simulate.args(["simulate", "--steps", &STEPS.to_string()]).args(common.split(' ')).args(options);
    run_command(simulate.arg("-o").arg(&scene.dataset));
}

fn run_command(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

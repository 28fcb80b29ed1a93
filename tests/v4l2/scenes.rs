//! Images of the virtual scanner for the virtual machine: the host makes datasets and reconstructs their clouds, the guest
//! feeds the images to its cameras and compares what comes of them.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::machine::{SHARE, program};

/// What is measured, one window each; the rig is the same.
const OBJECTS: [&str; 3] = ["plane", "tooth", "prism"];
const FOLDER: &str = "scenes";
/// Steps of a window.
pub(crate) const STEPS: usize = 4;

/// A dataset and the cloud that `fringeflow reconstruct` makes of it.
#[derive(Debug)]
pub(crate) struct Scene {
    dataset: PathBuf,
}

impl Scene {
    /// Grey levels of the image that a camera (1 or 2) takes of a step, and its width and height.
    pub(crate) fn image(&self, camera: u32, step: usize) -> (Vec<u8>, [u32; 2]) {
        let file = self.dataset.join(format!("cam{camera}/phase_{step:02}.png"));
        let mut image = png::Decoder::new(BufReader::new(File::open(file).unwrap())).read_info().unwrap();
        let mut pixels = vec![0; image.output_buffer_size().unwrap()];
        let info = image.next_frame(&mut pixels).unwrap();
        (pixels, [info.width, info.height])
    }

    /// The cloud as a PLY file, which names its dataset; here by another name.
    pub(crate) fn cloud(&self, name: &str) -> Vec<u8> {
        let file = fs::read(self.dataset.with_extension("ply")).unwrap();
        let named = |name: &str| format!("\ncomment dataset {name}\n").into_bytes();
        let own = named(self.dataset.file_name().unwrap().to_str().unwrap());
        let start = file.windows(own.len()).position(|bytes| bytes == own).unwrap();
        [&file[..start], &named(name), &file[start + own.len()..]].concat()
    }

    /// The tables of a configuration that describe the rig.
    pub(crate) fn rig(&self) -> String {
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

/// Makes all scenes in a share, on the host, with the clouds that their images give there.
pub(crate) fn make(share: &Path) {
    let folder = share.join(FOLDER);
    fs::create_dir(&folder).unwrap();
    for object in OBJECTS {
        let scene = Scene { dataset: folder.join(object) };
        simulate(&scene, &["--object", object, "--size", "320x180", "--period", "32"]);
        let mut reconstruct = Command::new(program());
        done(reconstruct.arg("reconstruct").arg(&scene.dataset).arg("-o").arg(scene.dataset.with_extension("ply")));
    }
}

/// Makes a scene with images of another size, "80x72" for instance, by which [`of_size`] finds it.
pub(crate) fn make_of_size(share: &Path, size: &str) {
    simulate(&Scene { dataset: share.join(FOLDER).join(size) }, &["--object", "plane", "--size", size]);
}

/// The scenes of [`make`], in the guest.
pub(crate) fn all() -> Vec<Scene> {
    OBJECTS.map(|object| Scene { dataset: Path::new(SHARE).join(FOLDER).join(object) }).into()
}

/// A scene of [`make_of_size`], in the guest.
pub(crate) fn of_size(size: &str) -> Scene {
    Scene { dataset: Path::new(SHARE).join(FOLDER).join(size) }
}

fn simulate(scene: &Scene, options: &[&str]) {
    let same = "--board none --depth 25 --sd 0 --no-gray --noise low --supersampling 1";
    let mut simulate = Command::new(program());
    simulate.args(["simulate", "--steps", &STEPS.to_string()]).args(same.split(' ')).args(options);
    done(simulate.arg("-o").arg(&scene.dataset));
}

fn done(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

//! Images of the virtual scanner for the virtual machine: the host makes datasets and reconstructs their clouds, the guest
//! feeds the images to its cameras and compares what comes of them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::machine::{SHARE, program};

/// What is measured, one window each; the rig is the same.
const OBJECTS: [&str; 3] = ["plane", "tooth", "prism"];
const FOLDER: &str = "scenes";
/// Steps of a window.
pub(crate) const STEPS: usize = 4;
/// Width and height of the images, pixels.
pub(crate) const SIZE_PX: [usize; 2] = [320, 180];

/// A dataset and the cloud that `fringeflow reconstruct` makes of it.
#[derive(Debug)]
pub(crate) struct Scene {
    dataset: PathBuf,
}

impl Scene {
    /// Grey levels of the image that a camera (1 or 2) takes of a step.
    pub(crate) fn image(&self, camera: u32, step: usize) -> Vec<u8> {
        let file = self.dataset.join(format!("cam{camera}/phase_{step:02}.png"));
        let mut decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(file).unwrap())).read_info().unwrap();
        let mut pixels = vec![0; decoder.output_buffer_size().unwrap()];
        decoder.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels.len(), SIZE_PX[0] * SIZE_PX[1]);
        pixels
    }

    /// The cloud, as a PLY file.
    pub(crate) fn cloud(&self) -> Vec<u8> {
        fs::read(self.dataset.with_extension("ply")).unwrap()
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

/// Makes them in a share, on the host.
pub(crate) fn make(share: &Path) {
    let size = format!("{}x{}", SIZE_PX[0], SIZE_PX[1]);
    let steps = STEPS.to_string();
    fs::create_dir(share.join(FOLDER)).unwrap();
    for scene in scenes(share) {
        let object = scene.dataset.file_name().unwrap();
        let rig = "--board none --depth 25 --period 32 --sd 0 --no-gray --noise low --supersampling 1";
        let mut simulate = Command::new(program());
        simulate.args(["simulate", "--size", &size, "--steps", &steps]).args(rig.split(' '));
        done(simulate.arg("--object").arg(object).arg("-o").arg(&scene.dataset));
        let mut reconstruct = Command::new(program());
        done(reconstruct.arg("reconstruct").arg(&scene.dataset).arg("-o").arg(scene.dataset.with_extension("ply")));
    }
}

/// Those that the host has made, in the guest.
pub(crate) fn all() -> Vec<Scene> {
    scenes(Path::new(SHARE))
}

fn scenes(share: &Path) -> Vec<Scene> {
    OBJECTS.map(|object| Scene { dataset: share.join(FOLDER).join(object) }).into()
}

fn done(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

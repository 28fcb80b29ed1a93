//! An intact dataset folder, and functions that damage it.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use fringeflow::geometry::Rig;
use fringeflow_dataset::{CALIBRATION_FILE, GreyImage, META_FILE, read_grey};
use fringeflow_lab::simulation::{Board, NoiseLevel, Object, RigOptions, Simulation, SimulationOptions};

/// Width and height of the images, pixels: the smallest that the virtual scanner accepts.
pub(crate) const SIZE_PX: [usize; 2] = [64, 64];

/// The object is a plane. The fringes are wide enough for so few pixels.
fn simulation() -> &'static Simulation {
    static SIMULATION: OnceLock<Simulation> = OnceLock::new();
    SIMULATION.get_or_init(|| {
        let options = SimulationOptions {
            board: Board::None,
            rig: RigOptions { size_px: SIZE_PX, period_px: 64.0, sd_rad: 0.0, ..RigOptions::usual(0.025) },
            steps: 4,
            noise: NoiseLevel::None,
            supersampling: 1,
            ..SimulationOptions::usual(Object::Plane)
        };
        Simulation::new(options).unwrap()
    })
}

/// Writes an intact dataset folder.
pub(crate) fn write_intact(folder: &Path) {
    simulation().write(folder, || ()).unwrap();
}

/// Returns the rig of the dataset.
pub(crate) fn rig() -> Rig {
    simulation().rig().exact
}

/// Replaces the values of a field of the calibration file.
pub(crate) fn edit_calibration(folder: &Path, field: &str, values: &str) {
    let path = folder.join(CALIBRATION_FILE);
    let text = std::fs::read_to_string(&path).unwrap();
    let start = text.find(&format!("{field}: !!opencv-matrix")).unwrap();
    let data = start + text[start..].find("data: [").unwrap();
    let end = data + text[data..].find(']').unwrap();
    std::fs::write(&path, format!("{}data: [ {values} {}", &text[..data], &text[end..])).unwrap();
}

/// Replaces the value of a field of `meta.json`. `pointer` is its path from the top: `/volume/T_v`.
pub(crate) fn edit_meta(folder: &Path, pointer: &str, value: serde_json::Value) {
    let path = folder.join(META_FILE);
    let mut meta: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    *meta.pointer_mut(pointer).unwrap() = value;
    std::fs::write(&path, meta.to_string()).unwrap();
}

/// Writes a PNG image of any kind. All samples are 0, except for the first ones.
pub(crate) fn write_image(
    file: &Path,
    color: png::ColorType,
    depth: png::BitDepth,
    [width, height]: [u32; 2],
    first: &[u8],
) {
    let mut encoder = png::Encoder::new(std::fs::File::create(file).unwrap(), width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let mut bytes = vec![0; width as usize * height as usize * color.samples() * depth as usize / 8];
    bytes[..first.len()].copy_from_slice(first);
    encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
}

/// A change of a dataset folder.
pub(crate) type Change = fn(&Path);

/// Changes of a dataset folder that leave its images and its calibration the same.
pub(crate) const OTHER_NAMES: &[(&str, Change)] = &[
    ("TIFF", |folder| rewrite_images(folder, "tif", image::ImageFormat::Tiff)),
    ("BMP", |folder| rewrite_images(folder, "BMP", image::ImageFormat::Bmp)),
    ("PGM", |folder| rewrite_images(folder, "pgm", image::ImageFormat::Pnm)),
    ("BMP named PNG", |folder| rewrite_images(folder, "png", image::ImageFormat::Bmp)),
    ("endings in capitals", |folder| rename_images(folder, |step| format!("phase_{step:02}.PNG"))),
    ("numbers from 1", |folder| rename_images(folder, |step| format!("phase_{}.png", step + 1))),
    ("numbers of three digits", |folder| rename_images(folder, |step| format!("phase_{step:03}.png"))),
    ("calibration.yaml", |folder| {
        std::fs::rename(folder.join(CALIBRATION_FILE), folder.join("calibration.yaml")).unwrap();
    }),
    ("byte order marks", |folder| {
        for name in [CALIBRATION_FILE, META_FILE] {
            let text = std::fs::read_to_string(folder.join(name)).unwrap();
            std::fs::write(folder.join(name), format!("\u{feff}{text}")).unwrap();
        }
    }),
];

/// The phase images of both cameras, the last ones first, with their steps.
fn phase_images(folder: &Path) -> impl Iterator<Item = (usize, PathBuf)> {
    let steps = (0..4).rev();
    let files = steps.flat_map(|step| ["cam1", "cam2"].map(|camera| (step, format!("{camera}/phase_{step:02}.png"))));
    files.map(|(step, name)| (step, folder.join(name)))
}

fn rename_images(folder: &Path, name: impl Fn(usize) -> String) {
    for (step, image) in phase_images(folder) {
        std::fs::rename(&image, image.with_file_name(name(step))).unwrap();
    }
}

fn rewrite_images(folder: &Path, ending: &str, format: image::ImageFormat) {
    for (_, path) in phase_images(folder) {
        let GreyImage { width, height, pixels, .. } = read_grey(&path, None, None).unwrap();
        let image = image::GrayImage::from_raw(width as u32, height as u32, pixels).unwrap();
        std::fs::remove_file(&path).unwrap();
        image.save_with_format(path.with_extension(ending), format).unwrap();
    }
}

/// Lists all files and folders below a folder, sorted.
pub(crate) fn list_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let below = |path: PathBuf| std::iter::once(path.clone()).chain(list_files(&path)).collect::<Vec<_>>();
    let mut found: Vec<PathBuf> = entries.flat_map(|entry| below(entry.unwrap().path())).collect();
    found.sort();
    found
}

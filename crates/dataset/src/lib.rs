//! Dataset folders: the images of one fringe sequence, their calibration, and the ground truth.
//!
//! ```text
//! FOLDER/meta.json            unit, image size, pattern, phase shifts, measurement volume, motion of the object
//! FOLDER/calibration.yml      OpenCV FileStorage; also .yaml, .xml, .json
//! FOLDER/cam1/, FOLDER/cam2/  phase_00.png …, gray_00.png … (most significant bit first), white.png, black.png;
//!                             vphase_00.png …, vgray_00.png … for a second fringe direction
//! FOLDER/truth.npz            ground truth, if it is known
//! ```
//!
//! With the field `source` of `meta.json`, images are as the cameras sent them, and are converted when they are read:
//! `cam1/phase_00.raw` and so on, or `both/phase_00.raw` if an image holds both views; a PNG with the values of a Bayer
//! mosaic or with colours works as well.
//!
//! Images have 8 or 16 bits. With 16 bits, the field `bits` of `meta.json` states how many low bits hold the value: 10,
//! 12, 14 or 16. Opening a folder checks `meta.json`, the calibration, and that all images exist; the images are read
//! on request.
//!
//! A [`Setup`] is the checked content of `meta.json` and `calibration.yml`:
//!
//! ```
//! use fringeflow_dataset::{Setup, SetupText};
//!
//! let description = r#"{ "unit": "mm", "image_size": [64, 48], "steps": 4, "phase_shift_rad": [0.0, 1.57, 3.14],
//!                        "period_px": 16.0, "phase_sign": 1.0, "phase_offset_rad": 0.0 }"#;
//! let text = SetupText { description: description.to_owned(), calibration: "%YAML:1.0".to_owned() };
//! let error = Setup::parse(text, None).unwrap_err();
//! assert_eq!(
//!     error.to_string(),
//!     "meta.json: field steps: is 4; it must lie between 3 and the number of phase_shift_rad, 3"
//! );
//! ```

#![forbid(unsafe_code)]

mod contents;
mod decode;
mod error;
mod fields;
mod image;
mod image_files;
mod meta;
mod misspelt;
mod motion;
mod picture;
mod sequence;
mod setup;
mod source;
mod truth;
mod write;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use fringeflow::calibration::{self, Unit};
use fringeflow_base::grey::PixelFormat;
use fringeflow_base::text_file;
use fringeflow_pixels::DeviceImages;

use image_files::ImageFiles;

pub use error::{DatasetError, Problem};
pub use image::{GreyImage, read_grey, write_png};
pub use meta::{VolumeDescription, read_volume};
pub use motion::Motion;
pub use picture::read_picture;
pub use sequence::{FringeSequence, UnevenSteps, evenly_spaced};
pub use setup::{Setup, SetupError, SetupText};
pub use truth::{CapturedTruth, RenderedTruth, Truth};
pub use write::{DatasetDescription, DatasetWriter, ImageKind, check_new};

/// A camera of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraId {
    /// Camera 1, whose pixels become the points.
    Cam1,
    /// Camera 2, in which correspondences are searched.
    Cam2,
}

impl CameraId {
    /// Both cameras, in order.
    pub const BOTH: [Self; 2] = [Self::Cam1, Self::Cam2];

    /// Name of the folder with its images.
    #[must_use]
    pub fn folder(self) -> &'static str {
        match self {
            Self::Cam1 => "cam1",
            Self::Cam2 => "cam2",
        }
    }
}

/// An opened dataset folder.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// The folder.
    pub folder: PathBuf,
    /// Rig, fringe pattern and measurement volume.
    pub setup: Setup,
    /// Bit depth of all images: that of `meta.json`, or else that of the first file.
    pub pixel_format: PixelFormat,
    images_read: ImageCounter,
}

/// Number of images read from each camera. Clones of a dataset share it.
#[derive(Clone, Debug, Default)]
struct ImageCounter(Arc<[AtomicU64; 2]>);

/// Name of the calibration file in a dataset folder.
pub const CALIBRATION_FILE: &str = "calibration.yml";
/// Name of the exact calibration of a simulated dataset.
pub const EXACT_CALIBRATION_FILE: &str = "calibration_exact.yml";
/// Name of the description in a dataset folder.
pub const META_FILE: &str = "meta.json";
/// Name of the folder with images that hold the views of both cameras.
const FOLDER_OF_BOTH: &str = "both";
/// Name of the ground truth in a dataset folder.
pub const TRUTH_FILE: &str = "truth.npz";

/// Whether each image holds the views of both cameras.
fn holds_both_views(source: Option<DeviceImages>) -> bool {
    source.is_some_and(|images| images.holds_both_views())
}

/// Name of the folder with the images of a camera, or with images that hold the views of both.
fn image_folder_name(source: Option<DeviceImages>, camera: CameraId) -> &'static str {
    if holds_both_views(source) { FOLDER_OF_BOTH } else { camera.folder() }
}

impl Dataset {
    /// Opens a folder: reads and checks `meta.json` and the calibration, and checks that all images exist.
    ///
    /// `unit` is used if `meta.json` states none.
    ///
    /// # Errors
    /// [`DatasetError`] with file, field, value and remedy.
    pub fn open(folder: &Path, unit: Option<Unit>) -> Result<Self, DatasetError> {
        if !folder.is_dir() {
            return Err(DatasetError::new(folder, Problem::NotAFolder));
        }
        let calibration = contents::calibration_file(folder)?;
        let text = SetupText {
            description: read_text(&folder.join(META_FILE))?,
            calibration: calibration::read_calibration_text(&calibration)?,
        };
        let mut setup = Setup::parse(text, unit).map_err(|e| contents::explained(folder, &calibration, e))?;
        if setup.name.is_empty() {
            setup.name = folder_name(folder);
        }
        let mut dataset = Self {
            folder: folder.to_owned(),
            setup,
            pixel_format: PixelFormat::Grey,
            images_read: ImageCounter::default(),
        };
        dataset.check_images()?;
        // An error in this file is reported when the image is read.
        let stated_by_file = || contents::first_image(&dataset.image_folder(CameraId::Cam1))?.format().ok();
        dataset.pixel_format = dataset.setup.pixel_format.or_else(stated_by_file).unwrap_or_default();
        Ok(dataset)
    }

    /// Number of images of a camera that were read since the folder was opened.
    #[must_use]
    pub fn images_read(&self, camera: CameraId) -> u64 {
        self.images_read.0[camera as usize].load(Ordering::Relaxed)
    }

    /// Reads phase images by number, in the order given.
    ///
    /// # Errors
    /// An image is unreadable, has another size, or is not grey with the stated depth.
    pub fn phase_images(&self, camera: CameraId, numbers: &[usize]) -> Result<Vec<GreyImage>, DatasetError> {
        self.numbered_images(camera, "phase", self.setup.sequence.shifts_rad.len(), numbers)
    }

    /// Reads phase images of the second fringe direction by number.
    ///
    /// # Errors
    /// As [`Self::phase_images`].
    pub fn second_phase_images(&self, camera: CameraId, numbers: &[usize]) -> Result<Vec<GreyImage>, DatasetError> {
        let count = self.setup.second_direction.as_ref().map_or(0, |second| second.shifts_rad.len());
        self.numbered_images(camera, "vphase", count, numbers)
    }

    /// Reads all Gray-code images of one direction, most significant first; empty if there are none.
    ///
    /// # Errors
    /// As [`Self::phase_images`].
    pub fn gray_images(&self, camera: CameraId, second_direction: bool) -> Result<Vec<GreyImage>, DatasetError> {
        let (prefix, sequence) = match (&self.setup.second_direction, second_direction) {
            (Some(second), true) => ("vgray", second),
            (None, true) => return Ok(Vec::new()),
            (_, false) => ("gray", &self.setup.sequence),
        };
        let count = sequence.gray.map_or(0, |g| g.images);
        self.numbered_images(camera, prefix, count, &(0..count).collect::<Vec<_>>())
    }

    /// Reads the fully lit and the unlit image of a camera; `None` unless the folder has both.
    ///
    /// # Errors
    /// As [`Self::phase_images`].
    pub fn white_and_black(&self, camera: CameraId) -> Result<Option<(GreyImage, GreyImage)>, DatasetError> {
        let folder = self.image_folder(camera);
        let files = self.image_files(&folder);
        match (files.named("white")?, files.named("black")?) {
            (Some(white), Some(black)) => Ok(Some((self.image(camera, &white)?, self.image(camera, &black)?))),
            _ => Ok(None),
        }
    }

    /// Reads `truth.npz`; `None` if the folder has none.
    ///
    /// # Errors
    /// The file is unreadable, or an array has an unexpected name, shape or type.
    pub fn truth(&self) -> Result<Option<Truth>, DatasetError> {
        let path = self.folder.join(TRUTH_FILE);
        if !path.exists() {
            return Ok(None);
        }
        truth::read(&path, self.setup.image_size_px).map(Some).map_err(|p| DatasetError::new(&path, p))
    }

    /// Content of `truth.npz`; `None` if the folder has none.
    ///
    /// # Errors
    /// The file is unreadable.
    pub fn truth_bytes(&self) -> Result<Option<Vec<u8>>, DatasetError> {
        let path = self.folder.join(TRUTH_FILE);
        match std::fs::read(&path) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(DatasetError::new(&path, Problem::Unreadable(e))),
        }
    }

    /// Reads images of a kind with `count` images by number.
    fn numbered_images(
        &self,
        camera: CameraId,
        kind: &str,
        count: usize,
        numbers: &[usize],
    ) -> Result<Vec<GreyImage>, DatasetError> {
        let folder = self.image_folder(camera);
        let files = self.image_files(&folder);
        let available = files.numbered(kind, count)?;
        let find = |number: &usize| available.get(number).ok_or_else(|| files.missing(kind, *number));
        numbers.iter().map(|n| find(n).and_then(|path| self.image(camera, path))).collect()
    }

    fn image(&self, camera: CameraId, path: &Path) -> Result<GreyImage, DatasetError> {
        let image = match self.setup.source {
            None => read_grey(path, Some(self.setup.image_size_px), Some(self.pixel_format)),
            Some(images) => {
                let view = if images.holds_both_views() { camera as usize } else { 0 };
                source::read(path, images, self.setup.readout, view)
            }
        };
        let image = image.map_err(|p| DatasetError::new(path, p))?;
        self.images_read.0[camera as usize].fetch_add(1, Ordering::Relaxed);
        Ok(image)
    }

    /// The folder with the images of a camera.
    fn image_folder(&self, camera: CameraId) -> PathBuf {
        self.folder.join(image_folder_name(self.setup.source, camera))
    }

    /// Why a folder with images does not exist.
    fn why_no_images(&self) -> Problem {
        if holds_both_views(self.setup.source) {
            Problem::NoFolderOfBoth
        } else if self.folder.join(FOLDER_OF_BOTH).is_dir() {
            Problem::NoSourceOfBoth
        } else {
            Problem::NoCameraFolder
        }
    }

    fn image_files<'a>(&self, folder: &'a Path) -> ImageFiles<'a> {
        ImageFiles { folder, may_be_raw: self.setup.source.is_some() }
    }

    /// Checks that every sequence has exactly the images that `meta.json` states.
    fn check_images(&self) -> Result<(), DatasetError> {
        let directions =
            [(Some(&self.setup.sequence), "phase", "gray"), (self.setup.second_direction.as_ref(), "vphase", "vgray")];
        for camera in CameraId::BOTH {
            let folder = self.image_folder(camera);
            if !folder.is_dir() {
                return Err(DatasetError::new(&folder, self.why_no_images()));
            }
            let files = self.image_files(&folder);
            for (sequence, phase, gray) in directions {
                let count = sequence.map_or(0, |s| s.shifts_rad.len());
                files.check_numbers(phase, count)?;
                let count = sequence.and_then(|s| s.gray).map_or(0, |g| g.images);
                files.check_numbers(gray, count)?;
            }
        }
        Ok(())
    }
}

fn read_text(path: &Path) -> Result<String, DatasetError> {
    text_file::read_text(path).map_err(|e| DatasetError::new(path, e.into()))
}

fn folder_name(folder: &Path) -> String {
    folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

//! Writes a dataset folder atomically: into a temporary folder, which is renamed at the end.

use std::path::{Path, PathBuf};

use serde::Serialize;

use fringeflow::calibration::{Unit, write_calibration};
use fringeflow::geometry::{MeasurementVolume, Pose, Readout, Rig};
use fringeflow_base::atomic_file::WriteError;
use fringeflow_base::grey::PixelFormat;
use fringeflow_base::new_folder::{self, NewFolder};
use fringeflow_pixels::DeviceImages;

use super::meta::{RawReadout, RawSequence, VolumeDescription};
use super::motion::WrittenMotion;
use super::source::RawSource;
use super::{
    CALIBRATION_FILE, CameraId, Dataset, DatasetError, EXACT_CALIBRATION_FILE, FOLDER_OF_BOTH, FringeSequence,
    GreyImage, META_FILE, Motion, Problem, RenderedTruth, SetupText, TRUTH_FILE, image_folder_name, truth, write_png,
};

/// Content of a new `meta.json`.
#[derive(Clone, Debug)]
pub struct DatasetDescription {
    /// Name of the dataset.
    pub name: String,
    /// Unit of calibration files, volume and ground truth.
    pub unit: Unit,
    /// Region and binning of the sensor behind the images.
    pub readout: Readout,
    /// Bit depth of all images.
    pub pixel_format: PixelFormat,
    /// Format and arrangement of the image files, if they are as the cameras sent them.
    pub source: Option<DeviceImages>,
    /// Number of steps of a cycle.
    pub steps: usize,
    /// Fringes along the projector columns.
    pub sequence: FringeSequence,
    /// Fringes along the projector rows, if there are any.
    pub second_direction: Option<FringeSequence>,
    /// Measurement volume.
    pub volume: MeasurementVolume,
    /// Pose of the volume in the frame of the ground truth, if it differs.
    pub exact_cam1_from_volume: Option<Pose>,
    /// Pose of the object in every phase image, if it moves.
    pub motion: Option<Motion>,
    /// Additional fields, which readers ignore.
    pub remarks: serde_json::Map<String, serde_json::Value>,
}

impl DatasetDescription {
    /// The text of `meta.json`.
    ///
    /// # Errors
    /// A remark is not valid JSON.
    pub fn text(&self) -> serde_json::Result<String> {
        let meta = WrittenMeta {
            name: &self.name,
            unit: self.unit.symbol(),
            image_size: self.readout.image_size_px(),
            readout: RawReadout::from_readout(&self.readout),
            bits: Some(self.pixel_format.bits()).filter(|&bits| bits > 8 && self.source.is_none()),
            source: self.source.map(RawSource::from),
            steps: self.steps,
            n_phase_images: self.sequence.shifts_rad.len(),
            sequence: RawSequence::from(&self.sequence),
            second_direction: self.second_direction.as_ref().map(RawSequence::from),
            volume: VolumeDescription::new(&self.volume, self.exact_cam1_from_volume.as_ref(), self.unit),
            motion: self.motion.as_ref().map(|motion| WrittenMotion::new(motion, self.unit)),
            remarks: &self.remarks,
        };
        serde_json::to_string_pretty(&meta)
    }
}

/// An image of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageKind {
    /// Phase image by number.
    Phase(usize),
    /// Gray-code image by number, 0 the most significant bit.
    Gray(usize),
    /// Phase image of the second direction.
    SecondPhase(usize),
    /// Gray-code image of the second direction.
    SecondGray(usize),
    /// Fully lit.
    White,
    /// Unlit.
    Black,
}

impl ImageKind {
    /// File name of the image, without its ending.
    fn stem(self) -> String {
        match self {
            Self::Phase(n) => format!("phase_{n:02}"),
            Self::Gray(n) => format!("gray_{n:02}"),
            Self::SecondPhase(n) => format!("vphase_{n:02}"),
            Self::SecondGray(n) => format!("vgray_{n:02}"),
            Self::White => "white".to_owned(),
            Self::Black => "black".to_owned(),
        }
    }

    /// File name of the grey image.
    #[must_use]
    pub fn file_name(self) -> String {
        self.stem() + ".png"
    }
}

#[derive(Serialize)]
struct WrittenMeta<'a> {
    name: &'a str,
    unit: &'static str,
    image_size: [usize; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    readout: Option<RawReadout>,
    /// Absent for 8 bits.
    #[serde(skip_serializing_if = "Option::is_none")]
    bits: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<RawSource>,
    steps: usize,
    n_phase_images: usize,
    #[serde(flatten)]
    sequence: RawSequence,
    #[serde(skip_serializing_if = "Option::is_none")]
    second_direction: Option<RawSequence>,
    volume: VolumeDescription,
    #[serde(skip_serializing_if = "Option::is_none")]
    motion: Option<WrittenMotion>,
    #[serde(flatten)]
    remarks: &'a serde_json::Map<String, serde_json::Value>,
}

/// An unfinished dataset folder. If it is dropped without [`Self::finish`], it is deleted.
#[derive(Debug)]
pub struct DatasetWriter {
    folder: NewFolder,
    image_size_px: [usize; 2],
}

impl DatasetWriter {
    /// Creates the temporary folder and writes `meta.json`.
    ///
    /// # Errors
    /// `target` exists and is not an empty folder, or its parent folder is not writable.
    pub fn create(target: &Path, description: &DatasetDescription) -> Result<Self, DatasetError> {
        let text = description
            .text()
            .map_err(|e| DatasetError::new(&target.join(META_FILE), Problem::Unwritable(e.into())))?;
        let writer = Self::create_folders(target, description.readout.image_size_px(), description.source)?;
        writer.file(META_FILE, text.as_bytes())?;
        Ok(writer)
    }

    /// Creates the temporary folder with the unchanged texts of a setup.
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn create_from_text(target: &Path, text: &SetupText, image_size_px: [usize; 2]) -> Result<Self, DatasetError> {
        let writer = Self::create_folders(target, image_size_px, None)?;
        writer.file(META_FILE, text.description.as_bytes())?;
        writer.file(CALIBRATION_FILE, text.calibration.as_bytes())?;
        Ok(writer)
    }

    fn create_folders(
        target: &Path,
        image_size_px: [usize; 2],
        source: Option<DeviceImages>,
    ) -> Result<Self, DatasetError> {
        let fail = |e| unwritten(target, e);
        let folder = NewFolder::begin(target).map_err(fail)?;
        for camera in CameraId::BOTH {
            // Both cameras may have the same folder.
            std::fs::create_dir_all(folder.path().join(image_folder_name(source, camera))).map_err(fail)?;
        }
        Ok(Self { folder, image_size_px })
    }

    fn file(&self, name: &str, content: &[u8]) -> Result<(), DatasetError> {
        let written = std::fs::write(self.path(name), content);
        written.map_err(|e| DatasetError::new(&self.folder.target().join(name), Problem::Unwritable(e)))
    }

    /// Writes the calibration, and the exact one of a simulated dataset.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn calibration(&self, rig: &Rig, exact: Option<&Rig>, unit: Unit) -> Result<(), DatasetError> {
        for (name, rig) in [(CALIBRATION_FILE, Some(rig)), (EXACT_CALIBRATION_FILE, exact)] {
            if let Some(rig) = rig {
                write_calibration(&self.path(name), rig, unit).map_err(|e| self.as_target(name.as_ref(), e))?;
            }
        }
        Ok(())
    }

    /// Writes one image of a camera.
    ///
    /// # Errors
    /// The image cannot be written.
    pub fn image(&self, camera: CameraId, kind: ImageKind, image: &GreyImage) -> Result<(), DatasetError> {
        let name = Path::new(camera.folder()).join(kind.file_name());
        Ok(write_png(&self.path(&name), image).map_err(|e| self.as_target(&name, e))?)
    }

    /// Writes one image as a camera sends it, in rows without gaps: that of a camera, or that of both if none is named.
    ///
    /// # Errors
    /// The image cannot be written.
    pub fn source_image(&self, camera: Option<CameraId>, kind: ImageKind, bytes: &[u8]) -> Result<(), DatasetError> {
        let folder = camera.map_or(FOLDER_OF_BOTH, CameraId::folder);
        self.file(&format!("{folder}/{}.raw", kind.stem()), bytes)
    }

    /// Writes the ground truth.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn truth(&self, truth: &RenderedTruth) -> Result<(), DatasetError> {
        let written = truth::write(&self.path(TRUTH_FILE), truth, self.image_size_px);
        written.map_err(|p| DatasetError::new(&self.folder.target().join(TRUTH_FILE), p))
    }

    /// Writes the unchanged content of a truth file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn truth_bytes(&self, content: &[u8]) -> Result<(), DatasetError> {
        self.file(TRUTH_FILE, content)
    }

    /// Opens the unfinished folder. Images and calibration must be complete; the ground truth may be missing.
    ///
    /// # Errors
    /// As [`Dataset::open`], with paths in the temporary folder.
    pub fn unfinished(&self) -> Result<Dataset, DatasetError> {
        Dataset::open(self.folder.path(), None)
    }

    /// Renames the folder to its final name.
    ///
    /// # Errors
    /// `target` was created by someone else in the meantime, or its parent folder is not writable.
    pub fn finish(self) -> Result<(), DatasetError> {
        let target = self.folder.target().to_owned();
        self.folder.finish().map_err(|e| unwritten(&target, e))
    }

    fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns the error with the final path of the file, since the user does not know the temporary one.
    fn as_target(&self, name: &Path, error: WriteError) -> WriteError {
        WriteError { path: self.folder.target().join(name), ..error }
    }
}

/// Checks that a new dataset can be written at `target`: the path does not exist, or it is an empty folder.
///
/// # Errors
/// [`Problem::TargetExists`].
pub fn check_new(target: &Path) -> Result<(), DatasetError> {
    new_folder::check_new(target).map_err(|e| unwritten(target, e))
}

fn unwritten(target: &Path, error: std::io::Error) -> DatasetError {
    let problem = match error.kind() {
        std::io::ErrorKind::AlreadyExists => Problem::TargetExists,
        _ => Problem::Unwritable(error),
    };
    DatasetError::new(target, problem)
}

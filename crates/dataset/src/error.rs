//! Errors about dataset folders.

use std::path::{Path, PathBuf};

use fringeflow::calibration::CalibrationError;
use fringeflow::geometry::VolumeError;
use fringeflow_base::atomic_file::WriteError;
use fringeflow_base::text_file::TextError;
use fringeflow_pixels::SourceFormat;

use crate::FOLDER_OF_BOTH;

/// An error about a dataset folder: the file and what is wrong with it.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The calibration is invalid.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// A calibration or an image could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Another file or folder is invalid.
    #[error("{}: {problem}", file.display())]
    File {
        /// The file or folder.
        file: PathBuf,
        /// What is wrong with it.
        #[source]
        problem: Problem,
    },
}

impl DatasetError {
    /// An error about one file.
    pub(super) fn new(file: &Path, problem: Problem) -> Self {
        Self::File { file: file.to_owned(), problem }
    }
}

/// What is wrong with a file of a dataset folder.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The folder does not exist or is a file.
    #[error("is not a folder; expected a dataset folder with meta.json, calibration.yml, cam1/ and cam2/")]
    NotAFolder,
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[source] std::io::Error),
    /// A text file cannot be read, or is not text.
    #[error(transparent)]
    Text(#[from] TextError),
    /// The file cannot be written.
    #[error("cannot be written: {0}")]
    Unwritable(#[source] std::io::Error),
    /// A new dataset folder cannot be created, because its path already exists.
    #[error("already exists and is not an empty folder; choose another path or remove it first")]
    TargetExists,
    /// The folder lacks the files of a dataset.
    #[error(
        "is not a dataset folder: it has no {missing}. A dataset folder has meta.json (pattern, volume), calibration.yml, \
         and phase_00.png and so on in cam1/ and cam2/, see docs/guide/datasets.md; `fringeflow simulate --object nose -o \
         FOLDER` makes an example"
    )]
    NotADataset {
        /// Files and folders that are missing.
        missing: String,
    },
    /// Several calibrations.
    #[error("is a second calibration beside {}; remove one of them", other.display())]
    TwoCalibrations {
        /// The other file.
        other: PathBuf,
    },
    /// The cameras have images of different sizes.
    #[error(
        "is {} × {} pixels, and the images of camera 1 are {} × {}; both cameras must have images of one size: crop the \
         larger ones, and move cx and cy in the calibration accordingly", cam2_px[0], cam2_px[1], cam1_px[0], cam1_px[1]
    )]
    TwoSizes {
        /// Width and height of the images of camera 1.
        cam1_px: [usize; 2],
        /// Width and height of the images of camera 2.
        cam2_px: [usize; 2],
    },
    /// Neither the folder nor the user specifies a unit.
    #[error("field unit is missing; add \"unit\": \"mm\" or give --units mm|m")]
    NoUnit,
    /// `meta.json` is not valid JSON or lacks a field.
    #[error("is not valid: {0}")]
    Json(String),
    /// A field that is not known, with the name of a known one in mind.
    #[error("field {field} is not known; is {meant} meant?")]
    Misspelt {
        /// The field, with the objects around it.
        field: String,
        /// The field that it resembles.
        meant: &'static str,
    },
    /// A field has an invalid value.
    #[error("field {field}: {what}")]
    Field {
        /// Name of the field.
        field: &'static str,
        /// Value, reason and remedy.
        what: String,
    },
    /// The measurement volume is empty or not finite.
    #[error("field volume: {0}")]
    Volume(#[from] VolumeError),
    /// An image that `meta.json` lists does not exist.
    #[error("is missing, although meta.json lists it; its folder holds {found}")]
    MissingImage {
        /// Names of the files in the folder.
        found: String,
    },
    /// There are more images than `meta.json` lists.
    #[error("is one image too many: meta.json lists {listed} images named {kind}_NN.png")]
    ExtraImage {
        /// Prefix of the names.
        kind: String,
        /// Number of images in `meta.json`.
        listed: usize,
    },
    /// A raw image without a stated format.
    #[error(
        "is a raw image, but meta.json does not state its format; add the field source, as in \
             \"source\": {{ \"format\": \"RGGB\" }}"
    )]
    NoSource,
    /// The same image exists twice.
    #[error("is the same image as {}; remove one of them", other.display())]
    TwoFiles {
        /// The other file.
        other: PathBuf,
    },
    /// An image whose values cannot be used as they are stored.
    #[error("cannot be used: {0}")]
    UnusableImage(String),
    /// An image compressed as JPEG.
    #[error(
        "is a JPEG image, whose compression changes grey levels and with them the phase: save images as PNG or TIFF; if \
         the camera sends JPEG, add the field source to meta.json: \"source\": {{ \"format\": \"MJPG\" }}"
    )]
    Jpeg,
    /// The folder with the images of a camera does not exist.
    #[error("is not a folder; it holds the images of a camera, phase_00.png and so on")]
    NoCameraFolder,
    /// The folder with the images of a camera does not exist, but one with images of both views.
    #[error(
        "is not a folder, but {FOLDER_OF_BOTH}/ is; if its images hold the views of both cameras, add the field source \
         to meta.json, as in \"source\": {{ \"format\": \"GREY\", \"stereo_layout\": \"side-by-side\" }}"
    )]
    NoSourceOfBoth,
    /// The folder with the images of both views does not exist.
    #[error("is not a folder; field source of meta.json says that each image holds the views of both cameras")]
    NoFolderOfBoth,
    /// A raw file has the wrong length.
    #[error(
        "has {found} bytes; a {format} image of {width} × {height} pixels has {expected}; correct source.format or the \
         size in meta.json, or save the rows without gaps"
    )]
    RawLength {
        /// Format in `meta.json`.
        format: SourceFormat,
        /// Width of the image, pixels.
        width: usize,
        /// Height of the image, pixels.
        height: usize,
        /// Length of the file.
        found: usize,
        /// Length of such an image.
        expected: usize,
    },
    /// A PNG cannot hold images of the format.
    #[error(
        "is a PNG image, but field source of meta.json says {format}; PNG files hold GREY, Y10 to Y16, Bayer mosaics \
         that are not packed, and RGB3; save the bytes of the camera as .raw"
    )]
    NotAPng {
        /// Format in `meta.json`.
        format: SourceFormat,
    },
    /// A PNG with other channels than red, green and blue.
    #[error(
        "has {channels} channels, or more than 8 bits; field source of meta.json says RGB3, three channels of 8 bits"
    )]
    NotRgb {
        /// Channels found.
        channels: usize,
    },
    /// An image as the camera sent it cannot be converted.
    #[error("cannot be converted: {0}")]
    SourceImage(String),
    /// The file is not an intact image.
    #[error("is not an intact image: {0}")]
    Image(String),
    /// An image file of a kind that is not read.
    #[error("is not an image in PNG, TIFF, BMP or PGM; save it as grey PNG")]
    OtherImage,
    /// The image has the wrong size.
    #[error("is {width} × {height} pixels; expected {expected_width} × {expected_height}")]
    ImageSize {
        /// Width found.
        width: usize,
        /// Height found.
        height: usize,
        /// Width expected.
        expected_width: usize,
        /// Height expected.
        expected_height: usize,
    },
    /// The image has colours.
    #[error("has colours (pixel {u}, {v} is {rgb:?}); expected a grey image, save it as grey")]
    Colour {
        /// Column of the first coloured pixel.
        u: usize,
        /// Row of the first coloured pixel.
        v: usize,
        /// Its red, green and blue.
        rgb: [u16; 3],
    },
    /// The image has values that exceed the bit depth of the dataset.
    #[error(
        "has 16-bit values beyond {bits} bits (pixel {u}, {v} is {value}); save all images with one depth, or correct \
         field bits of meta.json"
    )]
    Depth {
        /// The depth of the dataset.
        bits: u8,
        /// Column of the first such pixel.
        u: usize,
        /// Row of the first such pixel.
        v: usize,
        /// Its value.
        value: u16,
    },
    /// The bit depth of the image is lower than that of the dataset.
    #[error("is an 8-bit image among those of {bits} bits; save it as 16-bit grey, or correct field bits of meta.json")]
    Shallow {
        /// The depth of the dataset.
        bits: u8,
    },
    /// The image is partly transparent.
    #[error("is transparent in places; save it as grey without transparency")]
    Transparent,
    /// The ground truth is not a readable NPZ file, or an array is missing.
    #[error("is not a valid truth file: {0}")]
    Truth(String),
}

//! A folder with images of a board: which files show which pose to which camera.
//!
//! ```text
//! FOLDER/patterns.toml                     what the projector showed, as `fringeflow patterns` writes it
//! FOLDER/POSE/cam1/*.png  FOLDER/POSE/cam2/*.png    all patterns of a pose, in the order of their names
//! ```
//!
//! Images of the board alone calibrate the cameras without a projector: `FOLDER/cam1/*.png` and `FOLDER/cam2/*.png`, or files
//! in one folder. Cameras are also called left and right, and l and r.

use std::path::{Path, PathBuf};

use fringeflow_dataset::{GreyImage, Problem, read_picture};
use fringeflow_patterns::{PATTERNS_FILE, PatternProblem, PatternSet};

use crate::images::{PatternOrder, PatternOrderError};

/// The images of one pose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PoseFiles {
    /// What people call it: the name of its folder, or of the image of camera 1.
    pub name: String,
    /// Files of both cameras, in the order of the patterns.
    pub cameras: [Vec<PathBuf>; 2],
}

/// A folder with images of a board.
#[derive(Clone, Debug)]
pub struct CalibrationFolder {
    /// What the images show; `None` if they show the board alone.
    pub order: Option<PatternOrder>,
    /// The poses, in the order of their names.
    pub poses: Vec<PoseFiles>,
}

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct FolderError {
    /// The file or folder.
    pub path: PathBuf,
    /// What is wrong with it.
    #[source]
    pub problem: FolderProblem,
}

/// What is wrong with a folder.
#[derive(Debug, thiserror::Error)]
pub enum FolderProblem {
    /// It is no folder.
    #[error("is not a folder; expected a folder with images of the board, see docs/guide/calibration.md")]
    NotAFolder,
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    /// The list of patterns is wrong.
    #[error(transparent)]
    Patterns(#[from] PatternProblem),
    /// The patterns do not serve for calibration.
    #[error("{0}")]
    Order(#[from] PatternOrderError),
    /// There are folders of poses, and no list of patterns.
    #[error(
        "has a folder for each pose, but no patterns.toml that says what the images show; copy it from the folder that \
         `fringeflow patterns --calibration` wrote"
    )]
    NoPatterns,
    /// There are no images of both cameras.
    #[error(
        "has no images of both cameras; expected cam1/ and cam2/ in a folder for each pose, or cam1/ and cam2/ with images \
         of the board alone, see docs/guide/calibration.md"
    )]
    NoImages,
    /// A camera has another number of images than there are patterns.
    #[error("holds {found} images, and patterns.toml lists {expected}; each pose needs an image of each pattern")]
    Count {
        /// Images found.
        found: usize,
        /// Patterns.
        expected: usize,
    },
    /// An image of the board has no partner.
    #[error(
        "has no image of camera {other} with the same number; images of both cameras are paired by the number in their name"
    )]
    Unpaired {
        /// The camera whose image is missing.
        other: usize,
    },
    /// An image cannot be used.
    #[error(transparent)]
    Image(#[from] Problem),
}

/// Endings of files that are images.
const IMAGE_ENDINGS: [&str; 8] = ["png", "tif", "tiff", "bmp", "pgm", "jpg", "jpeg", "pnm"];
/// Names of the cameras, in lower case.
const CAMERA_NAMES: [[&str; 5]; 2] =
    [["cam1", "camera1", "cam_1", "left", "l"], ["cam2", "camera2", "cam_2", "right", "r"]];

impl CalibrationFolder {
    /// Finds the images of a folder.
    ///
    /// # Errors
    /// [`FolderError`], which names the file or folder.
    pub fn open(folder: &Path) -> Result<Self, FolderError> {
        let fail = |problem| Err(FolderError { path: folder.to_owned(), problem });
        if !folder.is_dir() {
            return fail(FolderProblem::NotAFolder);
        }
        if !folder.join(PATTERNS_FILE).exists() {
            let poses = board_images(folder)?;
            return Ok(Self { order: None, poses });
        }
        let order = read_order(folder)?;
        let mut poses = Vec::new();
        for pose in entries(folder)?.into_iter().filter(|path| path.is_dir()) {
            let cameras = [camera_folder(&pose, 0)?, camera_folder(&pose, 1)?];
            let [Some(first), Some(second)] = cameras else { continue };
            let files = [pattern_images(&first, &order)?, pattern_images(&second, &order)?];
            poses.push(PoseFiles { name: file_name(&pose), cameras: files });
        }
        if poses.is_empty() {
            return fail(FolderProblem::NoImages);
        }
        Ok(Self { order: Some(order), poses })
    }
}

/// The images of one scene under patterns: `FOLDER/patterns.toml`, `FOLDER/cam1/`, `FOLDER/cam2/`.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What they show.
    pub order: PatternOrder,
    /// Of each camera, in the order of the patterns.
    pub images: [Vec<GreyImage>; 2],
}

impl Scene {
    /// Reads a scene.
    ///
    /// # Errors
    /// [`FolderError`], which names the file or folder.
    pub fn read(folder: &Path) -> Result<Self, FolderError> {
        let order = read_order(folder)?;
        let (Some(first), Some(second)) = (camera_folder(folder, 0)?, camera_folder(folder, 1)?) else {
            return Err(FolderError { path: folder.to_owned(), problem: FolderProblem::NoImages });
        };
        let read = |folder: &Path| {
            pattern_images(folder, &order)?.iter().map(|path| read_image(path)).collect::<Result<Vec<_>, _>>()
        };
        let images = [read(&first)?, read(&second)?];
        Ok(Self { order, images })
    }
}

/// Reads the list of patterns of a folder.
fn read_order(folder: &Path) -> Result<PatternOrder, FolderError> {
    let path = folder.join(PATTERNS_FILE);
    let order = PatternSet::read(&path)
        .map_err(|e| FolderProblem::Patterns(e.problem))
        .and_then(|set| Ok(PatternOrder::of(&set)?));
    order.map_err(|problem| FolderError { path, problem })
}

/// The images of a camera, as many as there are patterns.
fn pattern_images(folder: &Path, order: &PatternOrder) -> Result<Vec<PathBuf>, FolderError> {
    let files = images(folder)?;
    if files.len() != order.images {
        let problem = FolderProblem::Count { found: files.len(), expected: order.images };
        return Err(FolderError { path: folder.to_owned(), problem });
    }
    Ok(files)
}

/// Reads an image.
pub(crate) fn read_image(path: &Path) -> Result<GreyImage, FolderError> {
    read_picture(path).map_err(|problem| FolderError { path: path.to_owned(), problem: problem.into() })
}

/// Pairs images of the board alone.
fn board_images(folder: &Path) -> Result<Vec<PoseFiles>, FolderError> {
    let fail = |path: &Path, problem| FolderError { path: path.to_owned(), problem };
    let files = match [camera_folder(folder, 0)?, camera_folder(folder, 1)?] {
        [Some(first), Some(second)] => [images(&first)?, images(&second)?],
        _ => {
            let all = images(folder)?;
            [0, 1].map(|camera| all.iter().filter(|path| is_of_camera(path, camera)).cloned().collect())
        }
    };
    if files.iter().any(Vec::is_empty) {
        let has_poses = entries(folder)?.iter().any(|path| matches!(camera_folder(path, 0), Ok(Some(_))));
        let problem = if has_poses { FolderProblem::NoPatterns } else { FolderProblem::NoImages };
        return Err(fail(folder, problem));
    }
    for camera in 0..2 {
        for path in &files[camera] {
            if !files[1 - camera].iter().any(|other| number(other) == number(path)) {
                return Err(fail(path, FolderProblem::Unpaired { other: 2 - camera }));
            }
        }
    }
    let pairs = files[0].iter().flat_map(|path| {
        let partner = files[1].iter().find(|other| number(other) == number(path))?;
        Some(PoseFiles { name: file_name(path), cameras: [vec![path.clone()], vec![partner.clone()]] })
    });
    Ok(pairs.collect())
}

/// The folder of a camera, under any of its names.
fn camera_folder(folder: &Path, camera: usize) -> Result<Option<PathBuf>, FolderError> {
    if !folder.is_dir() {
        return Ok(None);
    }
    let is_camera = |path: &PathBuf| path.is_dir() && CAMERA_NAMES[camera].contains(&&*file_name(path).to_lowercase());
    Ok(entries(folder)?.into_iter().find(is_camera))
}

/// Whether the name of a file begins with that of a camera and a number follows.
fn is_of_camera(path: &Path, camera: usize) -> bool {
    let name = file_name(path).to_lowercase();
    CAMERA_NAMES[camera].iter().any(|prefix| {
        let rest = name.strip_prefix(prefix).unwrap_or_default();
        rest.trim_start_matches(['_', '-']).starts_with(|c: char| c.is_ascii_digit())
    })
}

/// The last number in the name of a file, without its ending.
fn number(path: &Path) -> Option<u64> {
    let stem = path.file_stem()?.to_string_lossy().into_owned();
    let digits = stem.trim_end_matches(|c: char| !c.is_ascii_digit());
    let start = digits.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i + 1);
    digits[start..].parse().ok()
}

/// Image files of a folder, by number and name.
fn images(folder: &Path) -> Result<Vec<PathBuf>, FolderError> {
    let is_image = |path: &PathBuf| {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        path.is_file() && IMAGE_ENDINGS.contains(&&*ending)
    };
    let mut files: Vec<PathBuf> = entries(folder)?.into_iter().filter(is_image).collect();
    files.sort_by_key(|path| (number(path), path.clone()));
    Ok(files)
}

/// Entries of a folder by name.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, FolderError> {
    let fail = |e: std::io::Error| FolderError { path: folder.to_owned(), problem: e.into() };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        paths.push(entry.map_err(fail)?.path());
    }
    paths.sort();
    Ok(paths)
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

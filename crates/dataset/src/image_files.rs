//! Names and numbers of the image files in a folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{DatasetError, Problem};

/// Endings of image files that hold grey levels.
const GREY_ENDINGS: [&str; 6] = ["png", "tif", "tiff", "bmp", "pgm", "pnm"];
/// Endings of images as the camera sent them.
const SOURCE_ENDINGS: [&str; 3] = ["raw", "jpg", "jpeg"];
/// Most files that an error names.
const MOST_NAMES: usize = 6;

/// The images of a folder.
#[derive(Clone, Copy)]
pub(super) struct ImageFiles<'a> {
    /// The folder.
    pub(super) folder: &'a Path,
    /// Whether images may be stored as the camera sent them.
    pub(super) may_be_raw: bool,
}

impl ImageFiles<'_> {
    /// Files `KIND_NN.png` and so on of the folder, by number from 0. Numbers may begin with 1.
    pub(super) fn numbered(&self, kind: &str, count: usize) -> Result<BTreeMap<usize, PathBuf>, DatasetError> {
        let mut found = BTreeMap::new();
        for path in self.files()? {
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            let number = stem.strip_prefix(kind).and_then(|rest| rest.strip_prefix('_'));
            let Some(number) = number.and_then(|number| number.parse::<usize>().ok()) else { continue };
            if self.is_image(&path)?
                && let Some(other) = found.insert(number, path.clone())
            {
                return Err(DatasetError::new(&path, Problem::TwoFiles { other }));
            }
        }
        let begins_with_one = count > 0 && found.keys().copied().eq(1..=count);
        Ok(if begins_with_one { found.into_iter().map(|(number, path)| (number - 1, path)).collect() } else { found })
    }

    /// The image file `STEM.png` and so on, if there is one.
    pub(super) fn named(&self, stem: &str) -> Result<Option<PathBuf>, DatasetError> {
        let mut named = None;
        for path in self.files()? {
            if path.file_stem().is_some_and(|found| found == stem)
                && self.is_image(&path)?
                && let Some(other) = named.replace(path.clone())
            {
                return Err(DatasetError::new(&path, Problem::TwoFiles { other }));
            }
        }
        Ok(named)
    }

    /// Checks that the folder has exactly `count` images of a kind.
    pub(super) fn check_numbers(&self, kind: &str, count: usize) -> Result<(), DatasetError> {
        let found = self.numbered(kind, count)?;
        if let Some(missing) = (0..count).find(|n| !found.contains_key(n)) {
            return Err(self.missing(kind, missing));
        }
        match found.range(count..).next() {
            Some((_, path)) => {
                Err(DatasetError::new(path, Problem::ExtraImage { kind: kind.to_owned(), listed: count }))
            }
            None => Ok(()),
        }
    }

    /// The error about an image that does not exist. It names the files that are there instead.
    pub(super) fn missing(&self, kind: &str, number: usize) -> DatasetError {
        let names = self.files().unwrap_or_default().into_iter();
        let mut names: Vec<String> =
            names.filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned())).collect();
        // Files of the kind itself say more than others.
        names.sort_by_key(|name| !name.starts_with(kind));
        let more = if names.len() > MOST_NAMES { " …" } else { "" };
        names.truncate(MOST_NAMES);
        let found = if names.is_empty() { "nothing".to_owned() } else { format!("{}{more}", names.join(" ")) };
        DatasetError::new(&self.folder.join(format!("{kind}_{number:02}.png")), Problem::MissingImage { found })
    }

    /// All entries of the folder, by name.
    fn files(&self) -> Result<Vec<PathBuf>, DatasetError> {
        let unreadable = |e| DatasetError::new(self.folder, Problem::Unreadable(e));
        let entries = std::fs::read_dir(self.folder).map_err(unreadable)?;
        let files = entries.map(|entry| entry.map(|entry| entry.path())).collect::<Result<Vec<_>, _>>();
        let mut files = files.map_err(unreadable)?;
        files.sort();
        Ok(files)
    }

    /// Whether a file is an image, by its ending.
    fn is_image(&self, path: &Path) -> Result<bool, DatasetError> {
        if is_of_source(path) && !self.may_be_raw {
            let problem = if ending(path) == "raw" { Problem::NoSource } else { Problem::Jpeg };
            return Err(DatasetError::new(path, problem));
        }
        Ok(is_of_source(path) || GREY_ENDINGS.contains(&ending(path).as_str()))
    }
}

/// Whether a file holds an image as the camera sent it, by its ending.
pub(super) fn is_of_source(path: &Path) -> bool {
    SOURCE_ENDINGS.contains(&ending(path).as_str())
}

fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

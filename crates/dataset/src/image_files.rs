//! Names and numbers of the image files in a folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{DatasetError, Problem};

/// The images of a folder.
#[derive(Clone, Copy)]
pub(super) struct ImageFiles<'a> {
    /// The folder.
    pub(super) folder: &'a Path,
    /// Whether images may be stored as the camera sent them.
    pub(super) may_be_raw: bool,
}

impl ImageFiles<'_> {
    /// Files `KIND_NN.png` and `KIND_NN.raw` of the folder, by number.
    pub(super) fn numbered(&self, kind: &str) -> Result<BTreeMap<usize, PathBuf>, DatasetError> {
        let unreadable = |e| DatasetError::new(self.folder, Problem::Unreadable(e));
        let mut found = BTreeMap::new();
        for entry in std::fs::read_dir(self.folder).map_err(unreadable)? {
            let path = entry.map_err(unreadable)?.path();
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            let number = stem.strip_prefix(kind).and_then(|rest| rest.strip_prefix('_'));
            let Some(number) = number.and_then(|number| number.parse().ok()) else { continue };
            if self.is_image(&path)?
                && let Some(other) = found.insert(number, path)
            {
                return Err(DatasetError::new(&other, Problem::TwoFiles));
            }
        }
        Ok(found)
    }

    /// The file `STEM.png` or `STEM.raw`, if there is one.
    pub(super) fn named(&self, stem: &str) -> Result<Option<PathBuf>, DatasetError> {
        let files = ["png", "raw"].map(|extension| self.folder.join(stem).with_extension(extension));
        match files.map(|path| (path.exists(), path)) {
            [(true, png), (true, _)] => Err(DatasetError::new(&png, Problem::TwoFiles)),
            [(true, path), _] | [_, (true, path)] => Ok(self.is_image(&path)?.then_some(path)),
            _ => Ok(None),
        }
    }

    /// Checks that the folder has exactly the images `KIND_00` to `KIND_(count−1)`.
    pub(super) fn check_numbers(&self, kind: &str, count: usize) -> Result<(), DatasetError> {
        let found = self.numbered(kind)?;
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

    /// The error about an image that does not exist.
    pub(super) fn missing(&self, kind: &str, number: usize) -> DatasetError {
        DatasetError::new(&self.folder.join(format!("{kind}_{number:02}.png")), Problem::MissingImage)
    }

    /// Whether a file is an image, by its ending.
    fn is_image(&self, path: &Path) -> Result<bool, DatasetError> {
        let is = |extension: &str| path.extension().is_some_and(|found| found == extension);
        if is("raw") && !self.may_be_raw {
            return Err(DatasetError::new(path, Problem::NoSource));
        }
        Ok(is("png") || is("raw"))
    }
}

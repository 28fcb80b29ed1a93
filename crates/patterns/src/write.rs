//! Writes a set to a folder: the list, and the images as PNG files.

use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

use fringeflow_base::new_folder::NewFolder;
use fringeflow_base::png_encoding::encode;

use crate::packing::{images_per_file, packed, plane};
use crate::{Depth, PATTERNS_FILE, PatternError, PatternProblem, PatternSet};

impl PatternSet {
    /// Writes the set to a folder, which must be new or empty. It appears when it is complete.
    ///
    /// # Errors
    /// The folder exists and is not empty, or cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), PatternError> {
        self.write_files(folder).map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists => PatternError::new(folder, PatternProblem::Exists),
            _ => PatternError::new(folder, PatternProblem::Unwritable(e)),
        })
    }

    fn write_files(&self, folder: &Path) -> io::Result<()> {
        let new = NewFolder::begin(folder)?;
        std::fs::write(new.path().join(PATTERNS_FILE), self.to_toml())?;
        let bits = self.output.depth.bits();
        let per_file = if self.output.packed { images_per_file(bits) } else { 1 };
        let indices: Vec<usize> = (0..self.images.len()).collect();
        for file in indices.chunks(per_file) {
            let images: Vec<Vec<u8>> = file.iter().filter_map(|&i| self.image(i)).map(|image| image.levels).collect();
            let mut out = BufWriter::new(File::create(new.path().join(self.file_name(file[0])))?);
            if self.output.packed {
                let rgb = packed(&images, bits);
                encode(&mut out, self.output_px(), png::ColorType::Rgb, png::BitDepth::Eight, &rgb)?;
            } else {
                let (depth, bytes) = match self.output.depth {
                    Depth::Eight(_) => (png::BitDepth::Eight, images.concat()),
                    Depth::One => (png::BitDepth::One, rows_of_bits(&images.concat(), self.output_px()[0])),
                };
                encode(&mut out, self.output_px(), png::ColorType::Grayscale, depth, &bytes)?;
            }
            out.flush()?;
        }
        new.finish()
    }

    /// Name of the file that holds an image.
    pub(crate) fn file_name(&self, index: usize) -> String {
        if self.output.packed {
            return format!("{:03}_packed.png", index / images_per_file(self.output.depth.bits()));
        }
        let what = self.images.get(index).map(|pattern| pattern.what().replace(' ', "_")).unwrap_or_default();
        format!("{index:03}_{what}.png")
    }

    /// Name of the plane of its file that an image occupies; `None` if it has a file of its own.
    pub(crate) fn plane(&self, index: usize) -> Option<String> {
        let bits = self.output.depth.bits();
        self.output.packed.then(|| plane(index % images_per_file(bits), bits))
    }
}

/// Packs each row into bytes, the left pixel in the most significant bit.
fn rows_of_bits(levels: &[u8], width: usize) -> Vec<u8> {
    let byte = |pixels: &[u8]| pixels.iter().enumerate().fold(0, |byte, (k, level)| byte | (level >> 7) << (7 - k));
    levels.chunks(width).flat_map(|row| row.chunks(8).map(byte)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Direction, FringeCycle, Output};

    /// Decodes a PNG file: size, bytes of a row, bytes.
    fn decoded(path: &Path) -> (png::OutputInfo, Vec<u8>) {
        let mut reader = png::Decoder::new(io::BufReader::new(File::open(path).unwrap())).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        bytes.truncate(info.buffer_size());
        (info, bytes)
    }

    fn set(output: Output) -> PatternSet {
        let set = PatternSet::fringes([52, 40], &Direction::BOTH, &FringeCycle::even(4, 16.0), true).unwrap();
        PatternSet { output, ..set }
    }

    #[test]
    fn files_hold_the_images() {
        let folder = tempfile::tempdir().unwrap();
        let (eight, one) = (set(Output::default()), set(Output { depth: Depth::One, ..Output::default() }));
        for (name, set) in [("eight", &eight), ("one", &one)] {
            let folder = folder.path().join(name);
            set.write(&folder).unwrap();
            assert_eq!(PatternSet::read(&folder).unwrap(), *set);
            assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1 + set.images.len());
            for index in 0..set.images.len() {
                let (info, bytes) = decoded(&folder.join(set.file_name(index)));
                assert_eq!((info.width, info.height), (52, 40));
                let levels = set.image(index).unwrap().levels;
                let level = |i: usize| match set.output.depth {
                    Depth::Eight(_) => bytes[i],
                    Depth::One => 255 * (bytes[i / 52 * info.line_size + i % 52 / 8] >> (7 - i % 52 % 8) & 1),
                };
                assert!((0..52 * 40).all(|i| level(i) == levels[i]), "{name} {index}");
            }
        }
    }

    #[test]
    fn packed_files_hold_the_images_in_their_planes() {
        let folder = tempfile::tempdir().unwrap();
        for (depth, files) in [(Depth::One, 1), (Depth::default(), 5)] {
            let set = set(Output { packed: true, depth, ..Output::default() });
            let folder = folder.path().join(files.to_string());
            set.write(&folder).unwrap();
            assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1 + files);
            assert_eq!(PatternSet::read(&folder).unwrap(), set);
            for index in 0..set.images.len() {
                let (_, rgb) = decoded(&folder.join(set.file_name(index)));
                let plane = set.plane(index).unwrap();
                let channel = "RGB".find(&plane[..1]).unwrap();
                let level = |i: usize| match plane[1..].parse::<u8>() {
                    Ok(bit) => 255 * (rgb[3 * i + channel] >> bit & 1),
                    Err(_) => rgb[3 * i + channel],
                };
                let levels = set.image(index).unwrap().levels;
                assert!((0..levels.len()).all(|i| level(i) == levels[i]), "{plane} {index}");
            }
        }
    }

    #[test]
    fn an_existing_folder_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("patterns");
        std::fs::create_dir(&target).unwrap();
        set(Output::default()).write(&target).unwrap();
        let before = std::fs::read(target.join(PATTERNS_FILE)).unwrap();
        let refused = set(Output { depth: Depth::One, ..Output::default() }).write(&target).unwrap_err();
        assert!(refused.to_string().contains("patterns: already exists and is not an empty folder"), "{refused}");
        assert_eq!(std::fs::read(target.join(PATTERNS_FILE)).unwrap(), before);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        let nowhere = set(Output::default()).write(&folder.path().join("a/b")).unwrap_err();
        assert!(nowhere.to_string().contains("cannot be written"), "{nowhere}");
    }
}

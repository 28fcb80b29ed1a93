//! An RGB picture and its PNG file.

use std::path::Path;

use fringeflow_base::atomic_file::{WriteError, write_atomically};
use fringeflow_base::png_encoding;

use super::colour::Rgb;

/// An 8-bit RGB picture, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<Rgb>,
}

impl Picture {
    /// Creates a picture of one colour.
    pub(super) fn filled([width, height]: [usize; 2], colour: Rgb) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// Creates a picture whose pixel `i`, counted row by row, is `colour(i)`.
    pub(super) fn from_fn([width, height]: [usize; 2], colour: impl FnMut(usize) -> Rgb) -> Self {
        Self { width, height, pixels: (0..width * height).map(colour).collect() }
    }

    /// Width and height, pixels.
    #[must_use]
    pub fn size_px(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Red, green and blue of all pixels, row by row.
    #[must_use]
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// Sets a pixel; does nothing outside the picture.
    pub(super) fn set(&mut self, u: usize, v: usize, colour: Rgb) {
        if u < self.width && v < self.height {
            self.pixels[v * self.width + u] = colour;
        }
    }

    /// Fills the part of a rectangle that lies in the picture.
    pub(super) fn fill(&mut self, [left, top]: [usize; 2], [width, height]: [usize; 2], colour: Rgb) {
        for v in top..(top + height).min(self.height) {
            for u in left..(left + width).min(self.width) {
                self.set(u, v, colour);
            }
        }
    }

    /// Returns the picture with `rows` rows of `colour` below it.
    pub(super) fn with_strip_below(mut self, rows: usize, colour: Rgb) -> Self {
        self.height += rows;
        self.pixels.resize(self.width * self.height, colour);
        self
    }

    /// Writes the picture as a PNG file.
    ///
    /// # Errors
    /// The file cannot be written. An existing file then stays. A picture without pixels is not a valid PNG.
    pub fn write_png(&self, path: &Path) -> Result<(), WriteError> {
        let bytes = self.pixels.as_flattened();
        write_atomically(path, |out| {
            png_encoding::encode(out, self.size_px(), png::ColorType::Rgb, png::BitDepth::Eight, bytes)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_holds_the_pixels() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        let picture = Picture::from_fn([5, 3], |i| [i as u8, 100, 255 - i as u8]);
        picture.write_png(&path).unwrap();
        let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        let mut bytes = vec![0; 5 * 3 * 3];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (5, 3, png::ColorType::Rgb));
        assert_eq!(bytes, picture.pixels().as_flattened());
    }

    #[test]
    fn drawing_stops_at_the_border() {
        let mut picture = Picture::filled([4, 2], [0; 3]);
        picture.fill([3, 1], [10, 10], [9; 3]);
        picture.set(4, 0, [9; 3]);
        assert_eq!(picture.pixels().iter().filter(|&&p| p == [9; 3]).count(), 1);
        assert_eq!(picture.with_strip_below(3, [1; 3]).size_px(), [4, 5]);
    }
}

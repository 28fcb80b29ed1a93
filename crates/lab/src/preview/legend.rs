//! Legends of pictures that show categories: swatch, name and share, in columns below the picture.

use super::colour::{BACKGROUND, INK, MUTED, Rgb};
use super::font::{draw_text, text_size};
use super::picture::Picture;

/// One category in a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    /// Its name.
    pub(super) name: String,
    /// Its colour.
    pub(super) colour: Rgb,
    /// Share of the pixels, in [0, 1].
    pub(super) share: f64,
}

const SWATCH: usize = 7;
const PADDING: usize = 4;
const LINE: usize = 12;

impl Entry {
    fn text(&self) -> String {
        let percent = self.share * 100.0;
        // Rare categories need more digits.
        let digits = if percent < 1.0 { 2 } else { 1 };
        format!("{} {percent:.digits$} %", self.name)
    }
}

/// Adds a strip with the entries below a picture, in as many columns as fit.
pub(super) fn with_legend(picture: Picture, entries: &[Entry]) -> Picture {
    let [width, height] = picture.size_px();
    let scale = text_scale(width);
    let widest = entries.iter().map(|e| text_size(&e.text(), scale)[0]).max().unwrap_or(0);
    let column = widest + (SWATCH + 5 * PADDING) * scale;
    let columns = ((width.saturating_sub(PADDING * scale)) / column.max(1)).clamp(1, entries.len().max(1));
    let lines = entries.len().div_ceil(columns);
    let mut picture = picture.with_strip_below((lines * LINE + 2 * PADDING) * scale, BACKGROUND);
    for (i, entry) in entries.iter().enumerate() {
        let left = PADDING * scale + i / lines * column;
        let top = height + (PADDING + i % lines * LINE) * scale;
        draw_entry(&mut picture, [left, top], entry, scale);
    }
    picture
}

fn draw_entry(picture: &mut Picture, [left, top]: [usize; 2], entry: &Entry, scale: usize) {
    // A frame makes colours close to the background visible.
    picture.fill([left, top], [(SWATCH + 2) * scale, (SWATCH + 2) * scale], MUTED);
    picture.fill([left + scale, top + scale], [SWATCH * scale; 2], entry.colour);
    draw_text(picture, [left + (SWATCH + 2 + PADDING) * scale, top + scale], &entry.text(), scale, INK);
}

/// Returns the size of a font pixel that is readable in a picture of this width.
pub(super) fn text_scale(width: usize) -> usize {
    (width / 600).clamp(1, 4)
}

//! Scales of pictures that show a quantity: a colour bar with labelled ends below the picture.

use super::colour::{BACKGROUND, INK, Rgb};
use super::font::{draw_text, text_size};
use super::legend::text_scale;
use super::picture::Picture;

/// Adds a colour bar below a picture. `colour` maps a share in [0, 1] of the range to its colour. `labels` are those of
/// the ends.
pub(super) fn with_scale(picture: Picture, labels: &[String; 2], colour: impl Fn(f32) -> Rgb) -> Picture {
    let [width, height] = picture.size_px();
    let scale = text_scale(width);
    let label_widths = labels.each_ref().map(|label| text_size(label, scale)[0]);
    let gap = 5 * scale;
    let mut picture = picture.with_strip_below(18 * scale, BACKGROUND);
    let top = height + gap;
    let left = 2 * gap + label_widths[0];
    let bar = width.saturating_sub(left + label_widths[1] + 2 * gap);
    for u in 0..bar {
        picture.fill([left + u, top], [1, 8 * scale], colour(u as f32 / bar as f32));
    }
    draw_text(&mut picture, [gap, top], &labels[0], scale, INK);
    draw_text(&mut picture, [left + bar + gap, top], &labels[1], scale, INK);
    picture
}

//! A bitmap font of 5 × 8 pixels, and text drawing. Pictures need only 42 characters, among them δ and ±, so a font
//! crate would be too large a dependency.

use super::colour::Rgb;
use super::picture::Picture;

const COLUMNS: usize = 5;
const ROWS: usize = 8;
/// Distance from one character to the next.
const ADVANCE: usize = COLUMNS + 1;

/// Characters and their rows from the top. The leftmost pixel is bit 4, and the last row holds descenders.
#[rustfmt::skip]
const GLYPHS: [(char, [u8; ROWS]); 42] = [
    ('a', [0b00000, 0b00000, 0b01110, 0b00001, 0b01111, 0b10001, 0b01111, 0b00000]),
    ('b', [0b10000, 0b10000, 0b11110, 0b10001, 0b10001, 0b10001, 0b11110, 0b00000]),
    ('c', [0b00000, 0b00000, 0b01111, 0b10000, 0b10000, 0b10000, 0b01111, 0b00000]),
    ('d', [0b00001, 0b00001, 0b01111, 0b10001, 0b10001, 0b10001, 0b01111, 0b00000]),
    ('e', [0b00000, 0b00000, 0b01110, 0b10001, 0b11111, 0b10000, 0b01110, 0b00000]),
    ('f', [0b00110, 0b01000, 0b11110, 0b01000, 0b01000, 0b01000, 0b01000, 0b00000]),
    ('g', [0b00000, 0b00000, 0b01111, 0b10001, 0b10001, 0b01111, 0b00001, 0b01110]),
    ('h', [0b10000, 0b10000, 0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0b00000]),
    ('i', [0b00100, 0b00000, 0b01100, 0b00100, 0b00100, 0b00100, 0b01110, 0b00000]),
    ('j', [0b00010, 0b00000, 0b00110, 0b00010, 0b00010, 0b00010, 0b10010, 0b01100]),
    ('k', [0b10000, 0b10000, 0b10010, 0b10100, 0b11000, 0b10100, 0b10010, 0b00000]),
    ('l', [0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110, 0b00000]),
    ('m', [0b00000, 0b00000, 0b11010, 0b10101, 0b10101, 0b10101, 0b10101, 0b00000]),
    ('n', [0b00000, 0b00000, 0b11110, 0b10001, 0b10001, 0b10001, 0b10001, 0b00000]),
    ('o', [0b00000, 0b00000, 0b01110, 0b10001, 0b10001, 0b10001, 0b01110, 0b00000]),
    ('p', [0b00000, 0b00000, 0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000]),
    ('q', [0b00000, 0b00000, 0b01111, 0b10001, 0b10001, 0b01111, 0b00001, 0b00001]),
    ('r', [0b00000, 0b00000, 0b10110, 0b11001, 0b10000, 0b10000, 0b10000, 0b00000]),
    ('s', [0b00000, 0b00000, 0b01111, 0b10000, 0b01110, 0b00001, 0b11110, 0b00000]),
    ('t', [0b01000, 0b01000, 0b11110, 0b01000, 0b01000, 0b01000, 0b00110, 0b00000]),
    ('u', [0b00000, 0b00000, 0b10001, 0b10001, 0b10001, 0b10001, 0b01111, 0b00000]),
    ('v', [0b00000, 0b00000, 0b10001, 0b10001, 0b10001, 0b01010, 0b00100, 0b00000]),
    ('w', [0b00000, 0b00000, 0b10001, 0b10101, 0b10101, 0b10101, 0b01010, 0b00000]),
    ('x', [0b00000, 0b00000, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001, 0b00000]),
    ('y', [0b00000, 0b00000, 0b10001, 0b10001, 0b10001, 0b01111, 0b00001, 0b01110]),
    ('z', [0b00000, 0b00000, 0b11111, 0b00010, 0b00100, 0b01000, 0b11111, 0b00000]),
    ('0', [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110, 0b00000]),
    ('1', [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110, 0b00000]),
    ('2', [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111, 0b00000]),
    ('3', [0b01110, 0b10001, 0b00001, 0b00110, 0b00001, 0b10001, 0b01110, 0b00000]),
    ('4', [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010, 0b00000]),
    ('5', [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110, 0b00000]),
    ('6', [0b01110, 0b10000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110, 0b00000]),
    ('7', [0b11111, 0b00001, 0b00010, 0b00100, 0b00100, 0b01000, 0b01000, 0b00000]),
    ('8', [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110, 0b00000]),
    ('9', [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00001, 0b01110, 0b00000]),
    ('.', [0b00000, 0b00000, 0b00000, 0b00000, 0b00000, 0b01100, 0b01100, 0b00000]),
    ('-', [0b00000, 0b00000, 0b00000, 0b01110, 0b00000, 0b00000, 0b00000, 0b00000]),
    ('+', [0b00000, 0b00100, 0b00100, 0b11111, 0b00100, 0b00100, 0b00000, 0b00000]),
    ('%', [0b11000, 0b11001, 0b00010, 0b00100, 0b01000, 0b10011, 0b00011, 0b00000]),
    ('±', [0b00100, 0b00100, 0b11111, 0b00100, 0b00100, 0b00000, 0b11111, 0b00000]),
    ('δ', [0b00110, 0b01000, 0b00100, 0b01110, 0b10001, 0b10001, 0b01110, 0b00000]),
];

/// Returns the width and height of a text. A font pixel is a square of `scale` pixels.
pub(super) fn text_size(text: &str, scale: usize) -> [usize; 2] {
    [(text.chars().count() * ADVANCE).saturating_sub(1) * scale, ROWS * scale]
}

/// Draws a text with its top left corner at `[left, top]`. Characters that the font does not have stay blank.
pub(super) fn draw_text(picture: &mut Picture, [left, top]: [usize; 2], text: &str, scale: usize, colour: Rgb) {
    for (position, character) in text.chars().enumerate() {
        if let Some((_, rows)) = GLYPHS.iter().find(|(c, _)| *c == character) {
            draw_glyph(picture, [left + position * ADVANCE * scale, top], rows, scale, colour);
        }
    }
}

fn draw_glyph(picture: &mut Picture, [left, top]: [usize; 2], rows: &[u8; ROWS], scale: usize, colour: Rgb) {
    for (v, row) in rows.iter().enumerate() {
        for u in (0..COLUMNS).filter(|u| row >> (COLUMNS - 1 - u) & 1 == 1) {
            picture.fill([left + u * scale, top + v * scale], [scale; 2], colour);
        }
    }
}

/// Whether the font has every character of a text except the space.
#[cfg(test)]
pub(super) fn can_draw(text: &str) -> bool {
    text.chars().all(|c| c == ' ' || GLYPHS.iter().any(|(known, _)| *known == c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_fills_its_size_and_nothing_more() {
        let [width, height] = text_size("mz", 2);
        let mut picture = Picture::filled([width + 6, height + 6], [0; 3]);
        draw_text(&mut picture, [3, 3], "mz", 2, [255; 3]);
        let inside = |i: usize| {
            let [u, v] = [i % (width + 6), i / (width + 6)];
            (3..3 + width).contains(&u) && (3..3 + height).contains(&v)
        };
        let lit: Vec<usize> = (0..picture.pixels().len()).filter(|&i| picture.pixels()[i] != [0; 3]).collect();
        assert!(lit.iter().all(|&i| inside(i)));
        // 15 font pixels in the m, 13 in the z, each 2 × 2 pixels.
        assert_eq!(lit.len(), (15 + 13) * 4);
    }

    #[test]
    fn characters_have_different_shapes() {
        for (i, (a, rows)) in GLYPHS.iter().enumerate() {
            assert!(rows.iter().all(|row| *row < 32), "{a} is too wide");
            assert!(GLYPHS[..i].iter().all(|(_, other)| other != rows), "{a} has the shape of another");
        }
    }
}

//! Several images in the bit planes of one RGB image, as DLP controllers take them. In: images of 1 or 8 bits. Out: RGB
//! pixels.
//!
//! The order is that of TI's DLPC350 (LightCrafter 4500; Programmer's Guide, "Pattern Number Mapping"): green, red, blue,
//! and in each colour the least significant bit first. Pattern 0 of 1 bit is bit 0 of green.

/// Planes of a colour in the order of the patterns: name, and place in an RGB pixel.
const COLOURS: [(&str, usize); 3] = [("G", 1), ("R", 0), ("B", 2)];
/// Bits of a colour.
const BITS: usize = 8;

/// Returns how many images of `bits` a packed file holds.
pub(crate) const fn images_per_file(bits: u8) -> usize {
    COLOURS.len() * BITS / bits as usize
}

/// Returns the name of the plane of an image in its file: `G0` for 1 bit, `G` for 8 bits.
pub(crate) fn plane(place: usize, bits: u8) -> String {
    let per_colour = images_per_file(bits) / COLOURS.len();
    let (name, _) = COLOURS[place / per_colour % COLOURS.len()];
    if per_colour > 1 { format!("{name}{}", place % per_colour) } else { name.to_owned() }
}

/// Packs images of the same size into RGB pixels, row by row. An image of 1 bit is bright where its level is above 127.
pub(crate) fn packed(images: &[Vec<u8>], bits: u8) -> Vec<u8> {
    let pixels = images.first().map_or(0, Vec::len);
    let per_colour = images_per_file(bits) / COLOURS.len();
    let mut rgb = vec![0; pixels * COLOURS.len()];
    for (place, image) in images.iter().enumerate() {
        let (_, channel) = COLOURS[place / per_colour % COLOURS.len()];
        let channel = rgb.iter_mut().skip(channel).step_by(COLOURS.len());
        for (value, level) in channel.zip(image) {
            *value |= if bits == 1 { (level >> 7) << (place % per_colour) } else { *level };
        }
    }
    rgb
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_bit_is_an_image() {
        let names: Vec<String> = (0..24).map(|place| plane(place, 1)).collect();
        assert_eq!(
            (names[0].as_str(), names[7].as_str(), names[8].as_str(), names[23].as_str()),
            ("G0", "G7", "R0", "B7")
        );
        // Image k is bright at pixel k alone.
        let images: Vec<Vec<u8>> = (0..24).map(|k| (0..24).map(|i| if i == k { 255 } else { 0 }).collect()).collect();
        let rgb = packed(&images, 1);
        for pixel in 0..24 {
            let value = rgb[pixel * 3..][..3].iter().fold(0_u32, |value, &byte| value << 8 | u32::from(byte));
            // Bits of R, G and B in the word 0xRRGGBB.
            let bit = [8, 16, 0][pixel / 8] + pixel % 8;
            assert_eq!(value, 1 << bit, "pixel {pixel}");
        }
    }

    #[test]
    fn three_images_of_8_bits_are_green_red_and_blue() {
        assert_eq!([0, 1, 2].map(|place| plane(place, 8)), ["G", "R", "B"]);
        assert_eq!(packed(&[vec![1, 2], vec![3, 4], vec![5, 6]], 8), [3, 1, 5, 4, 2, 6]);
        assert_eq!(packed(&[vec![1, 2]], 8), [0, 1, 0, 0, 2, 0]);
    }
}

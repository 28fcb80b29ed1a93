//! Colour maps: sequential for quantities, diverging for quantities about zero, cyclic for phase. And a palette for
//! categories.

use std::f64::consts::TAU;

/// Red, green, blue; 8-bit sRGB.
pub(super) type Rgb = [u8; 3];

/// Pixels without a value.
pub(super) const BACKGROUND: Rgb = [22, 24, 28];
/// Pixels with an unusable value.
pub(super) const INVALID: Rgb = [58, 60, 64];
/// Lines in the background.
pub(super) const MUTED: Rgb = [120, 125, 133];
/// Text and lines in the foreground.
pub(super) const INK: Rgb = [230, 232, 236];

// Okabe and Ito, "Color Universal Design" (2008).
pub(super) const BLUE: Rgb = [0, 114, 178];
pub(super) const SKY_BLUE: Rgb = [86, 180, 233];
pub(super) const GREEN: Rgb = [0, 158, 115];
pub(super) const YELLOW: Rgb = [240, 228, 66];
pub(super) const ORANGE: Rgb = [230, 159, 0];
pub(super) const VERMILION: Rgb = [213, 94, 0];
pub(super) const PURPLE: Rgb = [204, 121, 167];

/// Equidistant samples of the colour map viridis by Smith, van der Walt and Firing (2015).
const VIRIDIS: [Rgb; 9] = [
    [68, 1, 84],
    [71, 45, 123],
    [59, 82, 139],
    [44, 114, 142],
    [33, 145, 140],
    [40, 174, 128],
    [94, 201, 98],
    [173, 220, 48],
    [253, 231, 37],
];

/// Returns the colour of a share in [0, 1] of the range: dark violet to yellow, perceptually uniform.
pub(super) fn sequential(share: f32) -> Rgb {
    let last = VIRIDIS.len() - 1;
    let position = share.clamp(0.0, 1.0) * last as f32;
    let index = (position as usize).min(last - 1);
    mix(VIRIDIS[index], VIRIDIS[index + 1], position - index as f32)
}

/// Returns the colour of a share in [−1, 1] of the range: blue, light grey, red.
#[must_use]
pub fn diverging(share: f32) -> Rgb {
    let end = if share < 0.0 { BLUE } else { VERMILION };
    mix(INK, end, share.abs().min(1.0))
}

/// Mixes two colours linearly.
pub(super) fn mix(from: Rgb, to: Rgb, share: f32) -> Rgb {
    std::array::from_fn(|c| (f32::from(from[c]) + share * (f32::from(to[c]) - f32::from(from[c]))).round() as u8)
}

/// Darkens a colour (`factor` below 1).
pub(super) fn shaded(colour: Rgb, factor: f32) -> Rgb {
    colour.map(|c| (f32::from(c) * factor).round().clamp(0.0, 255.0) as u8)
}

/// Returns the colours of one period of phase in equal steps: a circle around the grey axis of Oklab.
///
/// Equal phase steps look equally large, and there is no seam at 0. The lightness rises and falls once per period, so
/// fringes are visible in a grey print too.
pub(super) fn cyclic_map() -> [Rgb; 256] {
    std::array::from_fn(|i| {
        let (sin, cos) = (i as f64 / 256.0 * TAU).sin_cos();
        // With this lightness and chroma, the whole circle lies inside sRGB.
        from_oklab([0.62 - 0.2 * cos, 0.105 * sin, 0.105 * cos])
    })
}

/// Converts a colour from Oklab (Ottosson 2020) to sRGB.
fn from_oklab([lightness, a, b]: [f64; 3]) -> Rgb {
    let long = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let middle = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let short = (lightness - 0.089_484_177_5 * a - 1.291_485_548 * b).powi(3);
    [
        4.076_741_662_1 * long - 3.307_711_591_3 * middle + 0.230_969_929_2 * short,
        -1.268_438_004_6 * long + 2.609_757_401_1 * middle - 0.341_319_396_5 * short,
        -0.004_196_086_3 * long - 0.703_418_614_7 * middle + 1.707_614_701 * short,
    ]
    .map(|linear| (gamma(linear.clamp(0.0, 1.0)) * 255.0).round() as u8)
}

/// Transfer curve of sRGB.
fn gamma(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance(a: Rgb, b: Rgb) -> f64 {
        let squares = (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2));
        squares.sum::<f64>().sqrt()
    }

    #[test]
    fn the_cyclic_map_has_no_seam_and_opposite_colours_differ() {
        let map = cyclic_map();
        for i in 0..256 {
            assert!(distance(map[i], map[(i + 1) % 256]) < 8.0, "step at {i}");
            assert!(distance(map[i], map[(i + 128) % 256]) > 90.0, "opposite of {i}");
        }
    }

    #[test]
    fn the_sequential_map_grows_lighter() {
        let lightness = |[r, g, b]: Rgb| 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b);
        let values: Vec<f64> = (0..=100).map(|i| lightness(sequential(i as f32 / 100.0))).collect();
        assert!(values.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(sequential(-1.0), VIRIDIS[0]);
        assert_eq!(sequential(2.0), VIRIDIS[8]);
    }

    #[test]
    fn known_oklab_colours() {
        assert_eq!(from_oklab([1.0, 0.0, 0.0]), [255, 255, 255]);
        assert_eq!(from_oklab([0.627_955, 0.224_863, 0.125_846]), [255, 0, 0]);
    }
}

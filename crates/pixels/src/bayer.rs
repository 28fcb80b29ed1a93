//! Bayer mosaics: the order of their colours, how their values are stored, and which grey level a pixel gets.

use super::source_format::SourceFormat;

/// Colours of the first two rows of a mosaic, from the left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BayerOrder {
    /// R G in the first row, G B in the second.
    Rggb,
    /// G R in the first row, B G in the second.
    Grbg,
    /// G B in the first row, R G in the second.
    Gbrg,
    /// B G in the first row, G R in the second.
    Bggr,
}

impl BayerOrder {
    /// All orders.
    pub const ALL: [Self; 4] = [Self::Rggb, Self::Grbg, Self::Gbrg, Self::Bggr];

    /// Whether the pixel in this column and row is green.
    #[must_use]
    pub fn is_green(self, column: usize, row: usize) -> bool {
        let starts_green = matches!(self, Self::Grbg | Self::Gbrg);
        (column % 2 == row % 2) == starts_green
    }
}

/// How the values of a mosaic are stored: as those of a grey format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BayerSamples {
    /// As [`SourceFormat::Grey`].
    Grey,
    /// As [`SourceFormat::Y10`].
    Y10,
    /// As [`SourceFormat::Y10Mipi`].
    Y10Mipi,
    /// As [`SourceFormat::Mono10p`].
    Mono10p,
    /// As [`SourceFormat::Y12`].
    Y12,
    /// As [`SourceFormat::Y12Mipi`].
    Y12Mipi,
    /// As [`SourceFormat::Mono12p`].
    Mono12p,
    /// As [`SourceFormat::Y14`].
    Y14,
    /// As [`SourceFormat::Y14Mipi`].
    Y14Mipi,
    /// As [`SourceFormat::Y16`].
    Y16,
}

impl BayerSamples {
    /// The grey format that stores its values alike.
    #[must_use]
    pub fn grey_format(self) -> SourceFormat {
        match self {
            Self::Grey => SourceFormat::Grey,
            Self::Y10 => SourceFormat::Y10,
            Self::Y10Mipi => SourceFormat::Y10Mipi,
            Self::Mono10p => SourceFormat::Mono10p,
            Self::Y12 => SourceFormat::Y12,
            Self::Y12Mipi => SourceFormat::Y12Mipi,
            Self::Mono12p => SourceFormat::Mono12p,
            Self::Y14 => SourceFormat::Y14,
            Self::Y14Mipi => SourceFormat::Y14Mipi,
            Self::Y16 => SourceFormat::Y16,
        }
    }
}

/// Grey level of a pixel of a mosaic, if the image is not binned. A binned pixel is R + 2 G + B, the sum of a square of
/// the mosaic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BayerGrey {
    /// (R + 2 G + B) / 4 of the pixel and its neighbours, weighted 1 2 1, 2 4 2, 1 2 1: the same mixture of colours at
    /// every pixel. Noise and modulation fall.
    Weighted,
    /// The green pixels; between them, the mean of the four green neighbours.
    Green,
    /// The mosaic itself: nothing is blurred, but neighbouring pixels show different colours.
    #[default]
    Raw,
}

impl BayerGrey {
    /// All choices.
    pub const ALL: [Self; 3] = [Self::Weighted, Self::Green, Self::Raw];

    /// Name in configurations and datasets.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Weighted => "weighted",
            Self::Green => "green",
            Self::Raw => "raw",
        }
    }
}

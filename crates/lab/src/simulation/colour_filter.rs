//! Colour filters on the pixels of a sensor. The simulated light is white, and so are the surfaces.

use fringeflow_pixels::BayerOrder;

/// Light that passes the filters, relative to a sensor without filters.
const RED: f64 = 0.7;
const GREEN: f64 = 1.0;
const BLUE: f64 = 0.6;

/// A colour of a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
}

/// The filters of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColourFilter {
    /// No filters: a grey sensor.
    #[default]
    None,
    /// The same before all pixels: one of the three sensors of a colour camera.
    Uniform(Colour),
    /// A mosaic.
    Mosaic(BayerOrder),
}

impl Colour {
    /// All colours, in the order red, green, blue.
    pub const ALL: [Self; 3] = [Self::Red, Self::Green, Self::Blue];

    fn passed(self) -> f64 {
        match self {
            Self::Red => RED,
            Self::Green => GREEN,
            Self::Blue => BLUE,
        }
    }
}

impl ColourFilter {
    /// Share of the light that reaches the pixel in this column and row.
    #[must_use]
    pub fn passed(self, column: usize, row: usize) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Uniform(colour) => colour.passed(),
            Self::Mosaic(order) if order.is_green(column, row) => GREEN,
            Self::Mosaic(order) => {
                // The row of the first pixel that is not green has its colour.
                let first_row = usize::from(matches!(order, BayerOrder::Gbrg | BayerOrder::Bggr));
                if row % 2 == first_row { RED } else { BLUE }
            }
        }
    }

    /// Number of the sensor in the camera, for noise of its own.
    pub(super) fn sensor_number(self) -> u8 {
        match self {
            Self::None | Self::Mosaic(_) => 0,
            Self::Uniform(colour) => 1 + colour as u8,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mosaics_begin_with_the_colours_of_their_names() {
        for (order, cell) in [
            (BayerOrder::Rggb, [[RED, GREEN], [GREEN, BLUE]]),
            (BayerOrder::Grbg, [[GREEN, RED], [BLUE, GREEN]]),
            (BayerOrder::Gbrg, [[GREEN, BLUE], [RED, GREEN]]),
            (BayerOrder::Bggr, [[BLUE, GREEN], [GREEN, RED]]),
        ] {
            for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1), (4, 7), (5, 2)] {
                let passed = ColourFilter::Mosaic(order).passed(column, row);
                assert_eq!(passed, cell[row % 2][column % 2], "{order:?} at {column}, {row}");
            }
        }
    }
}

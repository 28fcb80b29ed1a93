//! How images are handed to the projector: mounting, depth, packing. In: an upright image. Out: the image as the
//! projector takes it.

use crate::Response;

/// How images are handed to the projector.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Output {
    /// Mounting of the projector.
    pub orientation: Orientation,
    /// Bits of a pixel.
    pub depth: Depth,
    /// Whether the files hold several images each: 24 of 1 bit, or 3 of 8 bits.
    pub packed: bool,
}

/// Bits of a pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Depth {
    /// 8 bits, with the response of the projector.
    Eight(Response),
    /// 1 bit: grey is dithered. Each pixel is on or off, so the light needs no correction.
    One,
}

impl Default for Depth {
    fn default() -> Self {
        Self::Eight(Response::Linear)
    }
}

impl Depth {
    /// Number of bits.
    #[must_use]
    pub const fn bits(&self) -> u8 {
        match self {
            Self::Eight(_) => 8,
            Self::One => 1,
        }
    }
}

/// Rotation of the image, clockwise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rotation {
    /// None.
    #[default]
    None,
    /// A quarter turn clockwise.
    Quarter,
    /// Half a turn, for a projector that hangs upside down.
    Half,
    /// A quarter turn counter-clockwise.
    ThreeQuarters,
}

impl Rotation {
    /// All rotations.
    pub const ALL: [Self; 4] = [Self::None, Self::Quarter, Self::Half, Self::ThreeQuarters];

    /// The angle, degrees.
    #[must_use]
    pub const fn degrees(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Quarter => 90,
            Self::Half => 180,
            Self::ThreeQuarters => 270,
        }
    }

    /// The angle as text.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "0",
            Self::Quarter => "90",
            Self::Half => "180",
            Self::ThreeQuarters => "270",
        }
    }
}

/// Mirroring of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flip {
    /// None.
    #[default]
    None,
    /// Left and right are exchanged, as behind a mirror or a screen.
    Horizontal,
    /// Top and bottom are exchanged.
    Vertical,
}

impl Flip {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::None, Self::Horizontal, Self::Vertical];

    /// The name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Horizontal => "horizontal",
            Self::Vertical => "vertical",
        }
    }
}

/// Mounting of the projector. The image is rotated, then mirrored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Orientation {
    /// Rotation.
    pub rotation: Rotation,
    /// Mirroring.
    pub flip: Flip,
}

impl Orientation {
    /// Returns the size (width, height) of an oriented image.
    #[must_use]
    pub const fn oriented_px(self, [width, height]: [usize; 2]) -> [usize; 2] {
        match self.rotation {
            Rotation::None | Rotation::Half => [width, height],
            Rotation::Quarter | Rotation::ThreeQuarters => [height, width],
        }
    }

    /// Returns the pixel (column, row) of the upright image of `upright_px` that a pixel of the oriented image shows.
    pub(crate) fn upright(self, upright_px: [usize; 2], [column, row]: [usize; 2]) -> [usize; 2] {
        let [width, height] = upright_px;
        let [oriented_width, oriented_height] = self.oriented_px(upright_px);
        let [x, y] = match self.flip {
            Flip::None => [column, row],
            Flip::Horizontal => [oriented_width - 1 - column, row],
            Flip::Vertical => [column, oriented_height - 1 - row],
        };
        match self.rotation {
            Rotation::None => [x, y],
            Rotation::Quarter => [y, height - 1 - x],
            Rotation::Half => [width - 1 - x, height - 1 - y],
            Rotation::ThreeQuarters => [width - 1 - y, x],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of the oriented image of `ab / cd / ef`.
    fn oriented(rotation: Rotation, flip: Flip) -> String {
        let (orientation, upright_px) = (Orientation { rotation, flip }, [2, 3]);
        let [width, height] = orientation.oriented_px(upright_px);
        let pixel = |column, row| {
            let [u, v] = orientation.upright(upright_px, [column, row]);
            char::from(b"abcdef"[v * 2 + u])
        };
        let rows = (0..height).map(|row| (0..width).map(|column| pixel(column, row)).collect::<String>());
        rows.collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn images_are_rotated_clockwise_then_mirrored() {
        for (rotation, flip, expected) in [
            (Rotation::None, Flip::None, "ab cd ef"),
            (Rotation::Quarter, Flip::None, "eca fdb"),
            (Rotation::Half, Flip::None, "fe dc ba"),
            (Rotation::ThreeQuarters, Flip::None, "bdf ace"),
            (Rotation::None, Flip::Horizontal, "ba dc fe"),
            (Rotation::None, Flip::Vertical, "ef cd ab"),
            (Rotation::Quarter, Flip::Horizontal, "ace bdf"),
            (Rotation::Half, Flip::Horizontal, "ef cd ab"),
            (Rotation::ThreeQuarters, Flip::Vertical, "ace bdf"),
        ] {
            assert_eq!(oriented(rotation, flip), expected, "{rotation:?} {flip:?}");
        }
    }
}

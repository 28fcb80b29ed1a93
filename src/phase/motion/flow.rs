//! How what is seen moves through the images of a camera, as far as that is known before they are decoded.

/// Side of a tile, pixels.
pub const FLOW_TILE_PX: usize = 32;

/// How a place of a surface moves from image to image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceMotion {
    /// Through the image: columns and rows, pixels an image.
    pub velocity_px: [f32; 2],
    /// Through the fringes: by so much the phase of the place grows, rad an image.
    pub motion_rad: f32,
}

/// Motion of what a camera sees, by square tiles of [`FLOW_TILE_PX`].
///
/// Within a tile it hardly differs: a millimetre of depth at 300 mm changes it by a third of a per cent. What differs is left to
/// the fit of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Flow {
    columns: usize,
    tiles: Vec<SurfaceMotion>,
}

impl Flow {
    /// Tiles of an image of so many columns, row by row; `None` where they are not that many, or hold a number that is not
    /// finite.
    #[must_use]
    pub fn new([width, height]: [usize; 2], tiles: Vec<SurfaceMotion>) -> Option<Self> {
        let [columns, rows] = Self::tiles_of([width, height]);
        let is_finite =
            |tile: &SurfaceMotion| tile.velocity_px.iter().all(|v| v.is_finite()) && tile.motion_rad.is_finite();
        (tiles.len() == columns * rows && tiles.iter().all(is_finite)).then_some(Self { columns, tiles })
    }

    /// Columns and rows of tiles of an image.
    #[must_use]
    pub fn tiles_of(size_px: [usize; 2]) -> [usize; 2] {
        size_px.map(|length| length.div_ceil(FLOW_TILE_PX))
    }

    /// The motion at a pixel: column, row.
    #[must_use]
    pub fn motion_at(&self, [u, v]: [usize; 2]) -> Option<&SurfaceMotion> {
        let column = Some(u / FLOW_TILE_PX).filter(|&column| column < self.columns)?;
        self.tiles.get(v / FLOW_TILE_PX * self.columns + column)
    }

    /// Columns and rows of tiles.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.columns, self.tiles.len().checked_div(self.columns).unwrap_or(0)]
    }

    /// All tiles, row by row.
    pub(super) fn tiles(&self) -> &[SurfaceMotion] {
        &self.tiles
    }

    /// Tiles of a row.
    pub(super) fn columns(&self) -> usize {
        self.columns
    }
}

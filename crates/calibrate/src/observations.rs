//! What the images of a board show: points of the board in the cameras, and the projector's coordinates around them.
//!
//! Pure data, made by [`crate::images`] and read by [`crate::adjustment`].

use fringeflow::geometry::Pixel;
use nalgebra::{Matrix2, Matrix2x6, Vector2, Vector6};

/// A point of the board as a camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Index in the features of the board.
    pub feature: usize,
    /// Where the camera sees it.
    pub pixel: Pixel,
    /// Standard deviation of column and row, as the fit of the corner tells it, pixels.
    pub sd_px: f64,
}

/// The projector's coordinates around a point of the board, as a smooth function of the pixel of a camera.
///
/// It is a quadratic, fitted to the absolute phase of all pixels of a window, so it tells the coordinates at the image
/// of a board point wherever a calibration puts that image, and noise in finding the corner does not enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhasePatch {
    /// Index in the features of the board.
    pub feature: usize,
    /// Centre of the window.
    pub centre: Pixel,
    /// Half the side of the window, pixels of the camera.
    pub radius_px: f64,
    /// Coefficients of 1, x, y, x², xy, y² for column and row; x and y are offsets from the centre in units of the radius.
    pub coefficients: Matrix2x6<f64>,
    /// Standard deviation of column and row at the centre, from the residuals of the fit, projector pixels.
    pub sd_px: [f64; 2],
}

impl PhasePatch {
    /// Column and row of the projector at a pixel of the camera, and their derivatives with respect to that pixel.
    #[must_use]
    pub fn at(&self, pixel: &Pixel) -> (Vector2<f64>, Matrix2<f64>) {
        let [x, y]: [f64; 2] = ((pixel - self.centre) / self.radius_px).into();
        let terms = |terms: [f64; 6]| self.coefficients * Vector6::from(terms);
        let by_x = terms([0.0, 1.0, 0.0, 2.0 * x, y, 0.0]);
        let by_y = terms([0.0, 0.0, 1.0, 0.0, x, 2.0 * y]);
        (terms([1.0, x, y, x * x, x * y, y * y]), Matrix2::from_columns(&[by_x, by_y]) / self.radius_px)
    }
}

/// What one camera sees of a pose of the board.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraView {
    /// Points of the board.
    pub corners: Vec<Corner>,
    /// The projector's coordinates at points of the board.
    pub patches: Vec<PhasePatch>,
}

/// One pose of the board, seen by both cameras.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct View {
    /// C1 and C2.
    pub cameras: [CameraView; 2],
}

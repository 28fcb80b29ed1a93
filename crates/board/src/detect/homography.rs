//! The projective map from the board to the image, as the first idea of where everything on the board is seen. Lens
//! distortion and bends are what it lacks; they are carried as offsets from it.

use nalgebra::{DMatrix, Matrix3, Vector3};

/// A point of the board in millimetres, or of the image in pixels.
pub(super) type Point = [f64; 2];

/// A projective map from points of the board to points of the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Homography {
    image_from_board: Matrix3<f64>,
    board_from_image: Matrix3<f64>,
}

impl Homography {
    /// The map that fits pairs of board point and image point best; `None` if they do not determine one.
    pub(super) fn fit(pairs: &[(Point, Point)]) -> Option<Self> {
        if pairs.len() < 4 {
            return None;
        }
        let (from, to) = (Scaling::of(pairs.iter().map(|p| p.0))?, Scaling::of(pairs.iter().map(|p| p.1))?);
        let mut rows = DMatrix::zeros(2 * pairs.len(), 9);
        for (k, (board, image)) in pairs.iter().enumerate() {
            let ([x, y], [u, v]) = (from.apply(*board), to.apply(*image));
            rows.row_mut(2 * k).copy_from_slice(&[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u]);
            rows.row_mut(2 * k + 1).copy_from_slice(&[0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, -v]);
        }
        let eigen = (rows.transpose() * rows).symmetric_eigen();
        let h = eigen.eigenvectors.column(eigen.eigenvalues.imin()).clone_owned();
        let scaled = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
        let mut image_from_board = to.matrix().try_inverse()? * scaled * from.matrix();
        // Points before the camera have a positive third coordinate.
        let [x, y] = pairs[0].0;
        if (image_from_board * Vector3::new(x, y, 1.0)).z < 0.0 {
            image_from_board = -image_from_board;
        }
        Some(Self { board_from_image: image_from_board.try_inverse()?, image_from_board })
    }

    /// Image point of a board point.
    pub(super) fn image(&self, [x, y]: Point) -> Point {
        dehomogenized(self.image_from_board * Vector3::new(x, y, 1.0))
    }

    /// Whether a board point lies before the camera.
    pub(super) fn is_before(&self, [x, y]: Point) -> bool {
        (self.image_from_board * Vector3::new(x, y, 1.0)).z > 0.0
    }

    /// Board point of an image point.
    pub(super) fn board(&self, [u, v]: Point) -> Point {
        dehomogenized(self.board_from_image * Vector3::new(u, v, 1.0))
    }

    /// How the image point moves per millimetre along x and along y of the board.
    pub(super) fn axes(&self, [x, y]: Point) -> [Point; 2] {
        let h = 1e-3;
        let difference = |a: Point, b: Point| [0, 1].map(|k| (self.image(a)[k] - self.image(b)[k]) / (2.0 * h));
        [difference([x + h, y], [x - h, y]), difference([x, y + h], [x, y - h])]
    }

    /// The image of a circle: its centre, and the matrix of its ellipse, `(p − centre)ᵀ A (p − centre) = 1`.
    pub(super) fn ellipse(&self, [x, y]: Point, radius: f64) -> Option<(Point, [f64; 3])> {
        let circle = Matrix3::new(1.0, 0.0, -x, 0.0, 1.0, -y, -x, -y, x * x + y * y - radius * radius);
        let conic = self.board_from_image.transpose() * circle * self.board_from_image;
        let shape = conic.fixed_view::<2, 2>(0, 0).clone_owned();
        let centre = -shape.try_inverse()? * conic.fixed_view::<2, 1>(0, 2);
        let level = -(conic[(2, 2)] + (conic.fixed_view::<1, 2>(2, 0) * centre)[0]);
        let a = shape / level;
        (a.determinant() > 0.0 && a.trace() > 0.0).then(|| ([centre.x, centre.y], [a[(0, 0)], a[(0, 1)], a[(1, 1)]]))
    }
}

fn dehomogenized(p: Vector3<f64>) -> Point {
    [p.x / p.z, p.y / p.z]
}

/// Moves points to their middle and scales them to unit size, which keeps the equations well conditioned.
struct Scaling {
    middle: Point,
    scale: f64,
}

impl Scaling {
    fn of(points: impl ExactSizeIterator<Item = Point> + Clone) -> Option<Self> {
        let n = points.len() as f64;
        let middle = points.clone().fold([0.0; 2], |sum, p| [sum[0] + p[0] / n, sum[1] + p[1] / n]);
        let spread = points.map(|p| (p[0] - middle[0]).hypot(p[1] - middle[1])).sum::<f64>() / n;
        (spread > 0.0 && spread.is_finite()).then_some(Self { middle, scale: 1.0 / spread })
    }

    fn apply(&self, p: Point) -> Point {
        [0, 1].map(|k| (p[k] - self.middle[k]) * self.scale)
    }

    fn matrix(&self) -> Matrix3<f64> {
        let s = self.scale;
        Matrix3::new(s, 0.0, -s * self.middle[0], 0.0, s, -s * self.middle[1], 0.0, 0.0, 1.0)
    }
}

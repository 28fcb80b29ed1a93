//! Residuals and their derivatives: a corner in an image, and the projector's coordinates at a corner.

use fringeflow::geometry::{Pixel, Vector3};
use nalgebra::{Matrix2x3, Matrix3, Vector2};

use super::state::{Layout, POSE, PROJECTOR, State};
use crate::lens::Imaged;
use crate::observations::PhasePatch;

/// What is measured of a point of the board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measured {
    /// A device images it at a pixel, which has this standard deviation along each axis.
    Pixel(Pixel, f64),
    /// The phase around its image in a camera tells the projector's coordinates. The device is the camera.
    Phase(PhasePatch),
}

/// One measurement of two coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// Number of the view.
    pub view: usize,
    /// Index in the features of the board.
    pub feature: usize,
    /// The device that sees the point.
    pub device: usize,
    /// Measurements of a group share the scale of their noise.
    pub group: usize,
    /// What is measured.
    pub measured: Measured,
}

impl Measurement {
    /// Whether the coordinates are those of a device: 0 and 1 for the cameras, 2 for the projector.
    pub fn measures(&self, device: usize) -> bool {
        match self.measured {
            Measured::Pixel(..) => self.device == device,
            Measured::Phase(_) => device == PROJECTOR,
        }
    }

    /// Stated standard deviation of both coordinates. The noise of the group is relative to it.
    pub(crate) fn relative_sd(&self) -> Vector2<f64> {
        match self.measured {
            Measured::Pixel(_, sd_px) => Vector2::new(sd_px, sd_px),
            Measured::Phase(patch) => Vector2::from(patch.sd_px),
        }
    }
}

/// Derivatives of a residual: for each parameter that it depends on, those of both coordinates.
#[derive(Debug, Default)]
pub(crate) struct Derivatives {
    pub(crate) columns: Vec<(usize, Vector2<f64>)>,
}

impl Derivatives {
    fn push(&mut self, at: usize, columns: impl Iterator<Item = Vector2<f64>>) {
        self.columns.extend(columns.enumerate().map(|(k, column)| (at + k, column)));
    }
}

/// A point of the board in the frame of the first device, with what its derivatives need.
struct BoardPoint {
    position_m: Vector2<f64>,
    in_first: Vector3,
    /// The point relative to the origin of the board, in the directions of the first device.
    turned: Vector3,
}

/// A point as a device images it.
struct Seen {
    image: Imaged,
    by_first: Matrix2x3<f64>,
    turned: Vector3,
}

/// Computes the residual of a measurement, pixels, and its derivatives. `None` if the point is behind a device.
pub(crate) fn residual(
    state: &State,
    layout: &Layout,
    measurement: &Measurement,
    position_m: Vector2<f64>,
    derivatives: &mut Derivatives,
) -> Option<Vector2<f64>> {
    derivatives.columns.clear();
    let board = &state.boards[measurement.view];
    let turned = board.rotation * state.shape.point(position_m);
    let point = BoardPoint { position_m, in_first: turned + board.translation.vector, turned };
    let seen = seen(state, measurement.device, &point)?;
    match &measurement.measured {
        Measured::Pixel(pixel, _) => {
            push_device(layout, measurement.device, &seen, None, derivatives);
            push_board(state, layout, measurement.view, &point, &seen.by_first, derivatives);
            Some(seen.image.pixel - pixel)
        }
        Measured::Phase(patch) => {
            let lit = self::seen(state, PROJECTOR, &point)?;
            let (measured, by_pixel) = patch.at(&seen.image.pixel);
            push_device(layout, PROJECTOR, &lit, None, derivatives);
            push_device(layout, measurement.device, &seen, Some(-by_pixel), derivatives);
            let by_first = lit.by_first - by_pixel * seen.by_first;
            push_board(state, layout, measurement.view, &point, &by_first, derivatives);
            Some(lit.image.pixel.coords - measured)
        }
    }
}

fn seen(state: &State, device: usize, point: &BoardPoint) -> Option<Seen> {
    let device = &state.devices[device];
    let turned = device.from_first.rotation * point.in_first;
    let image = device.lens.image(&(turned + device.from_first.translation.vector))?;
    let by_first = image.by_point * device.from_first.rotation.to_rotation_matrix().matrix();
    Some(Seen { image, by_first, turned })
}

/// Derivatives with respect to lens and pose of a device, perhaps passed on through those with respect to its pixel.
fn push_device(
    layout: &Layout,
    device: usize,
    seen: &Seen,
    by_pixel: Option<nalgebra::Matrix2<f64>>,
    derivatives: &mut Derivatives,
) {
    let passed_on = |column: Vector2<f64>| by_pixel.map_or(column, |by_pixel| by_pixel * column);
    let lens = seen.image.by_intrinsics.column_iter().map(|column| passed_on(column.into()));
    derivatives.push(layout.lens(device), lens);
    if let Some(at) = layout.arrangement(device) {
        let pose = by_pose(&seen.image.by_point, &seen.turned);
        derivatives.push(at, pose.into_iter().map(passed_on));
    }
}

/// Derivatives with respect to shape and pose of the board.
fn push_board(
    state: &State,
    layout: &Layout,
    view: usize,
    point: &BoardPoint,
    by_first: &Matrix2x3<f64>,
    derivatives: &mut Derivatives,
) {
    let rotation = state.boards[view].rotation.to_rotation_matrix();
    let by_height = by_first * rotation.matrix().column(2);
    let modes = (0..state.shape.modes().len()).map(|mode| by_height * state.shape.mode(mode, point.position_m));
    derivatives.push(layout.shape(), modes);
    derivatives.push(layout.board(view), by_pose(by_first, &point.turned).into_iter());
}

/// Derivatives with respect to a small turn, then a shift, of a frame in which the point is `turned` before its shift.
pub(crate) fn by_pose(by_point: &Matrix2x3<f64>, turned: &Vector3) -> [Vector2<f64>; POSE] {
    let by_turn = -by_point * cross_matrix(turned);
    std::array::from_fn(|k| if k < 3 { by_turn.column(k).into() } else { by_point.column(k - 3).into() })
}

fn cross_matrix(v: &Vector3) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

//! What the virtual scanner looks at: an object on a board, somewhere before C1.
//!
//! In: a body and where it is. Out: its reflectance and, with [`super::trace`], the points that rays meet. Lengths in
//! millimetres in the frame of the object, as in [`super::solid`]; the pose is in metres like every other.

use std::sync::Arc;

use nalgebra::Translation3;

use crate::geometry::{MeasurementVolume, Point3, Pose, Vector3};

use super::SimulationError;
use super::object::Object;
use super::solid::{PointMm, Solid};

/// The board under the object: the plane z = 0 of its frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Board {
    /// Nothing: rays that miss the object meet nothing.
    None,
    /// Matt black, too dark to be measured.
    Dark,
    /// Grey, measured like the object.
    Visible,
}

impl std::str::FromStr for Board {
    type Err = SimulationError;

    fn from_str(name: &str) -> Result<Self, SimulationError> {
        match name {
            "none" => Ok(Self::None),
            "dark" => Ok(Self::Dark),
            "visible" => Ok(Self::Visible),
            name => Err(SimulationError::UnknownBoard { name: name.to_owned() }),
        }
    }
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// The object.
    Object,
    /// The board it lies on.
    Board,
}

/// An object on a board, placed before C1; a copy shares the body.
#[derive(Clone)]
pub struct Scene {
    pub(super) solid: Arc<dyn Solid>,
    pub(super) board: Board,
    cam1_from_object: Pose,
}

pub(super) const MM_PER_M: f64 = 1e3;
/// Gap between the board and the far side of the volume that an object is made for, metres.
const BOARD_GAP_M: f64 = 0.0005;

impl Scene {
    /// A scene from any body and the pose of its frame in that of the exact C1.
    #[must_use]
    pub fn new(solid: Box<dyn Solid>, board: Board, cam1_from_object: Pose) -> Self {
        Self { solid: solid.into(), board, cam1_from_object }
    }

    /// One of the paper's objects in the middle of a measurement volume, turned towards the sensor.
    #[must_use]
    pub fn of_object(object: Object, board: Board, exact_volume: &MeasurementVolume) -> Self {
        Self::new(object.solid(), board, exact_volume.cam1_from_volume() * volume_from_object(object))
    }

    /// Pose of the object's frame in that of the exact C1, metres.
    #[must_use]
    pub fn cam1_from_object(&self) -> &Pose {
        &self.cam1_from_object
    }

    /// The same scene elsewhere: the scanner or the object has moved.
    #[must_use]
    pub fn at(self, cam1_from_object: Pose) -> Self {
        Self { cam1_from_object, ..self }
    }

    /// A point of the frame of C1 (metres) in the frame of the object (millimetres).
    pub(super) fn to_object(&self, point_cam1: &Point3) -> PointMm {
        self.cam1_from_object.inverse_transform_point(point_cam1).coords * MM_PER_M
    }

    /// A direction of the frame of C1 in the frame of the object.
    pub(super) fn direction_to_object(&self, direction_cam1: &Vector3) -> PointMm {
        self.cam1_from_object.inverse_transform_vector(direction_cam1)
    }

    /// A point of the frame of the object (millimetres) in the frame of C1 (metres).
    pub(super) fn to_cam1(&self, point: &PointMm) -> Point3 {
        self.cam1_from_object * Point3::from(point / MM_PER_M)
    }

    /// Share of the light that a place of a surface scatters.
    pub(super) fn albedo(&self, surface: Surface, p: &PointMm) -> f64 {
        let waves = |scale: f64| (p.x / scale + 0.7).sin() * (p.y / scale * 0.9 - 0.4).sin() + (p.z / scale).cos();
        match (surface, self.board) {
            (Surface::Object, _) => 0.80 + 0.035 * waves(9.0),
            (Surface::Board, Board::Visible) => 0.62 + 0.02 * waves(14.0),
            (Surface::Board, _) => 0.03,
        }
    }
}

/// Where one of the paper's objects lies in a measurement volume at rest: in the middle, turned towards the sensor.
pub(super) fn volume_from_object(object: Object) -> Pose {
    let board_z_m = object.usual_depth_m() / 2.0 - BOARD_GAP_M;
    let half_turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Pose::from_parts(Translation3::new(0.0, 0.0, board_z_m), half_turn)
}

//! What the virtual scanner looks at: an object on a board or before one, somewhere before C1.
//!
//! In: a body and where it is. Out: its reflectance and, with [`super::trace`], the points that rays meet. Lengths in
//! millimetres in the frame of the object, as in [`super::solid`]; the pose is in metres like every other.

use std::sync::Arc;

use nalgebra::Translation3;

use crate::geometry::{MeasurementVolume, Point3, Pose, Vector3};

use super::SimulationError;
use super::object::Object;
use super::solid::{Material, PointMm, Solid};

/// The board under the object: the plane z = 0 of its frame, unless it stands behind the measurement volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Board {
    /// Nothing: rays that miss the object meet nothing.
    None,
    /// Matt black, too dark to be measured.
    Dark,
    /// Grey, measured like the object.
    Visible,
    /// Grey as well, but beyond the far side of the measurement volume: lit and seen, never to be measured.
    Behind,
}

impl std::str::FromStr for Board {
    type Err = SimulationError;

    fn from_str(name: &str) -> Result<Self, SimulationError> {
        match name {
            "none" => Ok(Self::None),
            "dark" => Ok(Self::Dark),
            "visible" => Ok(Self::Visible),
            "behind" => Ok(Self::Behind),
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
    /// Height of the board in the frame of the object.
    pub(super) board_z_mm: f64,
    cam1_from_object: Pose,
}

pub(super) const MM_PER_M: f64 = 1e3;
/// Gap between the board and the far side of the volume that an object is made for, metres.
const BOARD_GAP_M: f64 = 0.0005;
/// Distance of a board behind the measurement volume from its far side, metres.
const BEHIND_M: f64 = 0.015;

impl Scene {
    /// An object in the middle of a measurement volume, turned towards the sensor.
    #[must_use]
    pub fn of_object(object: Object, board: Board, exact_volume: &MeasurementVolume) -> Self {
        Self::of_shifted_object(object, [0.0; 3], board, exact_volume)
    }

    /// An object and the board under it, shifted from the middle of a measurement volume in the volume's frame.
    #[must_use]
    pub fn of_shifted_object(
        object: Object,
        shift_mm: [f64; 3],
        board: Board,
        exact_volume: &MeasurementVolume,
    ) -> Self {
        let volume_from_object = Translation3::from(Vector3::from(shift_mm) / MM_PER_M) * volume_from_object(object);
        let board_z_mm = match board {
            Board::Behind => {
                let place = Point3::new(0.0, 0.0, exact_volume.max().z + BEHIND_M);
                volume_from_object.inverse_transform_point(&place).z * MM_PER_M
            }
            Board::None | Board::Dark | Board::Visible => 0.0,
        };
        let cam1_from_object = exact_volume.cam1_from_volume() * volume_from_object;
        Self { solid: object.solid().into(), board, board_z_mm, cam1_from_object }
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

    /// What a place of a surface is made of; boards are matt, and as bright as [`Self::albedo`] says.
    pub(super) fn material(&self, surface: Surface, p: &PointMm) -> Material {
        match surface {
            Surface::Object => self.solid.material(p),
            Surface::Board => Material::PLASTER,
        }
    }

    /// Share of the light that a place of a surface of a material scatters.
    pub(super) fn albedo(&self, surface: Surface, material: Material, p: &PointMm) -> f64 {
        let waves = |scale: f64| (p.x / scale + 0.7).sin() * (p.y / scale * 0.9 - 0.4).sin() + (p.z / scale).cos();
        match (surface, self.board) {
            (Surface::Object, _) => material.brightness * (0.80 + 0.035 * waves(9.0)),
            (Surface::Board, Board::Visible | Board::Behind) => 0.62 + 0.02 * waves(14.0),
            (Surface::Board, _) => 0.03,
        }
    }
}

/// Where an object lies in a measurement volume at rest: in the middle, turned towards the sensor.
pub(super) fn volume_from_object(object: Object) -> Pose {
    let board_z_m = object.usual_depth_m() / 2.0 - BOARD_GAP_M;
    let half_turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Pose::from_parts(Translation3::new(0.0, 0.0, board_z_m), half_turn)
}

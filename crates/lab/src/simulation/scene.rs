//! The scene of the virtual scanner: an object with a board, placed in front of C1.
//!
//! In: a solid and its pose. Out: its reflectance and, with [`super::trace`], its intersections with rays. Lengths are
//! in millimetres in the frame of the object, as in [`super::solid`]; poses are in metres.

use std::sync::Arc;

use nalgebra::Translation3;

use fringeflow::geometry::{MeasurementVolume, Point3, Pose, Rig, Vector3};

use super::SimulationError;
use super::board::{Board, BoardPlane};
use super::coated_solid::CoatedSolid;
use super::hand::Hand;
use super::object::Object;
use super::scaled_solid::ScaledSolid;
use super::solid::{MM_PER_M, Material, PointMm, Solid};

/// The part of the scene that a ray hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// The object.
    Object,
    /// The board, under the object or apart from the measurement volume.
    Board,
    /// A hand in front of the measurement volume.
    Hand,
}

/// An object, a board and obstacles, placed in front of C1. Clones share the solids.
#[derive(Clone)]
pub struct Scene {
    pub(super) solid: Arc<dyn Solid>,
    pub(super) board: Option<BoardPlane>,
    pub(super) hand: Option<Arc<Hand>>,
    volume_from_object: Pose,
    cam1_from_object: Pose,
}

/// Mean albedo of plaster.
pub(super) const PLASTER_ALBEDO: f64 = 0.8;
/// Gap between the board and the far side of the default volume of the object, metres.
const BOARD_GAP_M: f64 = 0.0005;
/// Minimum distance of cameras and projector from a board, millimetres.
const MIN_SIGHT_MM: f64 = 20.0;

impl Scene {
    /// Creates a scene of an object in the middle of a measurement volume, facing the sensor.
    #[must_use]
    pub fn from_object(object: Object, board: Board, exact_volume: &MeasurementVolume) -> Self {
        Self::from_shifted_object(object, [0.0; 3], board, exact_volume)
    }

    /// Creates a scene of an object and the board under it, shifted from the middle of a measurement volume, in the
    /// frame of the volume.
    #[must_use]
    pub fn from_shifted_object(
        object: Object,
        shift_mm: [f64; 3],
        board: Board,
        exact_volume: &MeasurementVolume,
    ) -> Self {
        let volume_from_object = Translation3::from(Vector3::from(shift_mm) / MM_PER_M) * volume_from_object(object);
        let board = BoardPlane::new(board, &volume_from_object, exact_volume);
        let cam1_from_object = exact_volume.cam1_from_volume() * volume_from_object;
        Self { solid: object.solid().into(), board, hand: None, volume_from_object, cam1_from_object }
    }

    /// Returns the scene with its object, which is `object`, scaled by a factor about its foot.
    pub(super) fn scaled(self, object: Object, factor: f64) -> Self {
        Self { solid: Arc::new(ScaledSolid { solid: object.solid(), factor }), ..self }
    }

    /// Returns the scene with a coat on its object: see [`CoatedSolid::new`].
    pub(super) fn coated(self, albedo: Option<f64>, gloss: f64) -> Self {
        Self { solid: Arc::new(CoatedSolid::new(self.solid.clone(), albedo, gloss)), ..self }
    }

    /// Returns the scene with a hand in front of the measurement volume.
    pub(super) fn with_hand(self, exact_volume: &MeasurementVolume) -> Self {
        Self { hand: Some(Arc::new(Hand::in_front_of(exact_volume, &self.volume_from_object))), ..self }
    }

    /// Checks that cameras and projector look at the front of the board.
    pub(super) fn check_board(&self, exact: &Rig) -> Result<(), SimulationError> {
        let Some(board) = &self.board else { return Ok(()) };
        let devices = [Point3::origin(), exact.centre_of_cam2(), exact.centre_of_projector()];
        let sight_mm = devices.iter().map(|centre| board.height(&self.to_object(centre))).fold(f64::INFINITY, f64::min);
        if sight_mm >= MIN_SIGHT_MM { Ok(()) } else { Err(SimulationError::BoardAtDevice { sight_mm }) }
    }

    /// Whether a surface is apart from the measurement volume, so that it is never measured.
    pub(super) fn is_apart(&self, surface: Surface) -> bool {
        match surface {
            Surface::Object => false,
            Surface::Board => self.board.is_some_and(|board| board.apart),
            Surface::Hand => true,
        }
    }

    /// Whether a surface is bright enough to be measured.
    pub(super) fn is_bright(&self, surface: Surface) -> bool {
        match surface {
            Surface::Object => true,
            Surface::Board => self.board.is_some_and(|board| board.bright),
            Surface::Hand => false,
        }
    }

    /// Pose of the frame of the object in that of the exact C1, metres.
    #[must_use]
    pub fn cam1_from_object(&self) -> &Pose {
        &self.cam1_from_object
    }

    /// Returns the scene at another pose, after the scanner or the object has moved.
    #[must_use]
    pub fn at(self, cam1_from_object: Pose) -> Self {
        Self { cam1_from_object, ..self }
    }

    /// Transforms a point from the frame of C1 (metres) to the frame of the object (millimetres).
    pub(super) fn to_object(&self, point_cam1: &Point3) -> PointMm {
        self.cam1_from_object.inverse_transform_point(point_cam1).coords * MM_PER_M
    }

    /// Transforms a direction from the frame of C1 to the frame of the object.
    pub(super) fn direction_to_object(&self, direction_cam1: &Vector3) -> PointMm {
        self.cam1_from_object.inverse_transform_vector(direction_cam1)
    }

    /// Transforms a point from the frame of the object (millimetres) to the frame of C1 (metres).
    pub(super) fn to_cam1(&self, point: &PointMm) -> Point3 {
        self.cam1_from_object * Point3::from(point / MM_PER_M)
    }

    /// Material at a point of a surface. Boards are matt; [`Self::albedo`] returns their brightness.
    pub(super) fn material(&self, surface: Surface, p: &PointMm) -> Material {
        match surface {
            Surface::Object => self.solid.material(p),
            Surface::Board => Material::PLASTER,
            Surface::Hand => self.hand.as_ref().map_or(Material::PLASTER, |hand| hand.material(p)),
        }
    }

    /// Albedo at a point of a surface of a material.
    pub(super) fn albedo(&self, surface: Surface, material: Material, p: &PointMm) -> f64 {
        let waves = |scale: f64| (p.x / scale + 0.7).sin() * (p.y / scale * 0.9 - 0.4).sin() + (p.z / scale).cos();
        match surface {
            Surface::Object | Surface::Hand => material.brightness * (PLASTER_ALBEDO + 0.035 * waves(9.0)),
            Surface::Board => self.board.map_or(0.0, |board| board.albedo(waves(14.0))),
        }
    }
}

/// Pose of an object at rest in the middle of a measurement volume, facing the sensor.
pub(super) fn volume_from_object(object: Object) -> Pose {
    let board_z_m = object.usual_depth_m() / 2.0 - BOARD_GAP_M;
    let half_turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Pose::from_parts(Translation3::new(0.0, 0.0, board_z_m), half_turn)
}

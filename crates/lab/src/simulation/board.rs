//! Boards: the surface under an object, or a plane in front of or behind the measurement volume.
//!
//! In: a [`Board`]. Out: its plane in the frame of the object, its intersections with rays, and its albedo. Lengths are
//! in millimetres. A board apart from the volume is lit and seen, but none of its points counts as in the volume.

use std::str::FromStr;

use fringeflow::geometry::{MeasurementVolume, Point3, Pose};

use super::ray::Ray;
use super::solid::{MM_PER_M, PointMm};
use super::{SimulationError, check_range};

/// The board of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Board {
    /// No board: rays that miss the object hit nothing.
    None,
    /// Under the object, in the plane z = 0 of its frame; matt black, too dark to measure.
    Dark,
    /// Under the object, grey, measured like the object.
    Visible,
    /// Apart from the measurement volume: lit and seen, never measured.
    Apart(BoardApart),
}

/// A board in front of or behind the measurement volume.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct BoardApart {
    /// Gap between the volume and the nearest point of the board, millimetres. Positive: behind the far face of the
    /// volume. Negative: in front of its near face. A board in front covers only the right part of the volume.
    pub distance_mm: f64,
    /// Albedo: 0.05 is black paper, 0.8 is white paint, above 1 is reflective film.
    pub albedo: f64,
    /// Rotation about the vertical axis, degrees. If positive, the right border is farther away; if negative, the left
    /// one.
    pub tilt_deg: f64,
}

/// Smallest and largest gap, millimetres.
const MIN_GAP_MM: f64 = 0.1;
const MAX_GAP_MM: f64 = 1e5;
const MAX_ALBEDO: f64 = 2.0;
const MAX_TILT_DEG: f64 = 80.0;
/// Left border of a board in front of the volume, to the right of the middle, millimetres.
const EDGE_X_MM: f64 = 10.0;
/// Albedo of a grey board, and its variation from place to place.
const GREY_ALBEDO: f64 = 0.62;
const GREY_RIPPLE: f64 = 0.02;
const DARK_ALBEDO: f64 = 0.03;

impl Board {
    /// A grey board 15 mm behind the measurement volume.
    pub const BEHIND: Self = Self::Apart(BoardApart { distance_mm: 15.0, albedo: GREY_ALBEDO, tilt_deg: 0.0 });

    /// Checks the ranges of a board apart from the volume.
    pub(super) fn check(self) -> Result<(), SimulationError> {
        let Self::Apart(BoardApart { distance_mm, albedo, tilt_deg }) = self else { return Ok(()) };
        check_range("the board's distance", distance_mm, -MAX_GAP_MM, MAX_GAP_MM, "mm")?;
        if distance_mm.abs() < MIN_GAP_MM {
            return Err(SimulationError::BoardGap { distance_mm, least_mm: MIN_GAP_MM });
        }
        check_range("the board's albedo", albedo, 0.0, MAX_ALBEDO, "")?;
        check_range("the board's tilt", tilt_deg, -MAX_TILT_DEG, MAX_TILT_DEG, "°")
    }
}

impl FromStr for Board {
    type Err = SimulationError;

    fn from_str(name: &str) -> Result<Self, SimulationError> {
        match name {
            "none" => Ok(Self::None),
            "dark" => Ok(Self::Dark),
            "visible" => Ok(Self::Visible),
            "behind" => Ok(Self::BEHIND),
            number => {
                let distance_mm =
                    number.parse().map_err(|_| SimulationError::UnknownBoard { name: number.to_owned() })?;
                Ok(Self::Apart(BoardApart { distance_mm, albedo: GREY_ALBEDO, tilt_deg: 0.0 }))
            }
        }
    }
}

/// A board in the frame of its object.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoardPlane {
    point: PointMm,
    pub(super) normal: PointMm,
    /// Left border; `None` for an infinite board.
    edge_x_mm: Option<f64>,
    albedo: f64,
    ripple: f64,
    /// Whether it is apart from the volume.
    pub(super) apart: bool,
    /// Whether it is bright enough to be measured inside the volume.
    pub(super) bright: bool,
}

impl BoardPlane {
    /// Returns the plane of a board, or `None` if there is no board.
    pub(super) fn new(board: Board, volume_from_object: &Pose, volume: &MeasurementVolume) -> Option<Self> {
        let under = Self {
            point: PointMm::zeros(),
            normal: PointMm::z(),
            edge_x_mm: None,
            albedo: GREY_ALBEDO,
            ripple: GREY_RIPPLE,
            apart: false,
            bright: true,
        };
        match board {
            Board::None => None,
            Board::Dark => Some(Self { albedo: DARK_ALBEDO, ripple: 0.0, bright: false, ..under }),
            Board::Visible => Some(under),
            Board::Apart(board) => Some(Self::apart(board, volume_from_object, volume)),
        }
    }

    fn apart(board: BoardApart, volume_from_object: &Pose, volume: &MeasurementVolume) -> Self {
        let (is_behind, gap_m) = (board.distance_mm > 0.0, board.distance_mm / MM_PER_M);
        let face_z = if is_behind { volume.max().z } else { volume.min().z };
        let left = if is_behind { volume.min().x } else { EDGE_X_MM / MM_PER_M };
        // The border of the board nearest to the volume keeps the gap. Behind the volume this is the border nearer to
        // the cameras, in front of it the farther one.
        let x = if (board.tilt_deg > 0.0) == is_behind { left } else { volume.max().x };
        let to_object = |point| volume_from_object.inverse_transform_point(&point).coords * MM_PER_M;
        let (sin, cos) = board.tilt_deg.to_radians().sin_cos();
        Self {
            point: to_object(Point3::new(x, 0.0, face_z + gap_m)),
            normal: PointMm::new(sin, 0.0, cos),
            edge_x_mm: (!is_behind).then(|| to_object(Point3::new(left, 0.0, 0.0)).x),
            albedo: board.albedo,
            ripple: GREY_RIPPLE * (board.albedo / GREY_ALBEDO),
            apart: true,
            bright: false,
        }
    }

    /// Distance along a ray to its intersection with the front of the board.
    pub(super) fn distance(&self, ray: &Ray) -> Option<f64> {
        let steepness = ray.direction.dot(&self.normal);
        let distance = -self.height(&ray.origin) / steepness;
        (steepness < 0.0 && distance > 0.0 && self.reaches(&ray.at(distance))).then_some(distance)
    }

    /// Whether the board hides a visible point from a device.
    pub(super) fn hides(&self, point: &PointMm, device: &PointMm) -> bool {
        let (from, to) = (self.height(point), self.height(device));
        match self.edge_x_mm {
            // All visible points lie in front of an infinite board.
            None => to <= 0.0,
            Some(_) => (from > 0.0) != (to > 0.0) && self.reaches(&(point + (device - point) * (from / (from - to)))),
        }
    }

    /// Distance of a point in front of the board, millimetres.
    pub(super) fn height(&self, point: &PointMm) -> f64 {
        (point - self.point).dot(&self.normal)
    }

    fn reaches(&self, point: &PointMm) -> bool {
        self.edge_x_mm.is_none_or(|edge| point.x >= edge)
    }

    /// Albedo of a point whose brightness deviates from the mean by `wave` (−2 to 2).
    pub(super) fn albedo(&self, wave: f64) -> f64 {
        self.albedo + self.ripple * wave
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::scene::volume_from_object;
    use crate::simulation::{Object, RigOptions, VirtualRig};

    const TILTS_DEG: [f64; 5] = [-60.0, -20.0, 0.0, 20.0, 60.0];

    /// Heights of the two corners of the volume that face the board.
    fn heights_of_corners(distance_mm: f64, tilt_deg: f64) -> Vec<f64> {
        let rig = VirtualRig::new(&RigOptions::usual(0.025)).unwrap();
        let (volume, pose) = (&rig.exact_volume, volume_from_object(Object::Plane));
        let board = Board::Apart(BoardApart { distance_mm, albedo: 0.3, tilt_deg });
        let plane = BoardPlane::new(board, &pose, volume).unwrap();
        let left = if distance_mm > 0.0 { volume.min().x } else { EDGE_X_MM / MM_PER_M };
        let z = if distance_mm > 0.0 { volume.max().z } else { volume.min().z };
        let corner = |x| pose.inverse_transform_point(&Point3::new(x, 0.0, z)).coords * MM_PER_M;
        // The gap is measured along the axis of the volume, not along the normal of the board.
        [left, volume.max().x].map(|x| plane.height(&corner(x)) / plane.normal.z).to_vec()
    }

    #[test]
    fn the_nearest_point_of_a_board_keeps_the_gap_at_any_tilt() {
        for tilt_deg in TILTS_DEG {
            for distance_mm in [0.5, 15.0, 1000.0, -0.5, -30.0] {
                let heights = heights_of_corners(distance_mm, tilt_deg);
                let nearest = heights.iter().map(|h| h.abs()).fold(f64::INFINITY, f64::min);
                assert!((nearest - distance_mm.abs()).abs() < 1e-9, "{distance_mm} mm, {tilt_deg}°: {heights:?}");
                assert!(heights.iter().all(|h| h.signum() == distance_mm.signum()), "{heights:?}");
            }
        }
    }

    #[test]
    fn boards_are_parsed_from_words_and_numbers() {
        assert_eq!("behind".parse::<Board>().unwrap(), "15".parse().unwrap());
        assert_eq!("visible".parse::<Board>().unwrap(), Board::Visible);
        let refused = "floor".parse::<Board>().unwrap_err().to_string();
        assert!(refused.contains("\"floor\"") && refused.contains("behind"), "{refused}");
    }

    #[test]
    fn an_invalid_board_is_refused_with_its_value() {
        let apart = BoardApart { distance_mm: 85.0, albedo: 0.3, tilt_deg: 20.0 };
        let refused = |board| Board::Apart(board).check().unwrap_err().to_string();
        assert!(Board::Apart(apart).check().is_ok());
        assert!(refused(BoardApart { distance_mm: f64::NAN, ..apart }).contains("distance is NaN mm"));
        assert!(refused(BoardApart { distance_mm: 0.0, ..apart }).contains("0 mm"));
        assert!(refused(BoardApart { albedo: 7.0, ..apart }).contains("albedo is 7; it must lie between 0 and 2"));
        assert!(refused(BoardApart { tilt_deg: 90.0, ..apart }).contains("tilt is 90 °"));
    }
}

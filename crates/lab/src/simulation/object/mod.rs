//! The measured objects as signed distance functions: the seven objects of the paper (section 3) in their sizes, and
//! harder ones.

mod artefacts;
mod assembled;
mod bodies;
mod bowl;
mod clutter;
mod crowd;
mod crumbs;
mod elephant;
mod machine;
mod nose;
mod plane;
mod prism;
mod teeth;
mod tooth;
mod tray;

use std::str::FromStr;

use super::hand::Hand;
use super::scaled_solid::ScaledSolid;
use super::solid::Solid;
use super::{Board, SimulationError};

/// Place of the hand before it is scaled, millimetres, and its size.
const HAND_ORIGIN: [f64; 3] = [-49.5, -10.0, 0.0];
const HAND_FACTOR: f64 = 0.52;

/// The measured object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Object {
    /// A slightly tilted plate.
    Plane,
    /// A three-sided prism beside a flight of steps.
    Prism,
    /// A machine part: toothed flange with hub, bores and keyway.
    Machine,
    /// A plaster arch with fourteen teeth.
    Teeth,
    /// A single plaster tooth, a molar on its base.
    Tooth,
    /// The nose of a face, 43 mm deep.
    Nose,
    /// A toy elephant lying on its side.
    Elephant,
    /// Solids at many heights that hide and shadow each other, some dark, some glossy.
    Clutter,
    /// Separate pieces of about 50 pixels each, at any height.
    Crumbs,
    /// A tray of pieces, three times as large as the field of view.
    Tray,
    /// Balls on a plate.
    Balls,
    /// A tilted ring.
    Torus,
    /// Pipes that lie across each other, and two that show their inside.
    Pipes,
    /// A bowl, seen from inside.
    Bowl,
    /// A flight of steps of 1 to 9 mm.
    Stairs,
    /// Ridges and wires down to 1 mm.
    Ridges,
    /// Forty small bodies, half of them outside the default volume.
    Crowd,
    /// A small hand with spread fingers.
    Hand,
    /// Isolated bodies without a plate.
    Bodies,
    /// A ball of 20 mm on a pin, to check a scanner on.
    Sphere,
    /// Two balls of 20 mm at a distance of 60 mm, joined by a bar, to check a scanner on.
    BallBar,
}

impl Object {
    /// The objects of the paper, in the order of its Table 1.
    pub const PAPER: [Self; 7] =
        [Self::Plane, Self::Prism, Self::Machine, Self::Teeth, Self::Tooth, Self::Nose, Self::Elephant];

    /// All objects, those of the paper first.
    pub const ALL: [Self; 21] = [
        Self::Plane,
        Self::Prism,
        Self::Machine,
        Self::Teeth,
        Self::Tooth,
        Self::Nose,
        Self::Elephant,
        Self::Clutter,
        Self::Crumbs,
        Self::Tray,
        Self::Balls,
        Self::Torus,
        Self::Pipes,
        Self::Bowl,
        Self::Stairs,
        Self::Ridges,
        Self::Crowd,
        Self::Hand,
        Self::Bodies,
        Self::Sphere,
        Self::BallBar,
    ];

    /// Whether the object is an artefact of known size, to check a scanner on.
    #[must_use]
    pub fn is_artefact(self) -> bool {
        matches!(self, Self::Sphere | Self::BallBar)
    }

    /// Returns the names of all objects, for messages.
    #[must_use]
    pub fn names() -> String {
        let [names @ .., last] = Self::ALL.map(Self::name);
        format!("{} or {last}", names.join(", "))
    }

    /// Name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::Prism => "prism",
            Self::Machine => "machine",
            Self::Teeth => "teeth",
            Self::Tooth => "tooth",
            Self::Nose => "nose",
            Self::Elephant => "elephant",
            Self::Clutter => "clutter",
            Self::Crumbs => "crumbs",
            Self::Tray => "tray",
            Self::Balls => "balls",
            Self::Torus => "torus",
            Self::Pipes => "pipes",
            Self::Bowl => "bowl",
            Self::Stairs => "stairs",
            Self::Ridges => "ridges",
            Self::Crowd => "crowd",
            Self::Hand => "hand",
            Self::Bodies => "bodies",
            Self::Sphere => "sphere",
            Self::BallBar => "ball-bar",
        }
    }

    /// Default depth of the measurement volume for this object, metres.
    #[must_use]
    pub fn usual_depth_m(self) -> f64 {
        match self {
            Self::Nose => 0.045,
            _ => 0.025,
        }
    }

    /// Whether the object lies within its default measurement volume.
    #[must_use]
    pub fn fits_volume(self) -> bool {
        !matches!(self, Self::Tray | Self::Crowd)
    }

    /// Default board of the object.
    #[must_use]
    pub fn usual_board(self) -> Board {
        match self {
            Self::Crumbs | Self::Crowd | Self::Bodies => Board::None,
            _ => Board::Visible,
        }
    }

    /// The solid of the object.
    #[must_use]
    pub fn solid(self) -> Box<dyn Solid> {
        match self {
            Self::Plane => Box::new(plane::Plane::new()),
            Self::Prism => Box::new(prism::Prism::new()),
            Self::Machine => Box::new(machine::Machine),
            Self::Teeth => Box::new(teeth::Teeth::new()),
            Self::Tooth => Box::new(tooth::Tooth),
            Self::Nose => Box::new(nose::Nose),
            Self::Elephant => Box::new(elephant::Elephant::new()),
            Self::Clutter => Box::new(clutter::Clutter),
            Self::Crumbs => Box::new(crumbs::Crumbs::new()),
            Self::Tray => Box::new(tray::Tray::new()),
            Self::Balls => Box::new(assembled::balls()),
            Self::Torus => Box::new(assembled::torus()),
            Self::Pipes => Box::new(assembled::pipes()),
            Self::Bowl => Box::new(bowl::Bowl),
            Self::Stairs => Box::new(assembled::stairs()),
            Self::Ridges => Box::new(assembled::ridges()),
            Self::Crowd => Box::new(crowd::crowd()),
            Self::Hand => Box::new(ScaledSolid { solid: Box::new(Hand::at(HAND_ORIGIN.into())), factor: HAND_FACTOR }),
            Self::Bodies => Box::new(assembled::isolated()),
            Self::Sphere => Box::new(artefacts::sphere()),
            Self::BallBar => Box::new(artefacts::ball_bar()),
        }
    }
}

impl FromStr for Object {
    type Err = SimulationError;

    fn from_str(name: &str) -> Result<Self, SimulationError> {
        let known = Self::ALL.into_iter().find(|object| object.name() == name);
        known.ok_or_else(|| SimulationError::UnknownObject { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::solid::PointMm;

    /// Points distributed evenly over a box a quarter larger than that of the object.
    fn points(solid: &dyn Solid, count: usize) -> impl Iterator<Item = PointMm> {
        let (min, max) = solid.bounds_mm();
        let (centre, half) = ((min + max) / 2.0, (max - min) / 1.6);
        (0..count).map(move |i| {
            // Steps of the generalized golden ratio fill the box evenly.
            let shares = [0.819_172_513_4, 0.671_043_606_7, 0.549_700_478_0].map(|a: f64| (a * i as f64).fract());
            centre + half.component_mul(&(PointMm::from(shares) * 2.0).add_scalar(-1.0))
        })
    }

    #[test]
    fn no_field_rises_faster_than_distance() {
        for object in Object::ALL {
            let solid = object.solid();
            for p in points(solid.as_ref(), 4000) {
                for step in [PointMm::x(), PointMm::y(), PointMm::z(), PointMm::new(0.6, -0.48, 0.64)] {
                    let step = step * 0.01;
                    let (here, there) = (solid.distance_mm(&p), solid.distance_mm(&(p + step)));
                    // Inside, rays do not advance, and only the sign counts.
                    let change = if here > 0.0 && there > 0.0 { (there - here).abs() } else { 0.0 };
                    assert!(change <= step.norm() * (1.0 + 1e-9), "{object:?} at {p}: {}", change / step.norm());
                }
            }
        }
    }

    #[test]
    fn all_objects_lie_in_their_boxes_and_all_boxes_but_two_in_the_volume() {
        for object in Object::ALL {
            let solid = object.solid();
            let (min, max) = solid.bounds_mm();
            let is_beside = min.x <= -50.0 || max.x >= 50.0 || min.y <= -40.0 || max.y >= 40.0;
            assert!(!is_beside || !object.fits_volume(), "{object:?}: {min} {max}");
            let is_in_depth = min.z >= 0.0 && max.z < object.usual_depth_m() * 1e3 - 0.5;
            assert_eq!(is_in_depth, object != Object::Crowd, "{object:?}: {min} {max}");
            let inside = |p: &PointMm| (0..3).all(|i| p[i] >= min[i] && p[i] <= max[i]);
            for p in points(solid.as_ref(), 20_000) {
                // The board hides everything below it.
                assert!(inside(&p) || p.z < 0.0 || solid.distance_mm(&p) > 0.0, "{object:?} at {p}");
            }
        }
    }
}

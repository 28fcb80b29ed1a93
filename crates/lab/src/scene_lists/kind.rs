//! What makes the scenes of a list hard.

use crate::simulation::Object;

/// What makes a scene hard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SceneKind {
    /// A single object on a board, as in the paper.
    Plain,
    /// Many bodies and edges, which hide and shadow each other.
    Cluttered,
    /// Bodies without a board, some of them very small.
    Isolated,
    /// A board 30 to 1000 mm behind the volume.
    Behind,
    /// A dim board 30 mm before the volume, or a hand.
    Before,
    /// A dark object, or noisy images.
    Dim,
    /// A glossy object.
    Glossy,
    /// The object moves.
    Moving,
    /// Many periods on a segment and a large calibration error.
    Ambiguous,
}

impl SceneKind {
    /// All kinds.
    pub const ALL: [Self; 9] = [
        Self::Plain,
        Self::Cluttered,
        Self::Isolated,
        Self::Behind,
        Self::Before,
        Self::Dim,
        Self::Glossy,
        Self::Moving,
        Self::Ambiguous,
    ];

    /// Name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Cluttered => "cluttered",
            Self::Isolated => "isolated",
            Self::Behind => "behind",
            Self::Before => "before",
            Self::Dim => "dim",
            Self::Glossy => "glossy",
            Self::Moving => "moving",
            Self::Ambiguous => "ambiguous",
        }
    }

    /// The objects of scenes of this kind.
    pub(super) fn objects(self) -> &'static [Object] {
        use Object::{
            Balls, Bodies, Bowl, Clutter, Crowd, Crumbs, Elephant, Hand, Machine, Nose, Pipes, Plane, Prism, Ridges,
            Stairs, Teeth, Tooth, Torus, Tray,
        };
        match self {
            Self::Plain => &[Plane, Prism, Machine, Teeth, Tooth, Nose, Elephant, Torus, Bowl, Hand, Tray],
            Self::Cluttered => &[Clutter, Balls, Pipes, Stairs, Ridges, Prism],
            Self::Isolated => &[Crumbs, Crowd, Bodies, Bodies, Hand, Torus],
            Self::Behind => &[Tooth, Machine, Teeth, Bodies, Torus, Hand, Crowd, Pipes, Clutter],
            Self::Before => &[Elephant, Machine, Teeth, Balls, Stairs, Clutter, Bowl],
            Self::Dim => &[Elephant, Teeth, Nose, Clutter, Balls, Pipes, Hand],
            Self::Glossy => &[Clutter, Balls, Machine, Bowl, Torus, Elephant, Pipes],
            Self::Moving => &[Nose, Teeth, Clutter, Elephant, Balls, Hand, Stairs],
            Self::Ambiguous => &[Elephant, Machine, Clutter, Stairs, Bowl, Balls, Teeth, Ridges],
        }
    }
}

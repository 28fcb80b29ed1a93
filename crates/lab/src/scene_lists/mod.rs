//! Two lists of scenes of the virtual scanner: one to build the method with, one to judge it by.
//!
//! ```text
//! SceneList, number ─► ListedScene: kind, layout, options, staging (drawn from the seed of list and number)
//!                         └─ measure ─► images in memory ─► cloud by a method, cloud by the paper's method
//!                                                              └─► scores by the exact truth
//! ```
//!
//! The lists never mix: every scene has random numbers of its own, seeded by list and number, and its noise and its
//! calibration error have seeds of the list. Kinds and layouts of cameras and projector take turns, so that the first
//! scenes of a list already hold all of them, and each kind meets each layout. A scene costs a second or a few; nothing
//! is written to a file.

mod draw;
mod kind;
mod layout;
mod measure;
mod sensitivity;

pub use draw::ListedScene;
pub use kind::SceneKind;
pub use layout::Layout;
pub use measure::{MeasuredScene, SceneError, SceneFigures, measure_all};
pub use sensitivity::{Change, FACTOR, Sensitivity, measure_sensitivity};

/// A list of scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SceneList {
    /// To build the method: scenes may be looked at, and settings fitted to them.
    Build,
    /// To judge the method: nothing is fitted to them.
    Judge,
}

/// Number of scenes of a list: six of each kind with each layout.
pub const SCENES: usize = 6 * SceneKind::ALL.len() * Layout::ALL.len();

impl SceneList {
    /// Both lists.
    pub const ALL: [Self; 2] = [Self::Build, Self::Judge];

    /// Name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Build => "build",
            Self::Judge => "judge",
        }
    }

    /// The scene with this number, 0 to [`SCENES`] − 1. Higher numbers give further scenes.
    #[must_use]
    pub fn scene(self, number: usize) -> ListedScene {
        draw::draw(self, number)
    }

    /// Seed of scene `number`. No two scenes of the lists share one.
    fn seed(self, number: usize) -> u64 {
        let first = match self {
            Self::Build => 1_000_000,
            Self::Judge => 2_000_000,
        };
        first + number as u64
    }
}

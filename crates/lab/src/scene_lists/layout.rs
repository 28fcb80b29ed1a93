//! Layouts of cameras and projector: where the projector stands, and how long the base is.

use rand_chacha::ChaCha8Rng;

use super::draw::within;
use crate::simulation::Arrangement;

/// A layout of cameras and projector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// The projector between the cameras, as in the paper.
    Inside,
    /// The projector beyond C1.
    OutsideCam1,
    /// The projector beyond C2.
    OutsideCam2,
    /// The projector high above the base.
    Above,
    /// The projector beside the base, with tilted columns.
    Beside,
    /// Cameras far apart.
    WideBase,
    /// Cameras close together.
    NarrowBase,
    /// The sensor close to the volume.
    Near,
}

impl Layout {
    /// All layouts.
    pub const ALL: [Self; 8] = [
        Self::Inside,
        Self::OutsideCam1,
        Self::OutsideCam2,
        Self::Above,
        Self::Beside,
        Self::WideBase,
        Self::NarrowBase,
        Self::Near,
    ];

    /// Name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Inside => "inside",
            Self::OutsideCam1 => "outside-cam1",
            Self::OutsideCam2 => "outside-cam2",
            Self::Above => "above",
            Self::Beside => "beside",
            Self::WideBase => "wide-base",
            Self::NarrowBase => "narrow-base",
            Self::Near => "near",
        }
    }

    /// Draws an arrangement of this layout.
    pub(super) fn draw(self, rng: &mut ChaCha8Rng) -> Arrangement {
        let mut size = |low: f64, high: f64| within([low, high], rng);
        let usual = Arrangement {
            projector_place: size(0.28, 0.46),
            projector_height_m: size(0.03, 0.07),
            projector_roll_rad: size(-0.03, 0.03),
            ..Arrangement::TABLE_TOP
        };
        match self {
            Self::Inside => usual,
            Self::OutsideCam1 => Arrangement { projector_place: size(-0.75, -0.3), ..usual },
            Self::OutsideCam2 => Arrangement { projector_place: size(1.3, 1.75), ..usual },
            Self::Above => Arrangement { projector_height_m: size(0.1, 0.15), ..usual },
            Self::Beside => Arrangement {
                projector_height_m: size(-0.09, -0.03),
                projector_roll_rad: size(0.1, 0.3) * if size(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 },
                ..usual
            },
            Self::WideBase => Arrangement { base_m: size(0.16, 0.22), ..usual },
            Self::NarrowBase => Arrangement { base_m: size(0.05, 0.075), ..usual },
            Self::Near => {
                // The field of view stays as wide, so the lenses are shorter.
                let distance_m = size(0.19, 0.23);
                let share = distance_m / usual.distance_m;
                Arrangement {
                    distance_m,
                    base_m: size(0.08, 0.11),
                    camera_focal_px: usual.camera_focal_px * share,
                    projector_focal_px: usual.projector_focal_px * share,
                    ..usual
                }
            }
        }
    }
}

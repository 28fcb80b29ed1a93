//! Options that make a scene harder than an object at rest in the middle, with nothing in front of the cameras.

use fringeflow_dataset::CameraId;

use super::{MotionOptions, SimulationError, check_range};

/// Position, size, surface and motion of the object, and obstacles in front of a camera. By default the object is in the
/// middle, in its original size and surface, at rest, and without obstacles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Staging {
    /// Shift of the object and the board under it from the middle of the measurement volume, in the frame of the
    /// volume, millimetres. Parts outside the volume are seen, but not measured.
    pub shift_mm: [f64; 3],
    /// The camera whose right half a dark flap covers.
    pub covered: Option<CameraId>,
    /// Share of the image of C1 that the object is scaled to fill, percent; `None` for its original size.
    pub share_percent: Option<f64>,
    /// Mean albedo of the object, where it is plaster; its other parts change by the same factor. `None` for 0.8.
    pub albedo: Option<f64>,
    /// Specular reflection of the object, as [`super::Material::gloss`].
    pub gloss: f64,
    /// Whether there is a hand between the cameras and the measurement volume.
    pub hand: bool,
    /// Motion of the object; `None` if it is at rest.
    pub motion: Option<MotionOptions>,
}

/// Largest shift along an axis, millimetres.
const MAX_SHIFT_MM: f64 = 150.0;
const MAX_ALBEDO: f64 = 1.0;
const MAX_GLOSS: f64 = 10.0;

impl Staging {
    pub(super) fn check(&self) -> Result<(), SimulationError> {
        let check = |&shift_mm: &f64| check_range("shift", shift_mm, -MAX_SHIFT_MM, MAX_SHIFT_MM, "mm");
        self.shift_mm.iter().try_for_each(check)?;
        check_range("the object's albedo", self.albedo.unwrap_or_default(), 0.0, MAX_ALBEDO, "")?;
        check_range("the object's gloss", self.gloss, 0.0, MAX_GLOSS, "")
    }

    /// Returns remarks for a description about this staging, as far as it differs from the default.
    pub(super) fn remarks(&self) -> impl Iterator<Item = (String, serde_json::Value)> {
        let shift = (self.shift_mm != [0.0; 3]).then(|| ("shift_mm".to_owned(), self.shift_mm.as_slice().into()));
        let covered = self.covered.map(|camera| ("covered".to_owned(), camera.folder().into()));
        let share = self.share_percent.map(|percent| ("share_percent".to_owned(), percent.into()));
        let albedo = self.albedo.map(|albedo| ("albedo".to_owned(), albedo.into()));
        let gloss = (self.gloss > 0.0).then(|| ("gloss".to_owned(), self.gloss.into()));
        let hand = self.hand.then(|| ("hand".to_owned(), true.into()));
        let blur = self.motion.filter(|motion| motion.blur > 0.0).map(|motion| ("blur".to_owned(), motion.blur.into()));
        shift.into_iter().chain(covered).chain(share).chain(albedo).chain(gloss).chain(hand).chain(blur)
    }
}

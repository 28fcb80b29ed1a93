//! Wrapped phase of a scene that moves while its images are taken.
//!
//! In: M = N + K images in order of time, equally spaced, with their phase shifts (K at least 1). Out: the [`PhaseMap`]
//! at the centre of the window, with its [`Motion`]. Cost per pixel: eight sums of M images instead of three of N, one
//! more for each image beyond six, and six operations for each of the M − 4 residuals; per cell of four pixels, two rounds of
//! motion compensation. (The paper, section 2.1, takes the scene to be at rest during a sequence.)
//!
//! ```text
//!  images ─► equalize brightness ─► fit A, z, z' at every pixel ─► motion ε of cells of 2 × 2 pixels
//!         ─► remove the ripple that ε causes from z ─► images of two surfaces: fit only those of one
//! ```
//!
//! Let ε be the phase motion per image. A plain N-step phase has a ripple of about ε/2 rad at twice the fringe
//! frequency. Binomial weights (arXiv 2404.06693; as sums of images arXiv 2507.10009) suppress the ripple to the order
//! of their length. The least-squares fit of a sinusoid whose phase and modulation change steadily uses the same
//! images. It suppresses the ripple to second order with less noise, and it measures ε. So the remaining ripple can be
//! removed exactly, up to motions of about 1 rad per image for N = 4.
//!
//! If the motion of the scene is known in advance ([`Flow`]), *follow* first samples the images along the motion, and
//! *fits by motion* adds the expected phase motion to the shifts. The motion that remains for the steps above is small.
//!
//! *band*: kernel over rows, made of *linear* (the fit), *cells* and *estimate* (the motion), *ripple* and *moving cells*
//! (what follows from it); *window*: all bands of an image; *one surface* and *solve*: pixels that are decoded again.

mod band;
mod brightness;
mod brightness_plan;
mod cells;
mod complement;
mod estimate;
mod fit;
mod fits_by_motion;
mod flow;
mod follow;
mod image_times;
mod images;
mod linear;
mod motion_histogram;
mod moving_cells;
mod one_surface;
mod ripple;
mod solve;
#[cfg(test)]
mod tests;
mod window;

use fringeflow_base::grey::GreyLevels;
use fringeflow_simd::Level;

use super::Validity;
use super::map::PhaseMap;

use images::Stack;
use window::Scene;

pub use fit::MotionFit;
pub use fits_by_motion::MotionFits;
pub use flow::{FLOW_TILE_PX, Flow, SurfaceMotion};
pub use window::MotionScratch;

/// Usual number of images beyond a cycle of N for motion compensation. With more, the scene has moved further.
///
/// With N = 4 and two more images, one degree of freedom per pixel remains to measure the fit; N = 3 needs three more.
#[must_use]
pub const fn usual_extra_images(steps: usize) -> usize {
    if steps == 3 { 3 } else { 2 }
}

/// Decodes the M images of one camera in order of time, each `width · height` grey levels row by row. The phase is that
/// at the centre of the window.
///
/// `None` if the number of images does not suit the fit, or an image has another size or depth.
#[must_use]
pub fn decode_moving(
    images: &[GreyLevels<'_>],
    width: usize,
    height: usize,
    fit: &MotionFit,
    validity: &Validity,
) -> Option<PhaseMap> {
    let mut map = PhaseMap::default();
    decode_moving_into(&mut map, &mut MotionScratch::default(), images, width, height, fit, validity)?;
    Some(map)
}

/// [`decode_moving`] into the memory of another map and with scratch memory, whose contents do not matter. The map
/// stays as it is if the result is `None`.
#[must_use]
pub fn decode_moving_into(
    map: &mut PhaseMap,
    scratch: &mut MotionScratch,
    images: &[GreyLevels<'_>],
    width: usize,
    height: usize,
    fit: &MotionFit,
    validity: &Validity,
) -> Option<()> {
    decode_at(Level::in_use(), map, scratch, images, [width, height], Scene::Unknown(fit), validity)
}

/// [`decode_moving_into`] for a scene whose motion is roughly known: each pixel follows its surface if that fits better
/// than staying in place.
#[must_use]
pub fn decode_following_into(
    map: &mut PhaseMap,
    scratch: &mut MotionScratch,
    images: &[GreyLevels<'_>],
    [width, height]: [usize; 2],
    (fits, flow): (&mut MotionFits, &Flow),
    validity: &Validity,
) -> Option<()> {
    if Flow::tile_counts([width, height]) != flow.size() {
        return None;
    }
    decode_at(Level::in_use(), map, scratch, images, [width, height], Scene::Followed(fits, flow), validity)
}

/// Decodes with the instructions of a SIMD level.
fn decode_at(
    level: Level,
    map: &mut PhaseMap,
    scratch: &mut MotionScratch,
    images: &[GreyLevels<'_>],
    [width, height]: [usize; 2],
    scene: Scene<'_>,
    validity: &Validity,
) -> Option<()> {
    if images.len() != scene.images() {
        return None;
    }
    match Stack::new(images, width, height, validity.saturation_grey)? {
        Stack::Bytes(images) => window::decode(level, images, scene, validity, scratch, map),
        Stack::Words(images) => window::decode(level, images, scene, validity, scratch, map),
    }
    Some(())
}

//! Wrapped phase of a scene that moves while its images are taken.
//!
//! In: M = N + K images in the order of their times, evenly spaced, with their shifts (K from 1). Out: the [`PhaseMap`] at
//! the centre of the window, with a [`Motion`] that says how the scene moved.
//!
//! ```text
//!  images ─► brightness of each image ─► fit of A, z, z' at every pixel ─► motion ε over 5 × 5 pixels
//!         ─► z without the ripple that ε makes ─► where images show two surfaces: only those that show one
//! ```
//!
//! A plain N-step phase ripples by about ε/2 rad at twice the fringe frequency, ε the phase moved an image. Binomial
//! weights (arXiv 2404.06693; as sums of images arXiv 2507.10009) suppress the ripple to the order of their length. The
//! least-squares fit of a sinusoid whose phase and modulation change steadily uses the same images, suppresses it to the
//! second order at less noise, and says what ε is: so what is left of the ripple is taken off exactly, up to motions of about
//! 1 rad an image for N = 4. Cost: seven sums of M images a pixel in the place of three of N, and three rounds of responses to the
//! motion of each pixel.
//!
//! Where it is known beforehand how the scene moves ([`Flow`]), *follow* samples the images along the way of what they show first,
//! and *fits* turns their shifts by as much as the phase is expected to grow: what is left for the steps above is small.
//!
//! *band*: rows one behind the other, by *linear* (the fit), *estimate* (the motion) and *moved* (what is left of z); *window*: what
//! takes all of them; *one surface* and *solve*: the pixels that are decoded again.

mod band;
mod brightness;
mod estimate;
mod fit;
mod fits;
mod flow;
mod follow;
mod images;
mod linear;
mod moved;
mod one_surface;
mod solve;
mod speeds;
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
pub use fits::MotionFits;
pub use flow::{FLOW_TILE_PX, Flow, SurfaceMotion};
pub use window::MotionScratch;

/// Images beyond a cycle of N that compensate motion well: more of them reach further into what has moved away.
///
/// Two leave one number a pixel that tells how well N = 4 images fit; N = 3 needs a third for it.
#[must_use]
pub const fn usual_extra_images(steps: usize) -> usize {
    if steps == 3 { 3 } else { 2 }
}

/// Decodes the M images of one camera in the order of their times, each `width · height` grey levels row by row, at the
/// centre of the window.
///
/// `None` if there are not as many images as the fit has shifts, or an image has another size or depth.
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

/// As [`decode_moving`], into a map whose memory is used again, as is the scratch memory; what they held makes no difference.
/// The map is left as it was where that yields `None`.
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

/// As [`decode_moving_into`], of a scene whose motion is known beforehand, as exactly as may be: each pixel follows its surface
/// where that fits better than staying where it is.
#[must_use]
pub fn decode_following_into(
    map: &mut PhaseMap,
    scratch: &mut MotionScratch,
    images: &[GreyLevels<'_>],
    [width, height]: [usize; 2],
    (fits, flow): (&mut MotionFits, &Flow),
    validity: &Validity,
) -> Option<()> {
    if Flow::tiles_of([width, height]) != flow.size() {
        return None;
    }
    decode_at(Level::in_use(), map, scratch, images, [width, height], Scene::Followed(fits, flow), validity)
}

/// Decodes at a level.
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

//! One camera's images of one pose of the board.

use fringeflow::geometry::Pixel;
use fringeflow_base::grey::GreyLevels;
use fringeflow_board::{Board, BoardImage, Detection, NotDetected, detect, detect_again};
use fringeflow_dataset::GreyImage;

use super::coordinates::Coordinates;
use super::order::{CodedFringes, PatternOrder, PatternOrderError};
use super::{edges, gains, patch};
use crate::median::median;
use crate::observations::{CameraView, Corner, PhasePatch};

/// Windows around a corner have at least this radius, pixels: enough for the coefficients of a quadratic.
const LEAST_RADIUS_PX: f64 = 5.0;
/// Share of their radii that two windows must be apart; below 1, so that rounding parts no neighbours.
const APART: f64 = 0.999;

/// What images show beyond their observations: signs of what may be wrong with them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageSigns {
    /// Amplitude of the second harmonic of the fringes, relative to the fundamental: (γ − 1)/(γ + 2) for a projector with
    /// exponent γ. `None` if the shifts do not determine it.
    pub second_harmonic_share: Option<f64>,
    /// Largest relative deviation of the brightness of a fringe image from the others.
    pub brightness_share: Option<f64>,
    /// Residual of the fit of the fringes, relative to their modulation.
    pub residual_share: Option<f64>,
    /// Share of the pixels with fringes whose Gray code fits their phase.
    pub coded_share: Option<f64>,
    /// Median shift of the corners from the first white image to the last, pixels; `None` with one white image.
    pub moved_px: Option<f64>,
    /// Median width of the edges of the board, pixels.
    pub edge_width_px: Option<f64>,
    /// Share of the lit pixels that are saturated in a fringe image.
    pub saturated_share: f64,
}

/// Why a camera's images of a pose are of no use.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoView {
    /// The board is not found.
    #[error(transparent)]
    Board(#[from] NotDetected),
    /// The patterns do not serve for calibration.
    #[error("patterns.toml {0}")]
    Patterns(#[from] PatternOrderError),
    /// Images have different sizes or depths.
    #[error("its images have different sizes or depths")]
    Sizes,
}

/// Finds the board, and around its corners the projector's coordinates. Without `order`, there is one image, of the board
/// alone.
///
/// # Errors
/// [`NoView`].
pub fn observe(
    board: &Board,
    images: &[GreyImage],
    order: Option<&PatternOrder>,
) -> Result<(CameraView, ImageSigns), NoView> {
    let first = images.first().ok_or(NoView::Sizes)?;
    let size_px = [first.width, first.height];
    if !images.iter().all(|image| [image.width, image.height] == size_px && image.format == first.format) {
        return Err(NoView::Sizes);
    }
    let coded = order.map(|order| order.directions()).transpose()?;
    let evenly_lit = match (order, &coded) {
        (Some(order), Some(coded)) => order.evenly_lit(coded),
        _ => vec![0],
    };
    let detections = detect(board, &mean_image(images, &evenly_lit).ok_or(NoView::Sizes)?)?;
    let corners: Vec<Corner> = detections.iter().map(corner).collect();
    let radii = radii_px(&corners);
    let lit = images[evenly_lit[0]].levels();
    let mut signs =
        ImageSigns { edge_width_px: edge_width_px(lit, size_px, &corners, &radii), ..ImageSigns::default() };
    let mut view = CameraView { corners, patches: Vec::new() };
    let (Some(order), Some(coded)) = (order, coded) else { return Ok((view, signs)) };
    signs.moved_px = moved_px(board, images, order, &detections);
    let [columns, rows] = coded.map(|coded| Coordinates::decode(images, order, coded));
    let directions = [columns.ok_or(NoView::Sizes)?, rows.ok_or(NoView::Sizes)?];
    signs.add_fringes(images, coded, &directions);
    view.patches = patches(&directions, size_px, &view.corners, &radii);
    Ok((view, signs))
}

impl PatternOrder {
    /// The images whose mean shows the board evenly lit: the shifted fringes of a period cancel.
    fn evenly_lit(&self, coded: &[&CodedFringes; 2]) -> Vec<usize> {
        let fringes = coded.iter().flat_map(|direction| direction.fringes.iter().copied());
        self.white.iter().copied().chain(fringes).collect()
    }
}

/// The mean of some images, in which noise is small.
fn mean_image(images: &[GreyImage], indices: &[usize]) -> Option<BoardImage> {
    let first = images.first()?;
    let levels: Vec<GreyLevels<'_>> = indices.iter().map(|&i| images[i].levels()).collect();
    let mean = |i: usize| levels.iter().map(|image| image.grey(i)).sum::<f32>() / levels.len() as f32;
    BoardImage::of_levels([first.width, first.height], (0..first.width * first.height).map(mean).collect())
}

fn corner(detection: &Detection) -> Corner {
    let [x, y] = detection.pixel;
    Corner { feature: detection.feature, pixel: Pixel::new(x, y), sd_px: detection.sd_px }
}

/// Half the distance from each corner to its nearest neighbour: windows that do not overlap.
fn radii_px(corners: &[Corner]) -> Vec<f64> {
    let nearest = |corner: &Corner| {
        let others = corners.iter().filter(|other| other.feature != corner.feature);
        others.map(|other| (other.pixel - corner.pixel).norm()).fold(f64::INFINITY, f64::min)
    };
    corners.iter().map(|corner| nearest(corner) / 2.0).collect()
}

fn edge_width_px(lit: GreyLevels<'_>, size_px: [usize; 2], corners: &[Corner], radii_px: &[f64]) -> Option<f64> {
    let widths = corners.iter().zip(radii_px);
    median(widths.filter_map(|(c, &r)| edges::width_px(lit, size_px, c.pixel, r)).collect())
}

/// Shift of the board between the first and the last white image, pixels. `detections` are those of the mean of all images.
fn moved_px(board: &Board, images: &[GreyImage], order: &PatternOrder, detections: &[Detection]) -> Option<f64> {
    let [first, .., last] = order.white[..] else { return None };
    let seen = |index: usize| detect_again(board, &mean_image(images, &[index])?, detections).ok();
    let (before, after) = (seen(first)?, seen(last)?);
    let shifts = before.iter().filter_map(|corner| {
        let same = after.iter().find(|other| other.feature == corner.feature)?;
        Some([0, 1].map(|axis| same.pixel[axis] - corner.pixel[axis]))
    });
    let shifts: Vec<_> = shifts.collect();
    // The board moves as a whole, so that the medians of both axes have hardly any noise.
    let axis = |k: usize| median(shifts.iter().map(|shift| shift[k]).collect());
    Some(axis(0)?.hypot(axis(1)?))
}

impl ImageSigns {
    fn add_fringes(&mut self, images: &[GreyImage], coded: [&CodedFringes; 2], directions: &[Coordinates; 2]) {
        let largest = |values: [Option<f64>; 2]| values.into_iter().flatten().reduce(f64::max);
        let of_both = |of: &dyn Fn(usize) -> Option<f64>| largest([of(0), of(1)]);
        self.second_harmonic_share = of_both(&|k| directions[k].phase.harmonics.second_share.map(f64::from));
        self.residual_share = of_both(&|k| directions[k].phase.fit.residual_share.map(f64::from));
        self.brightness_share = of_both(&|k| {
            let levels: Vec<_> = coded[k].fringes.iter().map(|&i| images[i].levels()).collect();
            gains::deviation_share(&levels, &directions[k].phase, coded[k].shifts.shifts_rad())
        });
        self.coded_share = directions.iter().map(Coordinates::coded_share).reduce(f64::min);
        let saturated = directions.iter().map(|d| d.phase.exposure);
        let shares = saturated.map(|e| e.saturated_pixels as f64 / e.lit_pixels.max(1) as f64);
        self.saturated_share = shares.fold(0.0, f64::max);
    }
}

/// Fits windows that do not overlap, so that their noise is independent: half the distance to the next corner, and of corners
/// that are too close for the least window one alone.
fn patches(
    directions: &[Coordinates; 2],
    size_px: [usize; 2],
    corners: &[Corner],
    radii_px: &[f64],
) -> Vec<PhasePatch> {
    let mut patches: Vec<PhasePatch> = Vec::new();
    for (corner, radius_px) in corners.iter().zip(radii_px) {
        let radius_px = radius_px.max(LEAST_RADIUS_PX);
        let overlaps =
            |patch: &PhasePatch| (patch.centre - corner.pixel).norm() < (patch.radius_px + radius_px) * APART;
        if !patches.iter().any(overlaps) {
            patches.extend(patch::fit(directions, size_px, corner.feature, corner.pixel, radius_px));
        }
    }
    patches
}

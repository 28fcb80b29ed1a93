//! Samples the images of a window along the known motion, so that a pixel shows the same surface point in all of them.
//!
//! In: images and a [`Flow`]. Out: sampled images and the fit of each tile. Cost: about six multiply-adds per sample,
//! and a fit of one row in eight.
//!
//! ```text
//!  flow ─► path and fit of each tile ─► images sampled along the path ─► paths that fit worse than at rest are dropped
//! ```
//!
//! A fixed pixel sees other surface points from image to image: texture, shading and edges pass through it. Along the
//! path of the surface they stay, and the phase grows by the motion through the fringes, which is known nearly as well.
//! If a surface moves so much with the fringes that its images hardly differ, only a part of its motion across the
//! fringes is followed.

mod judging;
mod path;
mod sampling;

use rayon::prelude::*;

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{LANES, Level};

use crate::phase::Validity;
use crate::phase::sample::Sample;

use super::fit::MotionFit;
use super::fits_by_motion::{Bin, MotionFits};
use super::flow::{FLOW_TILE_PX, Flow};
use super::image_times::time;
use super::images::Images;

use judging::{BlockGreys, Verdict, VerdictKernel, remove_wrong_paths};
use path::Path;
use sampling::Sampling;

const _: () = assert!(FLOW_TILE_PX == LANES, "a block of pixels lies in one tile");

/// Longest path on either side of the centre of a window, as a share of the image width. Faster surfaces leave the
/// image.
const LONGEST_SHARE: f32 = 0.25;

/// Scratch memory, mostly for the sampled images: as many bytes as the images themselves.
#[derive(Clone, Debug, Default)]
pub(super) struct FollowScratch {
    paths: Vec<Path>,
    samples: Vec<u8>,
    greys: Vec<BlockGreys>,
    verdicts: Vec<Verdict>,
}

/// The fit of each block of an image.
#[derive(Clone, Copy)]
pub(super) struct Fits<'a> {
    resting: &'a MotionFit,
    followed: Option<Followed<'a>>,
}

#[derive(Clone, Copy)]
struct Followed<'a> {
    fits: &'a MotionFits,
    columns: usize,
    paths: &'a [Path],
}

impl<'a> Fits<'a> {
    /// One fit for all blocks.
    pub(super) fn resting(fit: &'a MotionFit) -> Self {
        Self { resting: fit, followed: None }
    }

    /// A fit for properties that all fits share, such as the number of images and their times.
    pub(super) fn common(&self) -> &'a MotionFit {
        self.resting
    }

    /// The fit of a block, and the expected motion beyond that of the fit, rad per image.
    #[inline(always)]
    pub(super) fn for_block(&self, [row, block]: [usize; 2]) -> (&'a MotionFit, f32) {
        let Some(Followed { fits, columns, paths }) = self.followed else { return (self.resting, 0.0) };
        let path = &paths[row / FLOW_TILE_PX * columns + block];
        (fits.for_bin(path.bin), path.expected_rad)
    }

    /// Whether the path of a pixel (column, row) is inside the image at the time of `image`.
    pub(super) fn is_inside<S: Sample>(&self, images: &Images<'_, S>, image: usize, [u, v]: [usize; 2]) -> bool {
        let Some(Followed { columns, paths, .. }) = self.followed else { return true };
        let path = &paths[v / FLOW_TILE_PX * columns + u / FLOW_TILE_PX];
        let t = time(image, images.count) as f32;
        let [x, y] = path.velocity_px.map(|velocity| velocity * t);
        images.contains([(u as f32 + x, 1), (v as f32 + y, 1)])
    }

    /// Motion followed by the samples of a block, rad per image.
    #[inline(always)]
    pub(super) fn followed_rad(&self, [row, block]: [usize; 2]) -> f32 {
        let Some(Followed { columns, paths, .. }) = self.followed else { return 0.0 };
        paths[row / FLOW_TILE_PX * columns + block].bin.map_or(0.0, Bin::motion_rad)
    }

    /// Mean noise gain of the fits.
    pub(super) fn noise_gain(&self) -> f32 {
        let Some(Followed { fits, paths, .. }) = self.followed else { return self.resting.noise_gain() };
        let sum: f64 = paths.iter().map(|path| f64::from(fits.for_bin(path.bin).noise_gain())).sum();
        (sum / paths.len().max(1) as f64) as f32
    }
}

/// Samples images along the flow. Returns the sampled images and their fits; `None` if no tile is followed.
pub(super) fn follow<'a, S: Sample>(
    level: Level,
    images: &Images<'_, S>,
    flow: &Flow,
    fits: &'a mut MotionFits,
    validity: &Validity,
    scratch: &'a mut FollowScratch,
) -> Option<(Images<'a, S>, Fits<'a>)> {
    let FollowScratch { paths, samples, greys, verdicts } = scratch;
    let (columns, width) = (flow.columns(), images.width);
    let longest_px = LONGEST_SHARE * width as f32;
    paths.clear();
    paths.extend(flow.tiles().iter().map(|tile| Path::new(tile, longest_px, fits)));
    let is_followed = |paths: &[Path]| paths.iter().any(|path| path.bin.is_some());
    if !is_followed(paths) {
        return None;
    }
    let fits = &*fits;
    let tile_rows = paths.len().div_ceil(columns.max(1));
    // Planes of whole rows of tiles, so that every image has the same number of pieces.
    let (piece, plane) = (FLOW_TILE_PX * width, tile_rows * FLOW_TILE_PX * width);
    samples.resize(images.count * plane * size_of::<S>(), 0);
    let sampled: &mut [S] = bytemuck::cast_slice_mut(samples);
    let sample_tiles = |sampled: &mut [S], paths: &[Path], followed: bool| {
        sampled.par_chunks_mut(piece).enumerate().for_each(|(place, to)| {
            let (image, tile_row) = (place / tile_rows, place % tile_rows);
            let paths = &paths[tile_row * columns..][..columns];
            fringeflow_simd::run(level, Sampling { images, paths, image, tile_row, followed, to });
        });
    };
    sample_tiles(sampled, paths, true);
    greys.resize(tile_rows, [[0.0; LANES]; MAX_IMAGES]);
    let followed = images.with_samples(sampled, plane);
    verdicts.clear();
    verdicts.resize(paths.len(), Verdict::default());
    let of_rows = paths.par_chunks(columns).zip(verdicts.par_chunks_mut(columns)).zip(greys);
    of_rows.enumerate().for_each(|(tile_row, ((paths, verdicts), greys))| {
        fringeflow_simd::run(
            level,
            VerdictKernel { images: [images, &followed], fits, validity, tile_row, paths, verdicts, greys },
        );
    });
    remove_wrong_paths(paths, verdicts, columns);
    if !is_followed(paths) {
        return None;
    }
    // Tiles that are not followed are copied unchanged.
    sample_tiles(sampled, paths, false);
    let followed = Some(Followed { fits, columns, paths });
    Some((images.with_samples(sampled, plane), Fits { resting: fits.resting(), followed }))
}

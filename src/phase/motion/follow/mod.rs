//! Images sampled along the way of what they show, so that a pixel sees the same place of a surface in all of them.
//!
//! ```text
//!  flow ─► way and fit of each tile ─► images sampled along it ─► tiles whose samples fit worse than at rest: left as they were
//! ```
//!
//! At rest a pixel sees other places of the surface from image to image: texture, shading and edges pass through it. Along the way
//! of the surface they stay, and the phase grows by what the surface moves through the fringes, which is known nearly as well.
//! Where it moves so much with the fringes that its images hardly differ, a part of the way across them is followed.

mod judging;
mod sampling;

use rayon::prelude::*;

use fringeflow_simd::{LANES, Level};

use crate::phase::Validity;
use crate::phase::sample::Sample;

use super::fit::{MotionFit, time};
use super::fits::{Bin, MotionFits};
use super::flow::{FLOW_TILE_PX, Flow, SurfaceMotion};
use super::images::Images;

use judging::{JudgeScratch, Judging, Verdict, judge};
use sampling::Sampling;

const _: () = assert!(FLOW_TILE_PX == LANES, "a block of pixels lies in one tile");

/// Shares of the way across the fringes that are tried, the largest first; the way along them is followed whole.
const SHARES: [f32; 5] = [1.0, 0.75, 0.5, 0.25, 0.0];
/// Longest way to either side of the centre of a window, as a share of the image's width: no surface stays in the image for more.
const LONGEST_SHARE: f32 = 0.25;
/// Memory for the sampled images: as many bytes as they have.
#[derive(Clone, Debug, Default)]
pub(super) struct FollowScratch {
    paths: Vec<Path>,
    samples: Vec<u8>,
    rows: Vec<JudgeScratch>,
    verdicts: Vec<Verdict>,
}

/// The way of a tile, and the fit it is decoded with.
#[derive(Clone, Copy, Debug, Default)]
struct Path {
    velocity_px: [f32; 2],
    bin: Option<Bin>,
    /// Motion that is expected on top of the one of the fit, rad an image.
    expected_rad: f32,
}

/// How the blocks of an image are decoded: each with the fit of its tile.
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
    /// One fit for all.
    pub(super) fn resting(fit: &'a MotionFit) -> Self {
        Self { resting: fit, followed: None }
    }

    /// What holds of all: images and what follows from their number.
    pub(super) fn any(&self) -> &'a MotionFit {
        self.resting
    }

    /// The fit of a block, and the motion that is expected on top of it, rad an image.
    #[inline(always)]
    pub(super) fn of(&self, [row, block]: [usize; 2]) -> (&'a MotionFit, f32) {
        let Some(Followed { fits, columns, paths }) = self.followed else { return (self.resting, 0.0) };
        let path = &paths[row / FLOW_TILE_PX * columns + block];
        (fits.of(path.bin), path.expected_rad)
    }

    /// Whether the image holds the sample that a pixel (column, row) has in it.
    pub(super) fn holds<S: Sample>(&self, images: &Images<'_, S>, image: usize, [u, v]: [usize; 2]) -> bool {
        let Some(Followed { columns, paths, .. }) = self.followed else { return true };
        let path = &paths[v / FLOW_TILE_PX * columns + u / FLOW_TILE_PX];
        let t = time(image, images.count) as f32;
        let [x, y] = path.velocity_px.map(|velocity| velocity * t);
        images.holds([(u as f32 + x, 1), (v as f32 + y, 1)])
    }

    /// The motion that the samples of a block follow, rad an image.
    #[inline(always)]
    pub(super) fn followed_rad(&self, [row, block]: [usize; 2]) -> f32 {
        let Some(Followed { columns, paths, .. }) = self.followed else { return 0.0 };
        paths[row / FLOW_TILE_PX * columns + block].bin.map_or(0.0, Bin::motion_rad)
    }

    /// Mean of what the fits make of noise.
    pub(super) fn noise_gain(&self) -> f32 {
        let Some(Followed { fits, paths, .. }) = self.followed else { return self.resting.noise_gain() };
        let sum: f64 = paths.iter().map(|path| f64::from(fits.of(path.bin).noise_gain())).sum();
        (sum / paths.len().max(1) as f64) as f32
    }
}

/// Samples images along the way of what they show; the samples, and how they are decoded. `None` where nothing is followed.
pub(super) fn follow<'a, S: Sample>(
    level: Level,
    images: &Images<'_, S>,
    flow: &Flow,
    fits: &'a mut MotionFits,
    validity: &Validity,
    scratch: &'a mut FollowScratch,
) -> Option<(Images<'a, S>, Fits<'a>)> {
    let FollowScratch { paths, samples, rows, verdicts } = scratch;
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
    // Planes of whole rows of tiles, so that each image has as many pieces.
    let (piece, plane) = (FLOW_TILE_PX * width, tile_rows * FLOW_TILE_PX * width);
    samples.resize(images.count * plane * size_of::<S>(), 0);
    let sampled: &mut [S] = bytemuck::cast_slice_mut(samples);
    let each = |sampled: &mut [S], paths: &[Path], followed: bool| {
        sampled.par_chunks_mut(piece).enumerate().for_each(|(place, to)| {
            let (image, tile_row) = (place / tile_rows, place % tile_rows);
            let paths = &paths[tile_row * columns..][..columns];
            fringeflow_simd::run(level, Sampling { images, paths, image, tile_row, followed, to });
        });
    };
    each(sampled, paths, true);
    rows.resize_with(tile_rows, JudgeScratch::default);
    let followed = images.others(sampled, plane);
    verdicts.clear();
    verdicts.resize(paths.len(), Verdict::default());
    let of_rows = paths.par_chunks(columns).zip(verdicts.par_chunks_mut(columns)).zip(rows);
    of_rows.enumerate().for_each(|(tile_row, ((paths, verdicts), scratch))| {
        fringeflow_simd::run(
            level,
            Judging { images: [images, &followed], fits, validity, tile_row, paths, verdicts, scratch },
        );
    });
    judge(paths, verdicts, columns);
    if !is_followed(paths) {
        return None;
    }
    each(sampled, paths, false);
    let followed = Some(Followed { fits, columns, paths });
    Some((images.others(sampled, plane), Fits { resting: fits.resting(), followed }))
}

impl Path {
    /// As much of a way as the images tell phases along.
    fn new(tile: &SurfaceMotion, longest_px: f32, fits: &mut MotionFits) -> Self {
        let SurfaceMotion { velocity_px, motion_rad } = *tile;
        let half = 0.5 * fits.resting().images() as f32;
        let is_short = velocity_px.iter().all(|v| v.abs() * half <= longest_px);
        let along = |share: f32| {
            let bin = fits.bin_for(share * motion_rad)?;
            let expected_rad = share * motion_rad - bin.motion_rad();
            let [across, along] = velocity_px;
            Some(Self { velocity_px: [share * across, along], bin: Some(bin), expected_rad })
        };
        SHARES.into_iter().filter(|_| is_short).find_map(along).unwrap_or_default()
    }
}

//! Images sampled along the way of what they show, so that a pixel sees the same place of a surface in all of them.
//!
//! ```text
//!  flow ─► way and fit of each tile ─► images sampled along it ─► tiles whose samples fit worse than at rest: left as they were
//! ```
//!
//! At rest a pixel sees other places of the surface from image to image: texture, shading and edges pass through it. Along the way
//! of the surface they stay, and the phase grows by what the surface moves through the fringes, which is known nearly as well.
//! Where it moves so much with the fringes that its images hardly differ, a part of the way is followed.

use rayon::prelude::*;

use crate::phase::Validity;
use crate::phase::sample::Sample;
use crate::simd::{self, Kernel, LANES, Lanes, Level};

use super::MAX_IMAGES;
use super::fit::{MotionFit, time};
use super::fits::{Bin, MotionFits};
use super::flow::{FLOW_TILE_PX, Flow, SurfaceMotion};
use super::images::Images;
use super::linear::Fitted;

const _: () = assert!(FLOW_TILE_PX == LANES, "a block of pixels lies in one tile");

/// Shares of the way that are tried, the largest first.
const SHARES: [f32; 4] = [1.0, 0.75, 0.5, 0.25];
/// Longest way to either side of the centre of a window, as a share of the image's width: no surface stays in the image for more.
const LONGEST_SHARE: f32 = 0.25;
/// Rows of a tile by which it is judged: the first, and how far apart.
const JUDGED: [usize; 2] = [3, 8];
/// How much worse than at rest samples along the way may fit: as much as by chance.
const MIN_FIT_SHARE: f32 = 0.8;

/// Pixels either side of a sample that horizontal interpolation takes.
const TAPS: usize = 4;

/// Memory for the sampled images: as many bytes as they have.
#[derive(Clone, Debug, Default)]
pub(super) struct FollowRoom {
    paths: Vec<Path>,
    samples: Vec<u8>,
    rows: Vec<JudgeRoom>,
}

/// The way of a tile, and the fit it is decoded with.
#[derive(Clone, Copy, Debug, Default)]
struct Path {
    velocity_px: [f32; 2],
    bin: Option<Bin>,
    /// Motion that is expected on top of the one of the fit, rad an image.
    expected_rad: f32,
}

/// What judges the tiles of a row.
#[derive(Clone, Debug)]
struct JudgeRoom {
    fitted: Box<Fitted>,
    greys: Box<[[f32; LANES]; MAX_IMAGES]>,
}

impl Default for JudgeRoom {
    fn default() -> Self {
        Self { fitted: Box::default(), greys: Box::new([[0.0; LANES]; MAX_IMAGES]) }
    }
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

/// Samples images along the way of what they show; the samples, and how they are decoded.
pub(super) fn follow<'a, S: Sample>(
    level: Level,
    images: &Images<'_, S>,
    flow: &Flow,
    fits: &'a mut MotionFits,
    validity: &Validity,
    room: &'a mut FollowRoom,
) -> (Images<'a, S>, Fits<'a>) {
    let FollowRoom { paths, samples, rows } = room;
    let (columns, width) = (flow.columns(), images.width);
    let longest_px = LONGEST_SHARE * width as f32;
    paths.clear();
    paths.extend(flow.tiles().iter().map(|tile| Path::of(tile, longest_px, fits)));
    let fits = &*fits;
    let tile_rows = paths.len().div_ceil(columns.max(1));
    // Planes of whole rows of tiles, so that each image has as many pieces.
    let (piece, plane) = (FLOW_TILE_PX * width, tile_rows * FLOW_TILE_PX * width);
    samples.resize(images.count * plane * size_of::<S>(), 0);
    let sampled: &mut [S] = bytemuck::cast_slice_mut(samples);
    let is_moving = paths.iter().any(|path| path.bin.is_some());
    let each = |sampled: &mut [S], paths: &[Path], wanted: Wanted| {
        sampled.par_chunks_mut(piece).enumerate().for_each(|(place, to)| {
            let (image, tile_row) = (place / tile_rows, place % tile_rows);
            let paths = &paths[tile_row * columns..][..columns];
            simd::run(level, Sampling { images, paths, image, tile_row, wanted, to });
        });
    };
    each(sampled, paths, Wanted::Ways);
    if is_moving {
        rows.resize_with(tile_rows, JudgeRoom::default);
        let followed = images.others(sampled, plane);
        paths.par_chunks_mut(columns).zip(rows).enumerate().for_each(|(tile_row, (paths, room))| {
            simd::run(level, Judging { images: [images, &followed], fits, validity, tile_row, paths, room });
        });
        each(sampled, paths, Wanted::Left);
    }
    (images.others(sampled, plane), Fits { resting: fits.resting(), followed: Some(Followed { fits, columns, paths }) })
}

impl Path {
    /// As much of a way as the images tell phases along.
    fn of(tile: &SurfaceMotion, longest_px: f32, fits: &mut MotionFits) -> Self {
        let SurfaceMotion { velocity_px, motion_rad } = *tile;
        let half = 0.5 * fits.resting().images() as f32;
        let is_short = velocity_px.iter().all(|v| v.abs() * half <= longest_px);
        let along = |share: f32| {
            let bin = fits.bin_for(share * motion_rad)?;
            let expected_rad = share * motion_rad - bin.motion_rad();
            Some(Self { velocity_px: velocity_px.map(|v| share * v), bin: Some(bin), expected_rad })
        };
        SHARES.into_iter().filter(|_| is_short).find_map(along).unwrap_or_default()
    }
}

/// Which tiles are sampled.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wanted {
    /// All, along their ways.
    Ways,
    /// Those that have no way any more, as they are.
    Left,
}

/// Samples an image in a row of tiles.
struct Sampling<'a, 'b, S> {
    images: &'a Images<'b, S>,
    paths: &'a [Path],
    image: usize,
    tile_row: usize,
    wanted: Wanted,
    to: &'a mut [S],
}

impl<S: Sample> Kernel for Sampling<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { images, paths, image, tile_row, wanted, to } = self;
        let first = tile_row * FLOW_TILE_PX;
        let rows = first..(first + FLOW_TILE_PX).min(images.height);
        let t = time(image, images.count) as f32;
        for (block, path) in paths.iter().enumerate() {
            if wanted == Wanted::Left && path.bin.is_some() {
                continue;
            }
            let (begin, count) = (block * LANES, (images.width - block * LANES).min(LANES));
            let [x, y] = path.velocity_px.map(|v| v * t);
            let [left, above] = [x.floor(), y.floor()];
            let across = cubic(x - left);
            let down = [1.0 - (y - above), y - above];
            let is_still = x == 0.0 && y == 0.0;
            for row in rows.clone() {
                let to = &mut to[(row - first) * images.width + begin..][..count];
                if is_still {
                    to.copy_from_slice(&images.samples_from(image, row * images.width + begin)[..count]);
                    continue;
                }
                let last = images.height as isize - 1;
                let mut taps = [[S::default(); LANES + TAPS - 1]; 2];
                for (k, taps) in taps.iter_mut().enumerate() {
                    let from = (row as isize + above as isize + k as isize).clamp(0, last) as usize;
                    *taps = around(images.row(image, from), begin as isize + left as isize - 1);
                }
                let sampled = between(lanes, images, &taps, across, down);
                to.copy_from_slice(&sampled[..count]);
            }
        }
    }
}

/// Samples of a row from a column on; beyond its ends those at the ends.
#[inline(always)]
fn around<S: Sample>(row: &[S], column: isize) -> [S; LANES + TAPS - 1] {
    if let Some(all) = usize::try_from(column).ok().and_then(|column| row.get(column..)?.first_chunk()) {
        return *all;
    }
    let last = row.len() as isize - 1;
    std::array::from_fn(|k| row[(column + k as isize).clamp(0, last) as usize])
}

/// Weights of four samples for a place at a share of the way between the middle ones (Catmull and Rom).
fn cubic(share: f32) -> [f32; TAPS] {
    let [x, x2, x3] = [share, share * share, share * share * share];
    [0.5 * (2.0 * x2 - x - x3), 0.5 * (2.0 - 5.0 * x2 + 3.0 * x3), 0.5 * (x + 4.0 * x2 - 3.0 * x3), 0.5 * (x3 - x2)]
}

/// Least weight of a saturated sample that makes what it is part of one: less clips no more than noise.
const SATURATING_WEIGHT: f32 = 0.1;

/// Samples between those of two rows; saturated where any of these is that counts.
#[inline(always)]
fn between<L: Lanes, S: Sample>(
    lanes: L,
    images: &Images<'_, S>,
    taps: &[[S; LANES + TAPS - 1]; 2],
    across: [f32; TAPS],
    down: [f32; 2],
) -> [S; LANES] {
    let l = lanes;
    let (mut sum, mut greatest) = (l.real(0.0), l.word(0));
    for (taps, down) in taps.iter().zip(down) {
        let mut of_row = l.real(0.0);
        let mut k = 0;
        while k < TAPS {
            if let Some(samples) = taps[k..].first_chunk() {
                if across[k] * down >= SATURATING_WEIGHT {
                    greatest = l.max_unsigned(greatest, S::unsigned(l, S::words(l, samples)));
                }
                of_row = l.add_real(of_row, l.times_real(l.real(across[k]), S::reals(l, samples)));
            }
            k += 1;
        }
        sum = l.add_real(sum, l.times_real(l.real(down), of_row));
    }
    let saturation = f32::from(images.saturation());
    let rounded = l.max_real(l.add_real(sum, l.real(0.5)), l.real(0.0));
    let unsaturated = l.min_real(rounded, l.real(saturation - 1.0));
    S::of_reals(l, l.select_real(images.saturates(l, greatest), l.real(saturation), unsaturated))
}

/// Judges the tiles of a row: whether samples along their ways fit as well as those at rest.
struct Judging<'a, 'b, S> {
    images: [&'a Images<'b, S>; 2],
    fits: &'a MotionFits,
    validity: &'a Validity,
    tile_row: usize,
    paths: &'a mut [Path],
    room: &'a mut JudgeRoom,
}

impl<S: Sample> Kernel for Judging<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { images: [resting, followed], fits, validity, tile_row, paths, room } = self;
        let [first, step] = JUDGED;
        for (block, path) in paths.iter_mut().enumerate().filter(|(_, path)| path.bin.is_some()) {
            let count = (resting.width - block * LANES).min(LANES);
            let end = ((tile_row + 1) * FLOW_TILE_PX).min(resting.height);
            let mut weights = [0.0; 2];
            for row in (tile_row * FLOW_TILE_PX + first..end).step_by(step) {
                let place = [row * resting.width + block * LANES, count];
                let both = [(resting, fits.resting()), (followed, fits.of(path.bin))];
                for (sum, (images, fit)) in weights.iter_mut().zip(both) {
                    room.fitted.fit(lanes, images, fit, validity, place, &mut room.greys);
                    *sum += room.fitted.weight.iter().sum::<f32>();
                }
            }
            if weights[1] < MIN_FIT_SHARE * weights[0] {
                *path = Path::default();
            }
        }
    }
}

//! Decodes a window of a moving scene. In: images. Out: a phase map. Cost: see [`super`].
//!
//! ```text
//! equalize the brightness of the images
//! for each band of rows, in parallel: fit, motion, phase                 band
//! statistics of all bands: the usual residual
//! for each band of rows, in parallel: decode suspicious pixels again     one_surface
//! counts and harmonics
//! ```

use std::ops::Range;

use rayon::prelude::*;

use fringeflow_simd::{LANES, Level};

use crate::phase::Validity;
use crate::phase::harmonics::{self, Samples};
use crate::phase::map::{FitStatistics, Harmonics, Motion, PhaseMap};
use crate::phase::residuals::Residuals;
use crate::phase::sample::Sample;

use super::band::{Band, BandScratch, CellFits, Planes};
use super::brightness::{BrightnessSums, compensate};
use super::cells::{CELL, STRIP_ROWS};
use super::fit::MotionFit;
use super::fits_by_motion::MotionFits;
use super::flow::Flow;
use super::follow::{Fits, FollowScratch, follow};
use super::image_times::time;
use super::images::Images;
use super::motion_histogram::MotionHistogram;
use super::one_surface::{OneSurface, Repair, RepairScratch, Repaired};

/// Fewest rows of a band. Each band fits four surrounding rows again that its neighbours fit too.
const LEAST_ROWS: usize = 64;

/// Scratch memory: about three bytes per pixel and some rows per thread. With a flow, the size of the images in
/// addition.
#[derive(Clone, Debug, Default)]
pub struct MotionScratch {
    brightness: Vec<BrightnessSums>,
    follow: FollowScratch,
    cell_fits: Vec<CellFits>,
    bands: Vec<(BandScratch, RepairScratch)>,
    samples: Samples,
}

/// Prior knowledge about the scene.
pub(super) enum Scene<'a> {
    /// Nothing.
    Unknown(&'a MotionFit),
    /// Its motion.
    Followed(&'a mut MotionFits, &'a Flow),
}

impl Scene<'_> {
    /// Number of images of the window.
    pub(super) fn images(&self) -> usize {
        match self {
            Self::Unknown(fit) => fit.images(),
            Self::Followed(fits, _) => fits.resting().images(),
        }
    }
}

/// Decodes a window with the instructions of a SIMD level.
pub(super) fn decode<S: Sample>(
    level: Level,
    images: Images<'_, S>,
    scene: Scene<'_>,
    validity: &Validity,
    scratch: &mut MotionScratch,
    map: &mut PhaseMap,
) {
    match scene {
        Scene::Unknown(fit) => decode_sampled(level, images, Fits::resting(fit), validity, scratch, map),
        Scene::Followed(fits, flow) => {
            let mut follow_scratch = std::mem::take(&mut scratch.follow);
            match follow(level, &images, flow, fits, validity, &mut follow_scratch) {
                Some((images, fits)) => decode_sampled(level, images, fits, validity, scratch, map),
                None => decode_sampled(level, images, Fits::resting(fits.resting()), validity, scratch, map),
            }
            scratch.follow = follow_scratch;
        }
    }
}

/// Decodes images after sampling.
fn decode_sampled<S: Sample>(
    level: Level,
    mut images: Images<'_, S>,
    fits: Fits<'_>,
    validity: &Validity,
    scratch: &mut MotionScratch,
    map: &mut PhaseMap,
) {
    let (width, height) = (images.width, images.height);
    map.resize(width, height);
    let brightness_share = compensate(level, &mut images, fits, validity, &mut scratch.brightness);
    let images = &images;
    let rows = rows_of_band(height);
    // Whole strips.
    let cell_rows = height.next_multiple_of(STRIP_ROWS) / CELL;
    scratch.cell_fits.resize_with(cell_rows * width.div_ceil(LANES), CellFits::default);
    scratch.bands.resize_with(height.div_ceil(rows), Default::default);
    bands(map, scratch, rows).for_each(|(rows, planes, (scratch, _))| {
        fringeflow_simd::run(level, Band { images, fits, validity, rows, scratch, planes });
    });
    let (mut residuals, mut motions) = (Residuals::default(), MotionHistogram::default());
    for (band, _) in &scratch.bands {
        residuals.merge(&band.residuals);
        motions.merge(&band.motions);
    }
    let statistics = residuals.statistics(fits.common().freedom(), images.format, fits.noise_gain());
    let one_surface = OneSurface::new(images, fits, validity, &statistics);
    bands(map, scratch, rows).for_each(|(rows, planes, (_, scratch))| {
        fringeflow_simd::run(level, Repair { one_surface: &one_surface, rows, scratch, planes });
    });
    let mut all = Repaired::default();
    scratch.bands.iter().for_each(|(_, band)| all.merge(&band.repaired));
    motions.merge(&all.motions);
    let [median_rad, fast_rad] = motions.median_and_fast_rad();
    let Repaired { one_surface_pixels, lost_pixels, valid_pixels, exposure, .. } = all;
    map.exposure = exposure;
    map.harmonics = harmonics(images, fits.common(), map, &scratch.cell_fits, &mut scratch.samples);
    map.fit = FitStatistics { valid_pixels, ..statistics };
    map.motion = Some(Motion { median_rad, fast_rad, brightness_share, one_surface_pixels, lost_pixels });
}

/// Rows of a band: one band for a single thread, otherwise two bands per thread, so that no thread waits long for the
/// last.
fn rows_of_band(height: usize) -> usize {
    let threads = rayon::current_num_threads();
    let bands = if threads > 1 { 2 * threads } else { 1 };
    height.div_ceil(bands).max(LEAST_ROWS).next_multiple_of(STRIP_ROWS)
}

/// All bands of `rows` rows, each with its planes and its scratch memory.
fn bands<'a>(
    map: &'a mut PhaseMap,
    scratch: &'a mut MotionScratch,
    rows: usize,
) -> impl IndexedParallelIterator<Item = (Range<usize>, Planes<'a>, &'a mut (BandScratch, RepairScratch))> {
    let (width, height) = (map.width.max(1), map.height);
    let pixels = rows * width;
    let planes = (
        map.phase.par_chunks_mut(pixels),
        map.modulation.par_chunks_mut(pixels),
        map.mean.par_chunks_mut(pixels),
        map.valid.par_chunks_mut(pixels),
        scratch.cell_fits.par_chunks_mut(rows / CELL * width.div_ceil(LANES)),
        &mut scratch.bands,
    );
    planes.into_par_iter().enumerate().map(move |(band, planes)| {
        let (phase, modulation, mean, valid, cell_fits, scratch) = planes;
        let rows = band * rows..((band + 1) * rows).min(height);
        (rows, Planes { phase, modulation, mean, valid, cell_fits }, scratch)
    })
}

/// The harmonics of the fringes, without the effect of motion.
fn harmonics<S: Sample>(
    images: &Images<'_, S>,
    fit: &MotionFit,
    map: &PhaseMap,
    cell_fits: &[CellFits],
    scratch: &mut Samples,
) -> Harmonics {
    let (shifts, blocks) = (fit.shifts_rad(), images.width.div_ceil(LANES));
    harmonics::measure(shifts, images.width * images.height, scratch, |pixel, out: &mut Samples| {
        let (row, u) = (pixel / images.width, pixel % images.width);
        let fits = &cell_fits[row / CELL * blocks + u / LANES];
        let motion_rad = f64::from(fits.motion_rad(u));
        if !map.valid[pixel] || !motion_rad.is_finite() || fits.saturated(row) >> (u % LANES) & 1 == 1 {
            return false;
        }
        let sample = |image: usize| {
            let t = time(image, images.count);
            [f64::from(images.grey(image, pixel)), shifts[image] + motion_rad * t, t]
        };
        out.extend((0..images.count).map(sample));
        true
    })
}

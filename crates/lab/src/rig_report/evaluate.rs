//! Evaluates a rig over a grid of pixels, row by row.

use nalgebra::Vector2;
use rayon::prelude::*;
use serde::Serialize;

use fringeflow::geometry::Pixel;
use fringeflow_base::false_candidates::{expected_false_candidates, expected_unique_percent};

use super::comb::{self, Cases, Comb, Tally};
use super::deviation::{self, Deviation, PixelDeviation};
use super::segment::{self, Periods, Segment, SegmentPeriods};
use super::surface::Surface;
use super::{Assumptions, RigReportError, RigSetup};

/// Maximum number of fringe orders on each side in the comb.
const MAX_ORDERS: f64 = 40.0;

/// A value per pixel of the grid, row by row; `None` if there is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PixelMap {
    /// Pixels of the grid in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The figures.
    pub values: Vec<Option<f64>>,
}

/// Expected behaviour of the method on a rig.
#[derive(Clone, Debug, Serialize)]
pub struct Evaluation {
    /// Spacing of the grid, pixels of C1.
    pub grid_step_px: usize,
    /// Fringe periods on a segment.
    pub periods: Periods,
    /// Standard deviation of δ.
    pub deviation: Deviation,
    /// Expected false candidates per true one on arbitrary surfaces, 3·sd·(n − 1)/π (paper, Eq. 1).
    pub efc: f64,
    /// Expected percentage of unique correspondences (paper, 2.2.1).
    pub puc_percent: f64,
    /// Wrong fringe orders that survive on flat surfaces.
    pub comb: Comb,
    /// Periods n over the grid.
    #[serde(skip)]
    pub periods_map: PixelMap,
    /// Surviving wrong candidates per true one on flat surfaces, over the grid.
    #[serde(skip)]
    pub survivors_map: PixelMap,
}

/// The figures for comparing rigs.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Figures {
    /// Mean number of periods on a segment.
    pub n: f64,
    /// Standard deviation of δ, rad.
    pub sd_rad: f64,
    /// Expected false candidates per true one (paper, Eq. 1).
    pub efc: f64,
    /// Surviving wrong candidates per true one on flat surfaces.
    pub survivors: f64,
    /// Standard deviation of the depth caused by camera noise, metres.
    pub depth_sd_m: f64,
}

impl Evaluation {
    /// The figures for comparison.
    #[must_use]
    pub fn figures(&self) -> Figures {
        Figures {
            n: self.periods.mean,
            sd_rad: self.deviation.sd_rad,
            efc: self.efc,
            survivors: self.comb.survivors,
            depth_sd_m: self.deviation.depth_sd_m,
        }
    }
}

/// Figures of a pixel that do not depend on the threshold.
type PixelBasics = (Option<Segment>, Option<SegmentPeriods>, Option<PixelDeviation>);

/// Evaluates a rig over every `grid_step_px`-th pixel.
pub(super) fn evaluate(
    setup: &RigSetup,
    assumptions: &Assumptions,
    grid_step_px: usize,
) -> Result<Evaluation, RigReportError> {
    let nothing = RigReportError::NoSegments { grid_step_px };
    let surface = Surface::facing(setup, setup.centre_cam1());
    let grid = segment::grid(&setup.rig.cam1, grid_step_px);
    let basics = by_row(&grid, |pixel| basics(setup, assumptions, &surface, pixel));
    let periods = segment::summary(&basics.iter().filter_map(|b| b.1).collect::<Vec<_>>()).ok_or(nothing)?;
    let deviations: Vec<_> = basics.iter().filter_map(|b| b.2).collect();
    let deviation = deviation::summary(assumptions, &deviations).ok_or(nothing)?;

    let max_order = periods.max.max(periods.orders_spanned_max).ceil().clamp(1.0, MAX_ORDERS) as i32;
    let cases = Cases::new(setup, deviation.threshold_rad, max_order);
    let along = epipolar_direction(setup) * comb::SLOPE_DISTANCE_PX;
    let rows = grid.iter().zip(basics.chunks(grid[0].len()));
    let cells: Vec<Vec<(Pixel, Option<Segment>)>> =
        rows.map(|(row, basics)| row.iter().copied().zip(basics.iter().map(|b| b.0)).collect()).collect();
    let tallies = by_row(&cells, |(pixel, segment)| {
        let segment = segment.as_ref()?;
        Some(cases.pixel_tally(segment, Segment::new(setup, &(pixel + along)).as_ref()))
    });
    let mut total = Tally::new(max_order);
    tallies.iter().flatten().for_each(|tally| total += tally);
    let comb = comb::summary(&total, setup.rig.projector_place_on_base()).ok_or(nothing)?;

    let map = |values| PixelMap { width: grid[0].len(), height: grid.len(), values };
    let efc = expected_false_candidates(deviation.sd_rad, periods.mean);
    Ok(Evaluation {
        grid_step_px,
        efc,
        puc_percent: expected_unique_percent(efc),
        periods_map: map(basics.iter().map(|b| b.1.map(|p| p.seen)).collect()),
        survivors_map: map(tallies.iter().map(|t| t.as_ref().and_then(Tally::survivors)).collect()),
        periods,
        deviation,
        comb,
    })
}

/// Direction of the epipolar lines in the middle of C1, a unit vector of pixels.
fn epipolar_direction(setup: &RigSetup) -> Vector2<f64> {
    let centre = setup.centre_cam1();
    let towards_cam2 = centre + 1e-3 * setup.rig.centre_of_cam2().coords;
    let pixels = [centre, towards_cam2].map(|point| setup.rig.cam1.project(&point));
    let direction = pixels[0].zip(pixels[1]).and_then(|(from, to)| (to - from).try_normalize(0.0));
    direction.unwrap_or_else(Vector2::x)
}

fn basics(setup: &RigSetup, assumptions: &Assumptions, surface: &Surface, pixel: &Pixel) -> PixelBasics {
    let Some(segment) = Segment::new(setup, pixel) else { return (None, None, None) };
    let periods = segment::periods(setup, &segment, surface);
    (Some(segment), periods, deviation::at(setup, assumptions, &segment))
}

/// Maps all cells of a grid, with rows in parallel. The results are in the order of the cells.
fn by_row<T: Sync, U: Send>(grid: &[Vec<T>], map: impl Fn(&T) -> U + Sync) -> Vec<U> {
    let rows: Vec<Vec<U>> = grid.par_iter().map(|row| row.iter().map(&map).collect()).collect();
    rows.into_iter().flatten().collect()
}

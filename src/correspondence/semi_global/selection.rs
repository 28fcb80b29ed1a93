//! The candidate of the order that was decided on.
//!
//! The order is known by the agreement of many pixels, so its candidate may err by more than the threshold: noise beyond
//! 3·sd, a pixel that mixes two surfaces, a rim between two columns. Verification judges whether it may stay.

use rayon::prelude::*;

use super::super::candidates::Candidate;
use super::super::segment::SegmentRow;
use super::Scene;
use super::evidence::{DeltaScale, Outlook};
use super::paths::Verdict;
use super::windows::Windows;

/// How far δ of a selected candidate may lie from the drift: turns (18°), or so many sd where that is more.
const REACH_TURNS: f32 = 0.05;
const REACH_SD: f32 = 6.0;
/// Columns beside an interval in which a surface may have its rim.
const RIM_COLUMNS: usize = 1;

/// A candidate and how it fits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Selected {
    pub(super) candidate: Candidate,
    /// (δ − drift)/sd with the sd that true candidates of these images have.
    pub(super) z: f32,
    /// Whether it lies in the measurement volume, as far as its place is known.
    pub(super) in_volume: bool,
}

/// The candidate of each pixel that has one of the decided order.
pub(super) fn select(
    scene: &Scene<'_>,
    windows: &Windows,
    scale: &DeltaScale,
    verdicts: &[Verdict],
) -> Vec<Option<Selected>> {
    let width = scene.cam1.width;
    let mut selected = vec![None; verdicts.len()];
    let rows = selected.par_chunks_mut(width.max(1)).enumerate();
    rows.for_each_init(SegmentRow::default, |segments, (v, row)| {
        let drift = scene.drift.along_row(v);
        scene.table.row(v, segments);
        for (u, selected) in row.iter_mut().enumerate() {
            let pixel = v * width + u;
            if windows.count[pixel] > 0 {
                let outlook = Outlook::new(scene, windows, segments, &drift, pixel, u);
                let sd_turns = scale.sd_turns(scene.cam1.modulation[pixel].grey());
                *selected = best_of_order(&outlook, verdicts[pixel].order, sd_turns);
            }
        }
    });
    normalize(&mut selected);
    selected
}

/// The candidate of an order with the least |δ − drift|, of those within reach.
fn best_of_order(outlook: &Outlook<'_>, order: i16, sd_turns: f32) -> Option<Selected> {
    let reach_turns = REACH_TURNS.max(REACH_SD * sd_turns);
    let interval_px = outlook.columns_of(i32::from(order), reach_turns)?;
    let mut best: Option<(f32, f32, i32)> = None;
    let mut consider = |column_px: f32, slope: i32| {
        let (found, rest) = outlook.order_and_rest(column_px);
        let fits = found == i32::from(order) && rest.abs() <= reach_turns;
        if fits && best.is_none_or(|(least, ..)| rest.abs() < f32::abs(least)) {
            best = Some((rest, column_px, slope));
        }
    };
    outlook.crossings(interval_px, &mut consider);
    let [begin, end] = interval_px.map(|px| px.max(0.0) as usize);
    let [first_px, last_px] = outlook.limits_px;
    outlook.row.rims(outlook.phase, begin.saturating_sub(RIM_COLUMNS)..=end + 1 + RIM_COLUMNS, |column_px, slope| {
        if column_px >= first_px && column_px <= last_px {
            consider(column_px, slope);
        }
    });
    let (rest, column_px, slope) = best?;
    let delta_turns = rest + outlook.drift.at(column_px);
    Some(Selected {
        candidate: Candidate {
            column_px,
            order,
            delta: (delta_turns * 65536.0).round().clamp(-32768.0, 32767.0) as i16,
            slope: slope.clamp(-32768, 32767) as i16,
        },
        z: rest / sd_turns,
        in_volume: outlook.is_in_volume(column_px),
    })
}

/// Scales z so that it is that of a normal error: the sd of the estimate also covers what no true candidate has.
fn normalize(selected: &mut [Option<Selected>]) {
    const MEDIAN_OF_UNIT_NORMAL: f32 = 0.6745;
    /// Least scale that is believed.
    const MIN_SCALE: f32 = 0.2;
    let mut magnitudes: Vec<f32> = selected.iter().flatten().map(|s| s.z.abs()).collect();
    if magnitudes.is_empty() {
        return;
    }
    let middle = magnitudes.len() / 2;
    let (_, &mut median, _) = magnitudes.select_nth_unstable_by(middle, f32::total_cmp);
    let scale = (median / MEDIAN_OF_UNIT_NORMAL).max(MIN_SCALE);
    selected.iter_mut().flatten().for_each(|s| s.z /= scale);
}

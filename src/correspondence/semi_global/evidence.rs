//! Evidence: how badly the best candidate of each order fits, in whole numbers.
//!
//! The energy of a candidate with z = (δ − drift)/sd is −ln(e⁻⁵ + e^(−z²/2)): that of a normal error, and no more than five
//! nats however large the error, since a candidate may be missing or spoilt. Orders without candidate have that energy. What
//! lies outside the volume was seldom meant: its candidates must fit somewhat better.

use std::ops::ControlFlow;

use rayon::prelude::*;

use crate::phase::Modulation;

use super::super::drift::{DepthPolynomial, RowPolynomial};
use super::super::row_view::RowView;
use super::super::segment::{Segment, SegmentRow};
use super::windows::Windows;
use super::{Scene, UNITS_PER_NAT};

/// Energy of an order without candidate, nats.
const MISSING_NATS: f32 = 5.0;
/// The same in whole numbers.
pub(super) const MISSING: u8 = (MISSING_NATS * UNITS_PER_NAT) as u8;
/// Energy that a candidate outside the measurement volume has on top, nats.
const OUTSIDE_NATS: f32 = 0.2;
const OUTSIDE: u8 = (OUTSIDE_NATS * UNITS_PER_NAT) as u8;
/// Largest z with an energy of its own; beyond it the candidate counts as missing.
const MAX_Z: f32 = 5.0;
/// Steps of the table of energies, in z.
const STEPS_PER_Z: f32 = 64.0;
/// z of the back-projection test (paper, section 2.1).
pub(super) const PASSING_Z: f32 = 3.0;
/// Share of the variance of δ that grows with noise over modulation; the rest is the same for all pixels.
const NOISE_SHARE: f32 = 0.5;
/// Largest sd of a pixel, in that of a pixel of median modulation.
const MAX_SD_RATIO: f32 = 4.0;
/// Columns by which an interval is widened against rounding.
const COLUMN_MARGIN_PX: f32 = 0.02;
/// Rise of Φ along all columns below which they are searched as one, turns: a projector near C1 lights a ray with one phase.
const FLAT_TURNS: f32 = 2e-3;

/// Predicted sd of δ of a true candidate about the drift.
pub(super) struct DeltaScale {
    /// At median modulation, turns.
    sd_turns: f32,
    /// Median modulation, grey levels.
    median_grey: f32,
}

impl DeltaScale {
    pub(super) fn of(scene: &Scene<'_>) -> Self {
        let cam1 = scene.cam1;
        let lit = cam1.modulation.iter().zip(&cam1.valid).filter(|(_, valid)| **valid);
        let mut lit: Vec<Modulation> = lit.map(|(&modulation, _)| modulation).collect();
        let middle = lit.len() / 2;
        let median_grey = if lit.is_empty() { 1.0 } else { lit.select_nth_unstable(middle).1.grey() };
        let sd_turns = (scene.drift.residual_sd_rad / std::f64::consts::TAU) as f32;
        Self { sd_turns, median_grey }
    }

    /// At a modulation, turns.
    #[inline]
    pub(super) fn sd_turns(&self, modulation_grey: f32) -> f32 {
        let ratio = self.median_grey / modulation_grey.max(f32::MIN_POSITIVE);
        let variance = 1.0 - NOISE_SHARE + NOISE_SHARE * ratio * ratio;
        self.sd_turns * variance.sqrt().min(MAX_SD_RATIO)
    }
}

/// A pixel of C1 and the columns of C2 in which it looks for candidates.
pub(super) struct Outlook<'a> {
    pub(super) row: RowView<'a>,
    pub(super) segment: Segment,
    pub(super) drift: DepthPolynomial,
    pub(super) limits_px: [f32; 2],
    /// Least and greatest Φ within these limits, turns.
    phase_range_turns: [f32; 2],
    pub(super) phase: u16,
}

impl<'a> Outlook<'a> {
    /// That of a pixel in column `u` of the row that `segments` and `drift` belong to.
    pub(super) fn new(
        scene: &Scene<'a>,
        windows: &Windows,
        segments: &SegmentRow,
        drift: &RowPolynomial,
        pixel: usize,
        u: usize,
    ) -> Self {
        let segment = segments.segment(u);
        let limits_px = windows.limits_px(&segment);
        let [a, b] = limits_px.map(|column_px| segment.phase_turns(column_px));
        Self {
            row: RowView::new(scene.cam2, segment.row_px),
            segment,
            drift: drift.along_segment(u),
            limits_px,
            phase_range_turns: [a.min(b), a.max(b)],
            phase: scene.cam1.phase[pixel],
        }
    }

    /// Φ less the drift and the phase of the pixel at a column, turns: the order, and what is left of δ.
    #[inline]
    pub(super) fn order_and_rest(&self, column_px: f32) -> (i32, f32) {
        let turns = self.segment.phase_turns(column_px) - self.drift.at(column_px) - f32::from(self.phase) / 65536.0;
        let order = (turns + 0.5_f32.copysign(turns)) as i32;
        (order, turns - order as f32)
    }

    /// Whether the point seen at a column lies in the measurement volume, as far as its place is known.
    #[inline]
    pub(super) fn is_in_volume(&self, column_px: f32) -> bool {
        column_px >= self.segment.begin_px && column_px <= self.segment.end_px
    }

    /// The columns in which a candidate of an order can lie whose δ is off by no more than `reach_turns`.
    #[inline]
    pub(super) fn columns_of(&self, order: i32, reach_turns: f32) -> Option<[f32; 2]> {
        let [first_px, last_px] = self.limits_px;
        let [least, most] = self.phase_range_turns;
        if most - least <= FLAT_TURNS {
            return Some(self.limits_px);
        }
        let target = order as f32 + f32::from(self.phase) / 65536.0;
        let within = |turns: f32| {
            let (column_px, columns_per_turn) = self.segment.column_and_columns_per_turn(turns.clamp(least, most));
            (column_px.clamp(first_px, last_px), columns_per_turn.abs())
        };
        // The drift is that of the middle of the interval; over its width it changes by far less than the reach.
        let middle = target + self.drift.at(within(target).0);
        if middle + reach_turns < least || middle - reach_turns > most {
            return None;
        }
        let (column_px, columns_per_turn) = within(middle);
        // What the middle is clamped by widens the interval on the other side: it must reach as far as before.
        let half_px = (reach_turns + (middle - middle.clamp(least, most)).abs()) * columns_per_turn + COLUMN_MARGIN_PX;
        Some([column_px - half_px, column_px + half_px])
    }

    /// Tells of all crossings in an interval of columns: column and slope.
    #[inline]
    pub(super) fn crossings(&self, [begin_px, end_px]: [f32; 2], mut tell: impl FnMut(f32, i32)) {
        let columns = begin_px.max(0.0) as usize..=end_px.max(0.0).ceil() as usize;
        let _ = self.row.crossings(self.limits_px, self.phase, columns, |column_px, slope| {
            tell(column_px, slope);
            ControlFlow::Continue(())
        });
    }
}

/// Energies of all orders of all pixels: those of pixel `i` begin at `i · lanes`.
pub(super) fn gather(scene: &Scene<'_>, windows: &Windows, scale: &DeltaScale) -> Vec<u8> {
    let (lanes, width) = (windows.lanes, scene.cam1.width);
    let energies = energies();
    let mut evidence = vec![u8::MAX; scene.cam1.phase.len() * lanes];
    let rows = evidence.par_chunks_mut((width * lanes).max(1)).enumerate();
    rows.for_each_init(SegmentRow::default, |segments, (v, row)| {
        let drift = scene.drift.along_row(v);
        scene.table.row(v, segments);
        for (u, orders) in row.chunks_exact_mut(lanes).enumerate() {
            let pixel = v * width + u;
            let count = usize::from(windows.count[pixel]);
            if count == 0 {
                continue;
            }
            let outlook = Outlook::new(scene, windows, segments, &drift, pixel, u);
            let sd_turns = scale.sd_turns(scene.cam1.modulation[pixel].grey());
            for (lane, energy) in orders[..count].iter_mut().enumerate() {
                *energy = best_energy(&outlook, i32::from(windows.first[pixel]) + lane as i32, sd_turns, &energies);
            }
        }
    });
    evidence
}

/// Energy of the best candidate of an order.
fn best_energy(outlook: &Outlook<'_>, order: i32, sd_turns: f32, energies: &[u8]) -> u8 {
    let mut best = MISSING;
    let Some(interval_px) = outlook.columns_of(order, MAX_Z * sd_turns) else { return best };
    outlook.crossings(interval_px, |column_px, _| {
        let (found, rest) = outlook.order_and_rest(column_px);
        if found == order {
            let step = (rest.abs() / sd_turns * STEPS_PER_Z) as usize;
            let outside = if outlook.is_in_volume(column_px) { 0 } else { OUTSIDE };
            best = best.min(energies.get(step).map_or(MISSING, |&energy| energy + outside));
        }
    });
    best
}

/// Energy of every step of z.
fn energies() -> Vec<u8> {
    let energy = |step: usize| {
        let z = (step as f64 + 0.5) / f64::from(STEPS_PER_Z);
        let nats = -((-f64::from(MISSING_NATS)).exp() + (-0.5 * z * z).exp()).ln();
        (nats.max(0.0) * f64::from(UNITS_PER_NAT)).round() as u8
    };
    (0..(MAX_Z * STEPS_PER_Z) as usize).map(energy).collect()
}

/// How many orders of each pixel pass the back-projection test |δ − drift| < 3·sd.
pub(super) fn count_passing(evidence: &[u8], windows: &Windows) -> Vec<u8> {
    let limit = energies()[(PASSING_Z * STEPS_PER_Z) as usize];
    let passing = |energies: &[u8]| energies.iter().filter(|&&energy| energy < limit).count() as u8;
    evidence.par_chunks_exact(windows.lanes).map(passing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energies_rise_from_none_to_that_of_a_missing_candidate() {
        let energies = energies();
        assert!(energies[0] == 0 && energies.is_sorted());
        assert!(energies.iter().all(|&energy| energy <= MISSING) && energies.last().is_some_and(|&e| e >= MISSING - 1));
        // One sd costs half a nat.
        assert_eq!(energies[64], 10);
    }
}

//! Candidates: the points of a segment whose phase equals that of the pixel, and their back-projection test (paper,
//! sections 2.1 and 2.3).
//!
//! Two forms find them. The *plain scan* looks at every pair of neighbouring columns of the segment: it is the oracle,
//! and finds the candidates that fail the test too, from which sd is estimated. The *projector-side search* looks only
//! where a fringe order can pass the test: Φ is monotone along a segment, so each order k leaves one interval of columns
//! with |Φ − k − φ_p| < thr. Both apply the same arithmetic to the same pairs of columns and yield the same bits.

use std::ops::ControlFlow;

use crate::simd::LANES;

use super::row_view::RowView;
use super::segment::Segment;

/// A point q of a segment with the phase of the pixel p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Column in the epipolar frame, pixels.
    pub column_px: f32,
    /// Fringe order: Φ − φ_p, rounded to whole turns.
    pub order: i16,
    /// δ = Φ − φ_p − order, turns · 65536.
    pub delta: i16,
    /// Rise of the phase of C2 over one column, turns · 65536.
    pub slope: i16,
}

/// The back-projection test |δ − mean| < thr (paper, section 2.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeltaGate {
    /// Mean of δ of true candidates, turns.
    pub mean_turns: f32,
    /// Threshold thr, turns.
    pub threshold_turns: f32,
}

impl DeltaGate {
    /// The test that every candidate passes.
    pub const OPEN: Self = Self { mean_turns: 0.0, threshold_turns: f32::INFINITY };

    /// Whether a candidate passes.
    #[must_use]
    #[inline]
    pub fn passes(&self, delta: i16) -> bool {
        (f32::from(delta) / 65536.0 - self.mean_turns).abs() < self.threshold_turns
    }

    /// The least and the greatest δ that pass, turns · 65536; the least beyond the greatest where none does.
    pub(super) fn bounds(&self) -> [i16; 2] {
        let middle = (self.mean_turns * 65536.0).round() as i16;
        if !self.passes(middle) {
            return [1, 0];
        }
        // Of all numbers from the middle to one beyond the range those that pass come first.
        let last = |mut beyond: i32| {
            let mut inside = i32::from(middle);
            while (beyond - inside).abs() > 1 {
                let between = (inside + beyond) / 2;
                if self.passes(between as i16) { inside = between } else { beyond = between }
            }
            inside as i16
        };
        [last(i32::from(i16::MIN) - 1), last(i32::from(i16::MAX) + 1)]
    }
}

/// Crossings closer together than this are one: no camera resolves fringes of so short a period.
const SAME_PLACE_PX: f32 = 2.0;
/// Turns by which the test is widened where columns are sought, against rounding.
pub(super) const PHASE_MARGIN_TURNS: f32 = 1e-3;
/// A projector near C1 lights a whole ray with one phase: up to this rise along a segment all its columns are searched.
pub(super) const FLAT_TURNS: f32 = 2e-3;
/// Columns by which an interval of the projector-side search is widened against rounding.
pub(super) const COLUMN_MARGIN_PX: f32 = 0.02;

/// All candidates of a pixel, by the plain scan of its whole segment.
pub(super) fn plain_scan(
    row: &RowView<'_>,
    segment: &Segment,
    phase: u16,
    gate: &DeltaGate,
    found: &mut Vec<Candidate>,
) {
    let first = found.len();
    scan_columns(row, segment, phase, gate, segment.begin_px as usize, segment.end_px.ceil() as usize, first, found);
}

/// The candidates of a pixel that pass the gate, each order searched where it can pass.
pub(super) fn projector_side_search(
    row: &RowView<'_>,
    segment: &Segment,
    phase: u16,
    gate: &DeltaGate,
    found: &mut Vec<Candidate>,
) {
    let first = found.len();
    let (at_begin, at_end) = (segment.phase_turns(segment.begin_px), segment.phase_turns(segment.end_px));
    if (at_end - at_begin).abs() <= FLAT_TURNS {
        return plain_scan(row, segment, phase, gate, found);
    }
    let phase_turns = f32::from(phase) / 65536.0;
    let (least, most) = (at_begin.min(at_end), at_begin.max(at_end));
    // A candidate of order k has Φ = k + φ_p + δ with δ within the gate.
    let reach = gate.threshold_turns + PHASE_MARGIN_TURNS;
    let middle = phase_turns + gate.mean_turns;
    let lowest = (least - middle - reach).ceil() as i32;
    let highest = (most - middle + reach).floor() as i32;
    let half_px = reach * columns_per_turn(segment, at_begin, at_end) + COLUMN_MARGIN_PX;
    let mut order = if at_begin <= at_end { lowest } else { highest };
    let step = if at_begin <= at_end { 1 } else { -1 };
    // Ascending columns, like the plain scan.
    let mut next_column = segment.begin_px as usize;
    for _ in lowest..=highest {
        // Within the segment Φ can be inverted; beyond it there may be a pole.
        let centre_px = segment.column_of_phase((order as f32 + middle).max(least).min(most));
        let begin = clamp_column(centre_px - half_px, segment) as usize;
        let end = clamp_column(centre_px + half_px, segment).ceil() as usize;
        // Intervals of neighbouring orders may share a pair of columns when the gate is wide.
        let begin = begin.max(next_column);
        scan_columns(row, segment, phase, gate, begin, end, first, found);
        next_column = next_column.max(end);
        order += step;
    }
}

/// Largest |dt/dΦ| on a segment with the back-projection phases `at_begin` and `at_end`, columns a turn: from
/// t = (Φ − a)/(b − d·Φ) follows dt/dΦ = (b − a·d)/(b − d·Φ)², monotone in Φ.
#[inline]
fn columns_per_turn(segment: &Segment, at_begin: f32, at_end: f32) -> f32 {
    let [a, b, d] = segment.phase;
    let (at_begin, at_end) = (b - d * at_begin, b - d * at_end);
    (b - a * d).abs() / (at_begin * at_begin).min(at_end * at_end)
}

#[inline]
fn clamp_column(column_px: f32, segment: &Segment) -> f32 {
    column_px.max(segment.begin_px).min(segment.end_px)
}

/// All candidates of a pixel, many columns of its segment at once; the same as by [`plain_scan`].
pub(super) fn scan_segment(row: &RowView<'_>, segment: &Segment, phase: u16, found: &mut Vec<Candidate>) {
    let first = found.len();
    let (begin, end) = (segment.begin_px as usize, segment.end_px.ceil() as usize);
    let _ = row.crossings_of_many(segment.limits_px(), phase, begin..=end, |column_px, slope| {
        keep_best_of_place(back_project(segment, phase, column_px, slope), first, found);
        ControlFlow::Continue(())
    });
}

/// Whether the phase occurs on the segment at all. `guess_px` is a column near which it may, as it did for a neighbour: there it
/// is looked for first, and it becomes the column where it was found.
pub(super) fn occurs(row: &RowView<'_>, segment: &Segment, phase: u16, guess_px: &mut f32) -> bool {
    let (begin, end) = (segment.begin_px as usize, segment.end_px.ceil() as usize);
    let near = (*guess_px as usize).saturating_sub(LANES / 2).clamp(begin, end);
    let limits_px = segment.limits_px();
    let found = row.any_crossing(limits_px, phase, &[near..=end.min(near + LANES - 1), begin..=end]);
    *guess_px = found.map_or(*guess_px, |column| column as f32);
    found.is_some()
}

/// Candidates between the columns `begin..=end` that pass the gate; `first` is where this pixel's candidates begin.
#[inline]
fn scan_columns(
    row: &RowView<'_>,
    segment: &Segment,
    phase: u16,
    gate: &DeltaGate,
    begin: usize,
    end: usize,
    first: usize,
    found: &mut Vec<Candidate>,
) {
    let _ = row.crossings(segment.limits_px(), phase, begin..=end, |column_px, slope| {
        let candidate = back_project(segment, phase, column_px, slope);
        if gate.passes(candidate.delta) {
            keep_best_of_place(candidate, first, found);
        }
        ControlFlow::Continue(())
    });
}

/// Order and δ of the point of a segment at a column.
#[inline]
fn back_project(segment: &Segment, phase: u16, column_px: f32, slope: i32) -> Candidate {
    let turns = segment.phase_turns(column_px) - f32::from(phase) / 65536.0;
    let order = nearest_whole(turns);
    let delta = nearest_whole((turns - order as f32) * 65536.0);
    Candidate { column_px, order: order as i16, delta: delta.clamp(-32768, 32767) as i16, slope: slope as i16 }
}

/// The nearest whole number. `f32::round` would be a call of the C library, once and again per candidate.
#[inline]
fn nearest_whole(value: f32) -> i32 {
    (value + 0.5_f32.copysign(value)) as i32
}

/// Noise can cross the phase more than once near one place: of candidates of one place the one with the least |δ| stays.
#[inline]
pub(super) fn keep_best_of_place(candidate: Candidate, first: usize, found: &mut Vec<Candidate>) {
    match found[first..].last_mut() {
        Some(last) if candidate.column_px - last.column_px < SAME_PLACE_PX => {
            if candidate.delta.unsigned_abs() < last.delta.unsigned_abs() {
                *last = candidate;
            }
        }
        _ => found.push(candidate),
    }
}

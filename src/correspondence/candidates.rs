//! Candidates: the points of a segment whose wrapped phase equals that of the pixel, and their back-projection test
//! (paper, sections 2.1 and 2.3).
//!
//! The scan examines every pair of neighbouring columns of a segment. With an open gate it also finds the candidates
//! that fail the test; sd is estimated from all of them.

use std::ops::ControlFlow;

use fringeflow_simd::LANES;

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
    /// A test that every candidate passes.
    pub const OPEN: Self = Self { mean_turns: 0.0, threshold_turns: f32::INFINITY };

    /// Whether a candidate passes.
    #[must_use]
    #[inline]
    pub fn passes(&self, delta: i16) -> bool {
        (f32::from(delta) / 65536.0 - self.mean_turns).abs() < self.threshold_turns
    }
}

/// Crossings closer together than this are one candidate: no camera resolves fringes of so short a period.
const SAME_PLACE_PX: f32 = 2.0;

/// Adds the candidates of a pixel that pass the gate, by ascending column. Looks at every column of the segment.
pub(super) fn scan_segment(
    row: &RowView<'_>,
    segment: &Segment,
    phase: u16,
    gate: &DeltaGate,
    found: &mut Vec<Candidate>,
) {
    let first = found.len();
    let (begin, end) = (segment.begin_px as usize, segment.end_px.ceil() as usize);
    let _ = row.crossings_of_many(segment.limits_px(), phase, begin..=end, |column_px, slope| {
        let candidate = back_project(segment, phase, column_px, slope);
        if gate.passes(candidate.delta) {
            keep_best_of_place(candidate, first, found);
        }
        ControlFlow::Continue(())
    });
}

/// Whether the phase occurs on the segment at all. The search begins near `guess_px`, the column found for a neighbour,
/// and sets it to the column found.
pub(super) fn phase_occurs(row: &RowView<'_>, segment: &Segment, phase: u16, guess_px: &mut f32) -> bool {
    let (begin, end) = (segment.begin_px as usize, segment.end_px.ceil() as usize);
    let near = (*guess_px as usize).saturating_sub(LANES / 2).clamp(begin, end);
    let limits_px = segment.limits_px();
    let found = row.any_crossing(limits_px, phase, &[near..=end.min(near + LANES - 1), begin..=end]);
    *guess_px = found.map_or(*guess_px, |column| column as f32);
    found.is_some()
}

/// Order and δ of the point of a segment at a column.
#[inline]
fn back_project(segment: &Segment, phase: u16, column_px: f32, slope: i32) -> Candidate {
    let turns = segment.phase_turns(column_px) - f32::from(phase) / 65536.0;
    let order = nearest_whole(turns);
    let delta = nearest_whole((turns - order as f32) * 65536.0);
    Candidate { column_px, order: order as i16, delta: delta.clamp(-32768, 32767) as i16, slope: slope as i16 }
}

/// The nearest whole number. `f32::round` would call the C library, once or twice per candidate.
#[inline]
fn nearest_whole(value: f32) -> i32 {
    (value + 0.5_f32.copysign(value)) as i32
}

/// Adds a candidate. Noise can cross the phase more than once near one place; only the candidate with the least |δ| is
/// kept there.
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

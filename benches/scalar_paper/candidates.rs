//! Candidates: every column of the segment is looked at (2.3), and |δ| < 3·sd is asked of what is found (2.1).

use super::phase::{MAX_STEP, Phases, wrapped};
use super::{DeltaTurns, Segment, Tables};

/// Largest difference of neighbouring columns of one surface, turns.
const MAX_COLUMN_STEP: f32 = 0.458;
/// Crossings closer together than this are one.
const SAME_PLACE_PX: f32 = 2.0;

/// A point of the segment with the phase of the pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) column_px: f32,
    /// Fringe order.
    pub(crate) order: i32,
    /// Whether the phase of C2 rises with the column.
    pub(super) rises: bool,
}

/// Candidates of all pixels: those of pixel i are `all[start[i]..start[i + 1]]`.
pub(super) struct Candidates {
    pub(super) start: Vec<usize>,
    pub(super) all: Vec<Candidate>,
}

impl Candidates {
    pub(super) fn of(cam1: &Phases, cam2: &Phases, tables: &Tables, delta: DeltaTurns) -> Self {
        let mut found = Self { start: vec![0], all: Vec::new() };
        for (i, segment) in tables.segments.iter().enumerate() {
            if cam1.valid[i] && !segment.is_none {
                scan(cam2, segment, cam1.phase[i], tables.epipolar_width, delta, &mut found.all);
            }
            found.start.push(found.all.len());
        }
        found
    }

    pub(super) fn of_pixel(&self, pixel: usize) -> &[Candidate] {
        &self.all[self.start[pixel]..self.start[pixel + 1]]
    }
}

/// Looks at the whole segment.
fn scan(cam2: &Phases, segment: &Segment, phase: f32, width: usize, delta: DeltaTurns, found: &mut Vec<Candidate>) {
    let [begin, end] = segment.limits_px;
    let [a, b, d] = segment.phase;
    let (mut before, mut last_px): (Option<f32>, f32) = (None, f32::NEG_INFINITY);
    for column in begin as usize..=(end.ceil() as usize).min(width - 1) {
        let current = at(cam2, segment.row_px, column, width).map(|p| wrapped(p - phase));
        if let (Some(left), Some(right)) = (before, current)
            && (left <= 0.0) != (right <= 0.0)
            && (right - left).abs() <= MAX_COLUMN_STEP
        {
            let column_px = column as f32 - 1.0 + left / (left - right);
            let t = column_px - segment.reference_px;
            let turns = (a + b * t) / (1.0 + d * t) - phase;
            let order = turns.round();
            if (begin..=end).contains(&column_px)
                && column_px - last_px >= SAME_PLACE_PX
                && (turns - order - delta.mean).abs() < 3.0 * delta.sd
            {
                last_px = column_px;
                found.push(Candidate { column_px, order: order as i32, rises: right > left });
            }
        }
        before = current;
    }
}

/// Phase of an epipolar line at a column, between two rows of the frame.
fn at(cam2: &Phases, row_px: f32, column: usize, width: usize) -> Option<f32> {
    let last = cam2.phase.len() / width - 1;
    let row = (row_px as usize).min(last);
    let (upper, lower) = (row * width + column, (row + 1).min(last) * width + column);
    let below = row_px - row as f32;
    let step = wrapped(cam2.phase[lower] - cam2.phase[upper]);
    if cam2.valid[upper] && cam2.valid[lower] && step.abs() <= MAX_STEP {
        return Some(cam2.phase[upper] + step * below);
    }
    let nearest = if below < 0.5 { upper } else { lower };
    cam2.valid[nearest].then_some(cam2.phase[nearest])
}

//! Candidates: every column of the segment is looked at (2.3), and |δ| is asked of what is found (2.1).

use super::phase::{MAX_STEP, Phases, difference};
use super::{Limits, Segment, TURN, Tables};

/// Largest difference of neighbouring columns of one surface, turns · 65536.
const MAX_COLUMN_STEP: i32 = 30000;
/// Crossings closer together than this are one.
const SAME_PLACE_PX: f32 = 2.0;

/// A point of the segment with the phase of the pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) column_px: f32,
    /// Fringe order.
    pub(crate) order: i32,
    /// Turns · 65536.
    pub(super) delta: i32,
}

/// Candidates of all pixels: those of pixel i are `all[start[i]..start[i + 1]]`.
pub(super) struct Candidates {
    pub(super) start: Vec<usize>,
    pub(super) all: Vec<Candidate>,
}

impl Candidates {
    pub(super) fn of(cam1: &Phases, cam2: &Phases, tables: &Tables, limits: &Limits) -> Self {
        let mut found = Self { start: vec![0], all: Vec::new() };
        for (i, segment) in tables.segments.iter().enumerate() {
            if cam1.valid[i] && !segment.is_none {
                scan(cam2, segment, cam1.phase[i], tables.epipolar_width, limits, &mut found.all);
            }
            found.start.push(found.all.len());
        }
        found
    }

    pub(super) fn of_pixel(&self, pixel: usize) -> &[Candidate] {
        &self.all[self.start[pixel]..self.start[pixel + 1]]
    }
}

/// Looks at the whole segment; of candidates of one place that with the least |δ| stays.
fn scan(cam2: &Phases, segment: &Segment, phase: u16, width: usize, limits: &Limits, found: &mut Vec<Candidate>) {
    let [begin, end] = segment.limits_px;
    let [a, b, d] = segment.phase;
    let (first, mut before): (usize, Option<i32>) = (found.len(), None);
    for column in begin as usize..=(end.ceil() as usize).min(width - 1) {
        let current = at(cam2, segment.row_px, column, width).map(|p| difference(p, phase));
        if let (Some(left), Some(right)) = (before, current)
            && (left <= 0) != (right <= 0)
            && (right - left).abs() <= MAX_COLUMN_STEP
        {
            let column_px = column as f32 - 1.0 + left as f32 / (left - right) as f32;
            let t = column_px - segment.reference_px;
            let turns = (a + b * t) / (1.0 + d * t) - f32::from(phase) / TURN as f32;
            let order = turns.round();
            let delta = ((turns - order) * TURN as f32).round() as i32;
            if (begin..=end).contains(&column_px) && limits.is_within(limits.readmission, delta) {
                let candidate = Candidate { column_px, order: order as i32, delta };
                match found[first..].last_mut() {
                    Some(last) if column_px - last.column_px < SAME_PLACE_PX => {
                        if delta.abs() < last.delta.abs() {
                            *last = candidate;
                        }
                    }
                    _ => found.push(candidate),
                }
            }
        }
        before = current;
    }
}

/// Phase of an epipolar line at a column, between two rows of the frame.
fn at(cam2: &Phases, row_px: f32, column: usize, width: usize) -> Option<u16> {
    let last = cam2.phase.len() / width - 1;
    let row = (row_px as usize).min(last);
    let (upper, lower) = (row * width + column, (row + 1).min(last) * width + column);
    let below = row_px - row as f32;
    let step = difference(cam2.phase[lower], cam2.phase[upper]);
    if cam2.valid[upper] && cam2.valid[lower] && step.abs() <= MAX_STEP {
        return Some(cam2.phase[upper].wrapping_add_signed((step as f32 * below).round() as i16));
    }
    let nearest = if below < 0.5 { upper } else { lower };
    cam2.valid[nearest].then_some(cam2.phase[nearest])
}

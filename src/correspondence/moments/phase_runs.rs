//! Runs of continuous wrapped phase in the rows of C1, and their fringe orders relative to each other.
//!
//! ```text
//! rise(u) = phase(u) − phase(u − 1), wrapped
//! the phase continues to u if rise(u) is small, and the bend is small on at least one side of the step:
//!     |rise(u) − rise(u − 1)| or |rise(u + 1) − rise(u)|; how small tells the noise of the phase at its modulation
//! order(u) = order(u − 1) + the whole turn that the wrapped phase skips at the step; 0 where a run begins
//! two runs of neighbouring rows are united if one whole number makes nine in ten of their common pixels continue
//! ```

use std::ops::Range;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use super::model::Model;
use super::noise::Noise;
use crate::correspondence::bands::BAND_ROWS;
use crate::correspondence::neighbourhood::MAX_STEP;
use crate::correspondence::runs::{Runs, Union, divide_at_marks};
use crate::correspondence::view::View;
use crate::phase::{Modulation, PhaseMap};

/// Fewest pixels that unite two runs.
const MIN_SHARED_PX: u32 = 3;
/// Greatest bend of a surface, however noisy it is, turns.
const MOST_BEND_TURNS: f32 = 0.25;

/// The runs of an image; the set of each is its surface.
#[derive(Clone, Debug, Default)]
pub(super) struct PhaseRuns {
    pub(super) runs: Runs<RowScratch>,
    /// Fringe order of each pixel relative to that of the first pixel of its run.
    pub(super) relative: Vec<i16>,
    /// Number of surfaces.
    pub(super) surfaces: usize,
}

/// Scratch for a row of pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct RowScratch {
    /// Whether a pixel has a phase and a segment: 1 or 0.
    usable: Vec<u8>,
    /// Rise of the phase to each pixel from the one before.
    rise: Vec<i16>,
    /// Bend at which a run ends.
    max_bend: Vec<u16>,
    /// Whether a run ends before the pixel: 1 or 0.
    breaks: Vec<u8>,
    /// By how many orders the pixel differs from the one before.
    carry: Vec<i8>,
}

impl PhaseRuns {
    /// Finds the runs of the pixels with a segment, and unites them.
    pub(super) fn find(&mut self, view: View<'_>, of_phase: Noise) {
        let View { cam1, model, .. } = view;
        let max_row_step = (65536.0 * model.max_row_step_turns) as u16;
        let (width, height) = (cam1.width.max(1), cam1.height);
        let Self { runs, relative, surfaces } = self;
        relative.resize(cam1.phase.len(), 0);
        runs.divide(height, relative.par_chunks_mut(BAND_ROWS * width), |v, row, relative, runs| {
            row.find_breaks(view, v, of_phase);
            row.count_orders(&mut relative[v % BAND_ROWS * width..][..width]);
            divide_at_marks(v * width, &row.breaks, |u| row.usable[u] == 1, runs);
        });
        let relative = &*relative;
        *surfaces = runs.unite(width, |_, _, overlaps, unions| {
            for (runs, shared) in overlaps.filter(|(_, shared)| shared.len() >= MIN_SHARED_PX as usize) {
                let rows = [shared.start - width..shared.end - width, shared];
                let order_step =
                    fringeflow_simd::run(Level::in_use(), UniteKernel { cam1, relative, rows, max_row_step });
                unions.extend(order_step.map(|order_step| Union { runs, order_step }));
            }
        });
    }
}

impl RowScratch {
    /// Finds where runs of row `v` end.
    fn find_breaks(&mut self, View { cam1, table, model, .. }: View<'_>, v: usize, noise: Noise) {
        let width = cam1.width;
        let Self { usable, rise, max_bend, breaks, carry } = self;
        usable.resize(width, 0);
        rise.resize(width + 1, 0);
        max_bend.resize(width, 0);
        breaks.resize(width, 0);
        carry.resize(width, 0);
        table.mark_segments(v, usable);
        let pixels = v * width..(v + 1) * width;
        let (phase, valid) = (&cam1.phase[pixels.clone()], &cam1.valid[pixels.clone()]);
        let modulation = &cam1.modulation[pixels];
        fringeflow_simd::run(Level::in_use(), BreakKernel { phase, valid, modulation, noise, model, row: self });
    }

    /// Counts the orders of the pixels from the first one of their run.
    fn count_orders(&self, relative: &mut [i16]) {
        let mut order = 0_i16;
        for (relative, (&is_break, &carry)) in relative.iter_mut().zip(self.breaks.iter().zip(&self.carry)) {
            order = if is_break == 1 { 0 } else { order.wrapping_add(i16::from(carry)) };
            *relative = order;
        }
    }
}

/// Finds where the phase of a row does not continue.
struct BreakKernel<'a> {
    phase: &'a [u16],
    valid: &'a [bool],
    modulation: &'a [Modulation],
    noise: Noise,
    model: &'a Model,
    row: &'a mut RowScratch,
}

impl Kernel for BreakKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { phase, valid, modulation, noise, model, row } = self;
        let RowScratch { usable, rise, max_bend, breaks, carry } = row;
        let width = phase.len();
        let (usable, valid) = (&mut usable[..width], &valid[..width]);
        for u in 0..width {
            usable[u] &= u8::from(valid[u]);
        }
        let rises = &mut rise[..width + 1];
        rises[0] = i16::MIN;
        rises[width] = i16::MIN;
        let (before, here) = (&phase[..width - 1], &phase[1..][..width - 1]);
        let (known_before, known) = (&usable[..width - 1], &usable[1..][..width - 1]);
        {
            let rises = &mut rises[1..][..width - 1];
            for i in 0..width - 1 {
                // The least number stands for no rise: its magnitude breaks every run, and it bends from every other
                // rise.
                let rise = (here[i].wrapping_sub(before[i]) as i16).max(-i16::MAX);
                rises[i] = if known_before[i] & known[i] == 1 { rise } else { i16::MIN };
            }
        }
        for (limit, modulation) in max_bend.iter_mut().zip(modulation) {
            let by_noise = model.bend_sd * noise.bend_turns(modulation.grey());
            let turns = by_noise.min(MOST_BEND_TURNS).max(model.max_bend_turns);
            *limit = (65536.0 * turns) as u16;
        }
        breaks[0] = 1;
        carry[0] = 0;
        let (last, rise, next) = (&rises[..width - 1], &rises[1..][..width - 1], &rises[2..][..width - 1]);
        let max_bend = &max_bend[1..][..width - 1];
        let (breaks, carry) = (&mut breaks[1..][..width - 1], &mut carry[1..][..width - 1]);
        for i in 0..width - 1 {
            let bends = |other: i16| (other == i16::MIN) | (other.saturating_sub(rise[i]).unsigned_abs() > max_bend[i]);
            let is_large = rise[i].unsigned_abs() > MAX_STEP as u16;
            breaks[i] = u8::from(is_large | (bends(last[i]) & bends(next[i])));
            let up = i8::from((rise[i] > 0) & (here[i] < before[i]));
            let down = i8::from((rise[i] < 0) & (here[i] > before[i]));
            carry[i] = up - down;
        }
    }
}

/// Finds the order step from the upper pixels to the lower ones, if nine in ten of those whose phase continues agree on
/// it.
struct UniteKernel<'a> {
    cam1: &'a PhaseMap,
    relative: &'a [i16],
    rows: [Range<usize>; 2],
    max_row_step: u16,
}

impl Kernel for UniteKernel<'_> {
    type Output = Option<i32>;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Option<i32> {
        let Self { cam1, relative, rows: [above, below], max_row_step } = self;
        let count = above.len();
        let (phase_above, phase_below) = (&cam1.phase[above.clone()][..count], &cam1.phase[below.clone()][..count]);
        let (of_above, of_below) = (&relative[above][..count], &relative[below][..count]);
        let step_at = |i: usize| {
            let step = phase_below[i].wrapping_sub(phase_above[i]) as i16;
            let up = i16::from((step > 0) & (phase_below[i] < phase_above[i]));
            let down = i16::from((step < 0) & (phase_below[i] > phase_above[i]));
            let order_step = of_above[i].wrapping_sub(of_below[i]).wrapping_add(up - down);
            (step.unsigned_abs() <= max_row_step, order_step)
        };
        // A guess from one pixel, then a count of the pixels that agree.
        let guess =
            |from: usize| (from..count).chain(0..from).map(step_at).find(|(near, _)| *near).map(|(_, step)| step);
        let mut before = None;
        for from in [0, count / 2] {
            let wanted = guess(from)?;
            if before == Some(wanted) {
                break;
            }
            let (mut near, mut same) = (0_u32, 0_u32);
            for i in 0..count {
                let (is_near, order_step) = step_at(i);
                near += u32::from(is_near);
                same += u32::from(is_near & (order_step == wanted));
            }
            if near >= MIN_SHARED_PX && 3 * near >= 2 * count as u32 && 10 * same >= 9 * near {
                return Some(i32::from(wanted));
            }
            before = Some(wanted);
        }
        None
    }
}

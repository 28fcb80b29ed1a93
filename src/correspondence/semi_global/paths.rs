//! Least energies along straight paths through the image, and the order that has the least sum of them.
//!
//! ```text
//! for each direction, pixel by pixel p after its predecessor q:
//!     L(p, k) = E(p, k) + min( L(q, k − carry), min L(q) + P )      where the wrapped phase runs on from q to p
//!     L(p, k) = E(p, k)                                             where it jumps, or there is no q
//!     L(p)   −= min L(p)
//!     S(p)   += L(p)
//! ```
//!
//! carry is the whole turn that the wrapped phase skips between q and p: an order that continues changes by it. Four
//! directions run with the rows of the image and four against them, in two passes that share nothing; whole numbers make
//! their sum the same in any order.

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::super::neighbourhood::{MAX_STEP, MAX_STEP_CHANGE};
use super::UNITS_PER_NAT;
use super::evidence::MISSING;
use super::windows::{LANE_STEP, MAX_LANES, Windows};

/// Price of an order that does not continue where the wrapped phase does, nats.
const CHANGE_NATS: f32 = 8.0;
const CHANGE: i16 = (CHANGE_NATS * UNITS_PER_NAT) as i16;
/// Orders by which the windows of neighbours may be shifted against each other.
const MAX_SHIFT: usize = 8;
/// Paths through each pixel.
pub(super) const PATHS: usize = 8;
/// Energies of a pixel with room on either side, where orders of its neighbours may point.
const ROOM: usize = MAX_LANES + 2 * MAX_SHIFT;
/// Energy that no order reaches.
const NEVER: i16 = i16::MAX / 2;

/// The order with the least energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Verdict {
    pub(super) order: i16,
    /// By how much the next best order has more, summed over all paths.
    pub(super) margin: u16,
}

/// Decides the order of every pixel with a window; others have margin 0.
pub(super) fn least_energies(cam1: &PhaseMap, windows: &Windows, evidence: &[u8]) -> Vec<Verdict> {
    let height = cam1.phase.len() / cam1.width.max(1);
    let pass = |direction: Pass| {
        let mut sums = vec![0_u16; evidence.len()];
        Sweep { cam1, windows, evidence, pass: direction, height }.run(&mut sums);
        sums
    };
    let (down, up) = rayon::join(|| pass(Pass::Down), || pass(Pass::Up));
    let lanes = windows.lanes;
    let verdict = |(pixel, (down, up)): (usize, (&[u16], &[u16]))| {
        let (mut best, mut second) = ((u16::MAX, 0), u16::MAX);
        for (lane, (a, b)) in down.iter().zip(up).enumerate().take(usize::from(windows.count[pixel])) {
            let sum = a + b;
            if sum < best.0 {
                (best, second) = ((sum, lane), best.0);
            } else {
                second = second.min(sum);
            }
        }
        // A single order has no rival: what a missing candidate costs on all paths is all that can be said for it.
        let rival = if second == u16::MAX { best.0.saturating_add(PATHS as u16 * CHANGE as u16) } else { second };
        Verdict { order: windows.first[pixel] + best.1 as i16, margin: rival.saturating_sub(best.0) }
    };
    down.par_chunks_exact(lanes).zip(up.par_chunks_exact(lanes)).enumerate().map(verdict).collect()
}

/// Sense in which an image is passed through.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Pass {
    /// Rows from the first, columns from the left.
    Down,
    /// Rows from the last, columns from the right.
    Up,
}

/// One pass with its four directions.
struct Sweep<'a> {
    cam1: &'a PhaseMap,
    windows: &'a Windows,
    evidence: &'a [u8],
    pass: Pass,
    height: usize,
}

/// Energies of a row of pixels in one direction, with room on either side of each.
struct PathRow {
    energies: Vec<i16>,
    stride: usize,
}

impl PathRow {
    fn new(width: usize, lanes: usize) -> Self {
        let stride = lanes + 2 * MAX_SHIFT;
        Self { energies: vec![NEVER; width * stride], stride }
    }

    #[inline]
    fn of(&self, column: usize) -> &[i16] {
        &self.energies[column * self.stride..(column + 1) * self.stride]
    }

    #[inline]
    fn of_mut(&mut self, column: usize) -> &mut [i16] {
        &mut self.energies[column * self.stride..(column + 1) * self.stride]
    }
}

impl Sweep<'_> {
    fn run(&self, sums: &mut [u16]) {
        let (width, lanes) = (self.cam1.width, self.windows.lanes);
        // Along the row; from straight before, and from either side of it.
        let rows = || [(); 4].map(|()| PathRow::new(width, lanes));
        let (mut before, mut here) = (rows(), rows());
        for i in 0..self.height {
            let v = if self.pass == Pass::Down { i } else { self.height - 1 - i };
            for j in 0..width {
                let u = if self.pass == Pass::Down { j } else { width - 1 - j };
                self.pixel([u, v], &before, &mut here, &mut sums[(v * width + u) * lanes..][..lanes]);
            }
            std::mem::swap(&mut before, &mut here);
        }
    }

    /// All four directions at a pixel.
    #[inline]
    fn pixel(&self, [u, v]: [usize; 2], before: &[PathRow; 4], here: &mut [PathRow; 4], sums: &mut [u16]) {
        let pixel = v * self.cam1.width + u;
        let count = usize::from(self.windows.count[pixel]);
        let sense = if self.pass == Pass::Down { 1 } else { -1 };
        let steps = [[sense, 0], [0, sense], [sense, sense], [-sense, sense]];
        for (direction, step) in steps.into_iter().enumerate() {
            if count == 0 {
                here[direction].of_mut(u).fill(NEVER);
                continue;
            }
            let mut from = [CHANGE; ROOM];
            let lanes = self.windows.lanes;
            match self.link([u, v], step) {
                Some(Link { column, shift }) => {
                    let row = if step[1] == 0 { &here[direction] } else { &before[direction] };
                    let source = &row.of(column)[shift..shift + lanes];
                    from[..lanes].iter_mut().zip(source).for_each(|(f, &s)| *f = s.min(CHANGE));
                }
                None => from[..lanes].fill(0),
            }
            let evidence = &self.evidence[pixel * lanes..(pixel + 1) * lanes];
            let energies = &mut here[direction].of_mut(u)[MAX_SHIFT..MAX_SHIFT + lanes];
            add(evidence, &from[..lanes], energies, sums);
        }
    }

    /// The predecessor of a pixel in a direction, if the wrapped phase runs on from it.
    #[inline]
    fn link(&self, place: [usize; 2], step: [isize; 2]) -> Option<Link> {
        let pixel = place[1] * self.cam1.width + place[0];
        let before = self.at(place, step, -1).filter(|&q| self.windows.count[q] > 0)?;
        let phase = |i: usize| self.cam1.phase[i];
        let rise = |from: usize, to: usize| i32::from(phase(to).wrapping_sub(phase(from)) as i16);
        let here = rise(before, pixel);
        let bends = |from: Option<usize>, to: Option<usize>| {
            let (Some(from), Some(to)) = (from, to) else { return false };
            self.cam1.valid[from] && self.cam1.valid[to] && (rise(from, to) - here).abs() > MAX_STEP_CHANGE
        };
        let jumps = here.abs() > MAX_STEP
            || bends(self.at(place, step, -2), Some(before))
            || bends(Some(pixel), self.at(place, step, 1));
        if jumps {
            return None;
        }
        let carry = (i32::from(phase(before)) + here - i32::from(phase(pixel))) / 65536;
        let shift = i32::from(self.windows.first[pixel]) - carry - i32::from(self.windows.first[before]);
        let shift = usize::try_from(shift + MAX_SHIFT as i32).ok().filter(|&s| s <= 2 * MAX_SHIFT)?;
        Some(Link { column: place[0].wrapping_add_signed(-step[0]), shift })
    }

    /// The pixel so many steps away, if the image reaches there.
    #[inline]
    fn at(&self, [u, v]: [usize; 2], [du, dv]: [isize; 2], steps: isize) -> Option<usize> {
        // What lies left of the image or above it wraps to where no image reaches.
        let (u, v) = (u.wrapping_add_signed(steps * du), v.wrapping_add_signed(steps * dv));
        (u < self.cam1.width && v < self.height).then(|| v * self.cam1.width + u)
    }
}

/// Where a path comes from.
struct Link {
    /// Column of the predecessor.
    column: usize,
    /// Where its energies begin, for the first order of the pixel.
    shift: usize,
}

/// Energies of a pixel in one direction: those of the path so far and the pixel's own, their least taken off, added to the
/// sums of all directions.
#[inline]
fn add(evidence: &[u8], from: &[i16], energies: &mut [i16], sums: &mut [u16]) {
    let mut least = [NEVER; LANE_STEP];
    for ((evidence, from), energies) in
        evidence.chunks_exact(LANE_STEP).zip(from.chunks_exact(LANE_STEP)).zip(energies.chunks_exact_mut(LANE_STEP))
    {
        for lane in 0..LANE_STEP {
            energies[lane] = i16::from(evidence[lane]) + from[lane];
            least[lane] = least[lane].min(energies[lane]);
        }
    }
    let least = least.into_iter().fold(NEVER, i16::min);
    for (energy, sum) in energies.iter_mut().zip(sums) {
        *energy -= least;
        *sum += *energy as u16;
    }
}

const _: () = assert!(PATHS * (CHANGE as usize + u8::MAX as usize + MISSING as usize) < u16::MAX as usize);

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
use crate::simd::{self, Kernel, Lanes, Level};

use super::UNITS_PER_NAT;
use super::evidence::MISSING;
use super::links::{AXES, Link, Links, MAX_SHIFT};
use super::windows::{LANE_STEP, MAX_LANES, Windows};

/// Price of an order that does not continue where the wrapped phase does, nats.
const CHANGE_NATS: f32 = 8.0;
const CHANGE: i16 = (CHANGE_NATS * UNITS_PER_NAT) as i16;
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
    let links = Links::of(cam1, windows);
    let pass = |pass: Pass| {
        let mut sums = vec![0_u16; evidence.len()];
        let sweep = Sweep { width: cam1.width, height, windows, links: &links, evidence, pass, sums: &mut sums };
        simd::run(Level::in_use(), sweep);
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
    width: usize,
    height: usize,
    windows: &'a Windows,
    links: &'a Links,
    evidence: &'a [u8],
    pass: Pass,
    sums: &'a mut [u16],
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
}

impl Kernel for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, _: L) {
        // Most rigs have no more orders; loops of known length are registers.
        match self.windows.lanes {
            LANE_STEP => self.run_of::<LANE_STEP>(LANE_STEP),
            lanes => self.run_of::<0>(lanes),
        }
    }
}

impl Sweep<'_> {
    /// All pixels; with a number of lanes that is known when this is compiled, or with 0 for any.
    #[inline(always)]
    fn run_of<const KNOWN: usize>(&mut self, lanes: usize) {
        let lanes = if KNOWN > 0 { KNOWN } else { lanes };
        // Along the row; from straight before, and from either side of it.
        let rows = || [(); AXES.len()].map(|()| PathRow::new(self.width, lanes));
        let (mut before, mut here) = (rows(), rows());
        for i in 0..self.height {
            let v = if self.pass == Pass::Down { i } else { self.height - 1 - i };
            for j in 0..self.width {
                let u = if self.pass == Pass::Down { j } else { self.width - 1 - j };
                if self.windows.count[v * self.width + u] > 0 {
                    self.pixel::<KNOWN>([u, v], lanes, &before, &mut here);
                }
            }
            std::mem::swap(&mut before, &mut here);
        }
    }

    /// All four directions at a pixel.
    #[inline(always)]
    fn pixel<const KNOWN: usize>(
        &mut self,
        place: [usize; 2],
        lanes: usize,
        before: &[PathRow; AXES.len()],
        here: &mut [PathRow; AXES.len()],
    ) {
        let (u, pixel) = (place[0], place[1] * self.width + place[0]);
        let lanes = if KNOWN > 0 { KNOWN } else { lanes };
        let evidence = &self.evidence[pixel * lanes..][..lanes];
        let sums = &mut self.sums[pixel * lanes..][..lanes];
        for axis in 0..AXES.len() {
            let mut from = [0; ROOM];
            if let Some(Link { column, shift }) = self.links.towards(axis, place, self.pass == Pass::Down) {
                let row = if AXES[axis][1] == 0 { &here[axis] } else { &before[axis] };
                let source = &row.energies[column * row.stride + shift..][..lanes];
                for lane in 0..lanes {
                    from[lane] = source[lane].min(CHANGE);
                }
            }
            let row = &mut here[axis];
            let energies = &mut row.energies[u * row.stride + MAX_SHIFT..][..lanes];
            add(evidence, &from[..lanes], energies, sums);
        }
    }
}

/// Energies of a pixel in one direction: those of the path so far and the pixel's own, their least taken off, added to the
/// sums of all directions.
#[inline(always)]
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

//! Least energies along straight paths through the image, and the order that has the least sum of them.
//!
//! ```text
//! for each direction, pixel by pixel p after its predecessor q:
//!     F(p, k) = min( L(q, k − carry), P )      where the wrapped phase runs on from q to p, least of L(q) taken off
//!     F(p, k) = 0                              where it jumps, or there is no q
//!     L(p, k) = E(p, k) + F(p, k)
//! for each pixel:
//!     S(p, k) = 8·E(p, k) + sum of F(p, k) over all directions
//! ```
//!
//! carry is the whole turn that the wrapped phase skips between q and p: an order that continues changes by it. S differs from
//! the sum of L by a number that is the same for all orders of a pixel.
//!
//! Four directions run with the rows of the image and four against them, in two passes that begin at opposite ends and share
//! nothing until they meet: each leaves its sums in the half that it goes through first, and decides in the other, where the
//! sums of the other pass lie. Whole numbers make a sum the same in any order.

use crate::phase::PhaseMap;
use crate::simd::{self, Kernel, Lanes, Level};

use super::UNITS_PER_NAT;
use super::evidence::{MISSING, NO_ORDER};
use super::links::{AXES, Link, Links, MAX_SHIFT, RowLinks};
use super::windows::{LANE_STEP, MAX_LANES, Windows};

/// Price of an order that does not continue where the wrapped phase does, nats.
const CHANGE_NATS: f32 = 8.0;
const CHANGE: u16 = (CHANGE_NATS * UNITS_PER_NAT) as u16;
/// Number of orders for which loops are compiled, beside one step of them and any number.
const FEW_LANES: usize = 2 * LANE_STEP;
/// Paths through each pixel.
pub(super) const PATHS: usize = 8;

/// The orders with the least energy.
#[derive(Clone, Debug, Default)]
pub(super) struct Verdicts {
    pub(super) order: Vec<i16>,
    /// By how much the next best order has more, summed over all paths. That of pixels without a window has no meaning.
    pub(super) margin: Vec<u16>,
}

/// Room for the links of pixels and the sums of paths.
#[derive(Clone, Debug, Default)]
pub(super) struct PathRoom {
    links: Links,
    sums: Vec<u16>,
}

/// Decides the order of every pixel with a window.
pub(super) fn least_energies(
    cam1: &PhaseMap,
    windows: &Windows,
    evidence: &[u8],
    PathRoom { links, sums }: &mut PathRoom,
    verdicts: &mut Verdicts,
) {
    let (width, height) = (cam1.width.max(1), cam1.height);
    links.find(cam1, windows);
    sums.resize(evidence.len(), 0);
    verdicts.order.resize(width * height, 0);
    verdicts.margin.resize(width * height, 0);
    let middle = height / 2;
    let (upper_sums, lower_sums) = sums.split_at_mut(middle * width * windows.lanes);
    let (upper_order, lower_order) = verdicts.order.split_at_mut(middle * width);
    let (upper_margin, lower_margin) = verdicts.margin.split_at_mut(middle * width);
    let mut passes = [Pass::Down, Pass::Up].map(|pass| Sweep {
        width,
        windows,
        links,
        evidence,
        pass,
        before: AXES.map(|_| PathRow::new(width, windows.lanes)),
        here: AXES.map(|_| PathRow::new(width, windows.lanes)),
    });
    let [down, up] = &mut passes;
    let level = Level::in_use();
    let (above, below) = (0..middle, middle..height);
    rayon::join(
        || {
            let visit = Leave { sums: &mut *upper_sums };
            simd::run(level, Through { sweep: &mut *down, rows: above.clone(), visit });
        },
        || {
            let visit = Leave { sums: &mut *lower_sums };
            simd::run(level, Through { sweep: &mut *up, rows: below.clone(), visit });
        },
    );
    rayon::join(
        || {
            let visit = Decide { sums: lower_sums, order: lower_order, margin: lower_margin };
            simd::run(level, Through { sweep: down, rows: below.clone(), visit });
        },
        || {
            let visit = Decide { sums: upper_sums, order: upper_order, margin: upper_margin };
            simd::run(level, Through { sweep: up, rows: above.clone(), visit });
        },
    );
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
    windows: &'a Windows,
    links: &'a Links,
    evidence: &'a [u8],
    pass: Pass,
    /// Energies along the row, from straight before, and from either side of it: of the row before and of this one.
    before: [PathRow; AXES.len()],
    here: [PathRow; AXES.len()],
}

/// Energies of a row of pixels in one direction, the least of each taken off, none above the price of a change; with room on
/// either side where orders of its neighbours may point.
struct PathRow {
    energies: Vec<u8>,
}

impl PathRow {
    fn new(width: usize, lanes: usize) -> Self {
        Self { energies: vec![CHANGE as u8; width * (lanes + 2 * MAX_SHIFT)] }
    }
}

/// Goes through some rows.
struct Through<'a, 'b, V> {
    sweep: &'a mut Sweep<'b>,
    rows: std::ops::Range<usize>,
    visit: V,
}

/// What becomes of the sums of pixels.
trait Visit {
    /// Takes what the paths of a pass bring to the orders of a pixel; `place` is that of the pixel among those of the rows.
    fn take<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_>,
        pixel: usize,
        place: usize,
        sum: &[u16; ROOM],
    );
}

impl<V: Visit> Kernel for Through<'_, '_, V> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        // Most rigs have few orders; loops of known length are registers.
        match self.sweep.windows.lanes {
            LANE_STEP => self.run_of::<L, LANE_STEP>(lanes),
            FEW_LANES => self.run_of::<L, FEW_LANES>(lanes),
            _ => self.run_of::<L, MAX_LANES>(lanes),
        }
    }
}

impl<V: Visit> Through<'_, '_, V> {
    #[inline(always)]
    fn run_of<L: Lanes, const ROOM: usize>(self, level: L) {
        let Self { sweep, rows, mut visit } = self;
        for i in 0..rows.len() {
            let v = if sweep.pass == Pass::Down { rows.start + i } else { rows.end - 1 - i };
            let (links, mut along) = (sweep.links_of_row(v), [0; ROOM]);
            for j in 0..sweep.width {
                let u = sweep.column(j);
                let (pixel, place) = (v * sweep.width + u, (v - rows.start) * sweep.width + u);
                if sweep.windows.count[pixel] > 0 {
                    let sum = sweep.pixel::<L, ROOM>(level, &links, [u, pixel], &mut along);
                    visit.take::<L, ROOM>(level, sweep, pixel, place, &sum);
                }
            }
            sweep.end_row();
        }
    }
}

/// Leaves the sums of rows of which the other pass knows nothing yet.
struct Leave<'a> {
    sums: &'a mut [u16],
}

impl Visit for Leave<'_> {
    #[inline(always)]
    fn take<L: Lanes, const ROOM: usize>(
        &mut self,
        _: L,
        sweep: &Sweep<'_>,
        _: usize,
        place: usize,
        sum: &[u16; ROOM],
    ) {
        let lanes = sweep.lanes::<ROOM>();
        self.sums[place * lanes..][..lanes].copy_from_slice(&sum[..lanes]);
    }
}

/// Decides in rows of which the other pass left its sums.
struct Decide<'a> {
    sums: &'a [u16],
    order: &'a mut [i16],
    margin: &'a mut [u16],
}

impl Visit for Decide<'_> {
    #[inline(always)]
    fn take<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_>,
        pixel: usize,
        place: usize,
        sum: &[u16; ROOM],
    ) {
        let lanes = sweep.lanes::<ROOM>();
        let evidence = &sweep.evidence[pixel * lanes..][..lanes];
        let (best, lead) = decide::<L, ROOM>(level, evidence, sum, &self.sums[place * lanes..][..lanes], lanes);
        self.order[place] = sweep.windows.first[pixel] + best;
        self.margin[place] = lead;
    }
}

impl<'a> Sweep<'a> {
    /// Number of orders, known to loops that have room for few.
    #[inline(always)]
    fn lanes<const ROOM: usize>(&self) -> usize {
        if ROOM <= FEW_LANES { ROOM } else { self.windows.lanes }
    }

    #[inline(always)]
    fn column(&self, j: usize) -> usize {
        if self.pass == Pass::Down { j } else { self.width - 1 - j }
    }

    #[inline(always)]
    fn end_row(&mut self) {
        std::mem::swap(&mut self.before, &mut self.here);
    }

    /// Where the paths come from in a row.
    #[inline(always)]
    fn links_of_row(&self, v: usize) -> [RowLinks<'a>; AXES.len()] {
        let (links, forward) = (self.links, self.pass == Pass::Down);
        [0, 1, 2, 3].map(|axis| links.of_row(axis, v, forward))
    }

    /// All four directions at a pixel in column `u`: the sum of what they bring. `along` are the energies along the row of the
    /// pixel before, then those of this one.
    #[inline(always)]
    fn pixel<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        links: &[RowLinks<'_>; AXES.len()],
        [u, pixel]: [usize; 2],
        along: &mut [u16; ROOM],
    ) -> [u16; ROOM] {
        let lanes = self.lanes::<ROOM>();
        let stride = lanes + 2 * MAX_SHIFT;
        let evidence = &self.evidence[pixel * lanes..][..lanes];
        let mut sum = [0_u16; ROOM];
        for axis in 0..AXES.len() {
            let is_along = AXES[axis][1] == 0;
            let mut from = [0; ROOM];
            if let Some(Link { column, shift }) = links[axis].towards(u) {
                // Along the row nothing is waited for that memory has to bring.
                if is_along && ROOM <= FEW_LANES && shift == MAX_SHIFT {
                    from = *along;
                } else {
                    let before = if is_along { &self.here[axis] } else { &self.before[axis] };
                    let before = &before.energies[column * stride + shift..][..lanes];
                    for lane in 0..lanes {
                        from[lane] = u16::from(before[lane]);
                    }
                }
            }
            let energies = add::<L, ROOM>(level, evidence, &from, lanes);
            for lane in 0..lanes {
                sum[lane] = sum[lane].wrapping_add(from[lane]);
            }
            let here = &mut self.here[axis].energies[u * stride + MAX_SHIFT..][..lanes];
            for lane in 0..lanes {
                here[lane] = energies[lane] as u8;
            }
            if is_along {
                *along = energies;
            }
        }
        sum
    }
}

/// Energies of a pixel in one direction: what the path brings and the pixel's own, their least taken off; none is above the
/// price of a change, which whoever goes on from here pays at most.
#[inline(always)]
fn add<L: Lanes, const ROOM: usize>(level: L, evidence: &[u8], from: &[u16; ROOM], lanes: usize) -> [u16; ROOM] {
    let mut energies = *from;
    let mut least = [u16::MAX; LANE_STEP];
    for (energies, evidence) in energies.as_chunks_mut().0.iter_mut().zip(evidence.as_chunks::<LANE_STEP>().0) {
        for lane in 0..LANE_STEP {
            energies[lane] = energies[lane].wrapping_add(u16::from(evidence[lane]));
        }
        let of_step = level.least(energies);
        for lane in 0..LANE_STEP {
            least[lane] = least[lane].min(of_step[lane]);
        }
    }
    for energies in energies[..lanes].as_chunks_mut::<LANE_STEP>().0 {
        for lane in 0..LANE_STEP {
            energies[lane] = energies[lane].wrapping_sub(least[lane]).min(CHANGE);
        }
    }
    energies
}

/// The place of the order with the least sum, and by how much the next best has more.
#[inline(always)]
fn decide<L: Lanes, const ROOM: usize>(
    level: L,
    evidence: &[u8],
    sum: &[u16; ROOM],
    other: &[u16],
    lanes: usize,
) -> (i16, u16) {
    let (mut best, mut place, mut second) = (u16::MAX, 0, u16::MAX);
    let (others, _) = other[..lanes].as_chunks::<LANE_STEP>();
    let sums = sum.as_chunks::<LANE_STEP>().0;
    for (step, ((evidence, other), sums)) in
        evidence.as_chunks::<LANE_STEP>().0.iter().zip(others).zip(sums).enumerate()
    {
        let first = step * LANE_STEP;
        // A key holds the sum and, below it, the place: all are different, and of equal sums the first is the least.
        let mut keys = [u16::MAX; LANE_STEP];
        for lane in 0..LANE_STEP {
            let own = u16::from(evidence[lane]).wrapping_mul(PATHS as u16);
            let total = own.wrapping_add(sums[lane]).wrapping_add(other[lane]);
            let key = total.wrapping_mul(LANE_STEP as u16).wrapping_add(lane as u16);
            keys[lane] = if evidence[lane] == NO_ORDER { u16::MAX } else { key };
        }
        let leasts = level.least(&keys);
        let least = leasts[0];
        for lane in 0..LANE_STEP {
            keys[lane] = if keys[lane] == leasts[lane] { u16::MAX } else { keys[lane] };
        }
        let next = level.least(&keys)[0];
        if least < u16::MAX {
            let total = least / LANE_STEP as u16;
            if total < best {
                second = second.min(best);
                (best, place) = (total, first as u16 + least % LANE_STEP as u16);
            } else {
                second = second.min(total);
            }
            second = second.min(if next < u16::MAX { next / LANE_STEP as u16 } else { u16::MAX });
        }
    }
    // A single order has no rival: what a missing candidate costs on all paths is all that can be said for it.
    let lead = if second == u16::MAX { PATHS as u16 * CHANGE } else { second - best };
    (place as i16, lead)
}

const _: () = assert!(CHANGE < u8::MAX as u16);
const _: () = assert!(PATHS * (CHANGE as usize + MISSING as usize) * LANE_STEP < u16::MAX as usize - LANE_STEP);

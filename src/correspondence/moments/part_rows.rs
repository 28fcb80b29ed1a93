//! Rows of parts: how the parts of a row touch each other and gaps, there and in the row below.

use fringeflow_simd::LANES;

use super::Pixels;
use super::breaks;
use super::gaps::Gaps;
use super::nodes::NONE;
use crate::correspondence::neighbourhood::MAX_STEP;
use crate::correspondence::view::View;

/// What a row of pixels tells about parts.
#[derive(Clone, Debug, Default)]
pub(super) struct PartRow {
    /// Parts that continue each other, in the row and to the one below.
    pub(super) pairs: Vec<[u32; 2]>,
    /// Parts, and numbers of pixels beside each other in the row.
    pub(super) sizes: Vec<[u32; 2]>,
    /// Parts beside each other whose absolute phases differ, and pixels across which the phase goes on, and ends.
    pub(super) broken: Vec<([u32; 2], [u32; 2])>,
    /// Parts and gaps, and pixels of the part from which the phase goes on into the gap.
    pub(super) beside: Vec<([u32; 2], u32)>,
}

impl PartRow {
    /// Finds the parts of row `v`, and how they touch each other and gaps, there and in the row below.
    pub(super) fn find(&mut self, view: View<'_>, pixels: &Pixels<'_>, gaps: &Gaps, v: usize) {
        let Self { pairs, sizes, broken, beside } = self;
        pairs.clear();
        sizes.clear();
        broken.clear();
        beside.clear();
        let (width, owner) = (view.cam1.width, &*pixels.owner);
        // The last row has none below, and is its own.
        let next = (v + 1).min(view.cam1.height - 1);
        let own = &owner[v * width..(v + 1) * width];
        let below = &owner[next * width..(next + 1) * width];
        let mut gaps = [gaps.row(v), gaps.row(next)];
        let mut last = [NONE; 2];
        let mut touch = |pixel: usize, other: usize| {
            let pair = [owner[pixel], owner[other]];
            if pair == last {
                return;
            }
            if let [part, NONE] | [NONE, part] = pair {
                let open = if pair[0] == NONE { pixel } else { other };
                let gap = gaps[usize::from(open / width > v)].gap_of(open);
                if gap != NONE && breaks::goes_on(view, pixel, other) == Some(true) {
                    *pixels_at(beside, [part, gap]) += 1;
                }
            } else if !differ(pixels.absolute(view, pixel), pixels.absolute(view, other)) {
                // They belong to one component, within which no break counts.
                pairs.push(pair);
                last = pair;
            } else if let Some(goes_on) = breaks::goes_on(view, pixel, other) {
                pixels_at(broken, pair)[usize::from(!goes_on)] += 1;
            }
        };
        let mut begin = 0;
        while begin < width {
            let part = own[begin];
            let end = begin + count_of(&own[begin..], part);
            if part != NONE {
                sizes.push([part, (end - begin) as u32]);
            }
            let mut u = begin + count_of(&below[begin..end], part);
            while u < end {
                touch(v * width + u, next * width + u);
                u += 1 + count_of(&below[u + 1..end], part);
            }
            if end < width {
                touch(v * width + end - 1, v * width + end);
            }
            begin = end;
        }
    }
}

/// How many of these pixels, from the first one on, belong to a part.
fn count_of(owner: &[u32], part: u32) -> usize {
    // Whole blocks are compared at once.
    let is_own = |block: &&[u32; LANES]| block.iter().fold(true, |all, owner| all & (*owner == part));
    let own = LANES * owner.as_chunks().0.iter().take_while(is_own).count();
    own + owner[own..].iter().take_while(|owner| **owner == part).count()
}

/// What is counted of two that touch, most often the last ones.
fn pixels_at<T: Default>(touching: &mut Vec<([u32; 2], T)>, pair: [u32; 2]) -> &mut T {
    if touching.last().is_none_or(|(last, _)| *last != pair) {
        touching.push((pair, T::default()));
    }
    let last = touching.len() - 1;
    &mut touching[last].1
}

/// Whether two points do not lie on one surface, as points beside each other or in one place of C2 would: their absolute
/// phases differ.
pub(super) fn differ(a: i32, b: i32) -> bool {
    (a - b).abs() > MAX_STEP
}

//! Candidates decided by their nodes, from which the drift is estimated.
//!
//! ```text
//! for each sampled pixel of a clear node: the candidate of the decided order, if it lies near the volume
//! if wanted, for each sampled pixel of another node: all candidates in the volume; one of them may be true
//! unite neighbouring nodes of one surface with one order into parts
//! keep the candidates of a part if δ scatters little over it; δ of a wrong order may take any value
//! ```

use super::nodes::{NO_NODE, Node, Piece};
use super::order_scores::SearchSpace;
use super::scratch::{DecidedScratch, Part, Scratch};
use crate::correspondence::candidates::DecidedCandidate;
use crate::correspondence::drift::Drift;
use crate::correspondence::pixel_search::PixelSearch;
use crate::correspondence::view::View;

/// Pixels sampled, about.
const PIXELS: usize = 6000;
/// Largest distance of a candidate from the middle of the volume, half segments.
const NEAR_HALVES: f32 = 4.0;
/// Fewest candidates of a part.
const MIN_COUNT: f32 = 8.0;
/// Share of all candidates from which on a part is kept with any sd: over a large body the drift changes by more.
const LARGE_SHARE: f32 = 0.4;

/// Which candidates are kept.
#[derive(Clone, Copy, Debug)]
pub(super) struct DecidedFilter {
    /// Largest |δ − drift|, turns.
    pub(super) cap_turns: f32,
    /// Largest sd of δ over a part, turns: over true surfaces the drift changes little.
    pub(super) max_sd_turns: f32,
    /// Whether to add all candidates of pixels whose nodes are not clear.
    pub(super) with_unclear: bool,
}

impl Scratch {
    /// Finds the decided candidates. Returns their share of the sampled pixels.
    pub(super) fn find_decided(&mut self, view: View<'_>, drift: &Drift, wanted: DecidedFilter) -> f64 {
        let pixels = view.cam1.phase.len();
        let stride = ((pixels as f32 / PIXELS as f32).sqrt() as usize).max(1);
        self.decided.candidates.clear();
        for v in (stride / 2..view.cam1.height).step_by(stride) {
            self.sample_row(view, drift, wanted, stride, v);
        }
        self.decided.keep_smooth_parts(&self.nodes.nodes, wanted.max_sd_turns);
        self.decided.candidates.len() as f64 / (pixels as f64 / (stride * stride) as f64).max(1.0)
    }

    fn sample_row(&mut self, view: View<'_>, drift: &Drift, wanted: DecidedFilter, stride: usize, v: usize) {
        let DecidedFilter { cap_turns, with_unclear, .. } = wanted;
        let Self { runs, nodes, decided: DecidedScratch { candidates, row, .. }, .. } = self;
        let (width, space) = (view.cam1.width, SearchSpace::from_table(view.table));
        row.load_row(view, drift, v);
        for piece in nodes.row(v) {
            let &Piece { node, offset, .. } = piece;
            let of_node = &nodes.nodes[node as usize];
            let is_clear = of_node.is_clear();
            if !is_clear && !with_unclear {
                continue;
            }
            for u in piece.sampled_columns(v * width, stride) {
                let pixel = v * width + u;
                let order = of_node.order(offset + i32::from(runs.relative[pixel]));
                let segment = row.segments.segment(u);
                // The order of a clear node is trusted beyond the volume; other candidates only within.
                let reach_px = if is_clear { NEAR_HALVES } else { 1.0 } * space.half_px;
                let first_px = (segment.reference_px - reach_px).max(0.0);
                let last_px = (segment.reference_px + reach_px).min((view.cam2.width - 2) as f32);
                if first_px >= last_px {
                    continue;
                }
                let (drift, limits_px) = (row.drift.segment(u), [first_px, last_px]);
                let search = PixelSearch::within(view.cam2, segment, drift, view.cam1.phase[pixel], limits_px);
                let mut add = |residual_turns: f32, column_px: f32| {
                    let delta_turns = residual_turns + search.drift.at(column_px);
                    let node = if is_clear { node } else { NO_NODE };
                    candidates.push(DecidedCandidate { pixel: [u, v], column_px, delta_turns, residual_turns, node });
                };
                if is_clear {
                    if let Some((residual_turns, column_px)) = search.nearest(order, cap_turns) {
                        add(residual_turns, column_px);
                    }
                } else {
                    search.crossings(limits_px, |column_px, _| {
                        let (_, residual_turns) = search.order_and_residual(column_px);
                        if residual_turns.abs() < cap_turns {
                            add(residual_turns, column_px);
                        }
                    });
                }
            }
        }
    }
}

impl DecidedScratch {
    /// Removes the candidates of parts where δ scatters too widely.
    fn keep_smooth_parts(&mut self, nodes: &[Node], max_sd_turns: f32) {
        let Self { candidates, sets, part_of, parts, .. } = self;
        sets.reset(nodes.iter().map(|node| node.size_px));
        for (i, node) in nodes.iter().enumerate() {
            for other in node.neighbours.into_iter().filter(|&other| other != NO_NODE && other > i as u32) {
                if nodes[other as usize].label == node.label {
                    sets.unite(i as u32, other, 0);
                }
            }
        }
        part_of.clear();
        let count = sets.number(|_, offset| part_of.push(offset.set));
        parts.clear();
        parts.resize(count, Part::default());
        for decided in candidates.iter().filter(|decided| decided.node != NO_NODE) {
            let part = &mut parts[part_of[decided.node as usize] as usize];
            part.count += 1.0;
            part.sum += decided.residual_turns;
            part.squares += decided.residual_turns * decided.residual_turns;
        }
        let all = candidates.len() as f32;
        candidates.retain(|decided| {
            if decided.node == NO_NODE {
                return true;
            }
            let part = &parts[part_of[decided.node as usize] as usize];
            let is_smooth = part.sd_turns() < max_sd_turns || part.count > LARGE_SHARE * all;
            part.count >= MIN_COUNT && is_smooth
        });
    }
}

impl Part {
    fn sd_turns(&self) -> f32 {
        let mean = self.sum / self.count;
        (self.squares / self.count - mean * mean).max(0.0).sqrt()
    }
}

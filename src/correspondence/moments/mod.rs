//! The fringe orders of all pixels, from the moments of δ over surfaces.
//!
//! A wrong order's δ has a slope over a smooth surface; the true order's has none. So not pixels are asked but *nodes*,
//! the parts of surfaces in tiles, and the answer is a likelihood ratio of the moments of δ over the node.
//!
//! ```text
//! runs, surfaces:   rows of C1 cut where the wrapped phase does not continue; surfaces of runs that continue each other
//! for each order that the largest surface could have, twice; the likeliest of these explanations stays:
//!     evidence:     likelihood ratio of each order of each node
//!     belief:       the orders of all nodes together, along surfaces
//!     field, noise: fitted to the nodes that lead
//! for tiles of three sizes, over the pixels that are still open:
//!     evidence, belief; components of nodes with one order; those founded well enough are looked at pixel by pixel
//! adopt:            open pixels that continue a decided neighbour
//! verdict:          ratios summed over whole surfaces; breaks between them; occupancy of C2
//! ```
//!
//! In: the phase of C1, C2 in the epipolar frame, segments. Out: a point, or a reason why there is none, for each pixel.

mod adopt;
mod belief;
mod breaks;
mod claims;
mod confidence;
mod contacts;
mod continuity;
mod decay;
mod evidence;
mod field;
mod gaps;
mod learned;
mod likelihood;
mod look;
mod model;
mod nodes;
mod noise;
mod offsets;
mod orders;
mod part_rows;
mod parts;
mod phase_runs;
mod points;
mod rivals;
mod samples;
mod verdict;

use fringeflow_base::outcome::Outcome;
use rayon::prelude::*;

use self::adopt::Adoption;
use self::belief::Messages;
pub use self::confidence::{CONFIDENCE_TERMS, Confidence, Grounds};
use self::continuity::Continuity;
use self::evidence::{Evidence, Question};
use self::field::Fitting;
pub(super) use self::learned::Learned;
use self::learned::{Clear, Values};
use self::likelihood::Moments;
use self::look::TileRow;
pub use self::model::{Constant, Model, Step};
use self::nodes::{LABELS, NONE, Nodes};
use self::noise::Noise;
use self::orders::SearchSpace;
use self::phase_runs::PhaseRuns;
use self::points::{Foundation, Written};
use self::rivals::Rivals;
use self::verdict::Verdict;
use super::chosen::ChosenCandidates;
use super::disjoint_sets::DisjointSets;
use super::drift::Drift;
use super::neighbourhood::{MAX_STEP, phase_step};
use super::pool::Pool;
use super::runs::Run;
use super::segment_table::EpipolarAxis;
use super::view::View;

/// State of a pixel: not decided; a point in the volume; a point outside it.
const OPEN: u8 = 0;
const INSIDE: u8 = 1;
const BEYOND: u8 = 2;

/// Side of the largest tile, pixels, and in a large image: the detail of images grows with their size.
const TILE_PX: usize = 16;
const LARGE_TILE_PX: usize = 32;
const LARGE_PX: usize = 800_000;
/// Tile sizes: each is half the one before.
const LEVELS: u8 = 3;

/// Decisions about all pixels of C1, row by row. The old contents of the vectors do not matter.
pub(super) struct Decisions<'a> {
    pub(super) outcomes: &'a mut Vec<Outcome>,
    pub(super) chosen: &'a mut ChosenCandidates,
    /// Orders at which the surface around each point could be.
    pub(super) passing: &'a mut Vec<u8>,
    /// Probability that each point is true.
    pub(super) confidence: &'a mut Vec<Confidence>,
    /// What each probability rests on, if wanted.
    pub(super) grounds: Option<&'a mut Vec<Grounds>>,
}

/// Limits that a point must reach.
pub(super) struct Limits {
    /// Pixels of its surface.
    pub(super) min_region_px: u32,
    /// Probability of being true.
    pub(super) min_confidence: f32,
}

/// A node whose pixels were looked at.
#[derive(Clone, Copy, Debug)]
struct Part {
    level: u8,
    /// Surface of the node, and the label of its order there.
    surface: u32,
    label: u8,
    /// Mean of δ less the field, rad, as used by the pixels.
    offset: f32,
    moments: Option<Moments>,
    /// Odds against every other order and against none, nats.
    odds: f32,
    /// Orders in the volume that its own samples leave possible.
    candidates: u8,
    /// Variance of the field there, rad².
    field_variance: f32,
}

/// The planes of decisions.
struct Pixels<'a> {
    chosen: &'a mut ChosenCandidates,
    state: &'a mut Vec<u8>,
    /// Part of each decided pixel.
    owner: &'a mut Vec<u32>,
    /// δ less the field, turns · 65536.
    rest: &'a mut Vec<i16>,
}

impl Pixels<'_> {
    /// Absolute phase of a decided pixel, turns · 65536.
    #[inline]
    fn absolute(&self, view: View<'_>, pixel: usize) -> i32 {
        (i32::from(self.chosen.order[pixel]) << 16) + i32::from(view.cam1.phase[pixel])
    }

    /// The order with which a pixel continues a decided one beside it. `None` if its phase does not continue.
    #[inline]
    fn continued(&self, view: View<'_>, pixel: usize, decided: usize) -> Option<i32> {
        let step = phase_step(view.cam1.phase[decided], view.cam1.phase[pixel]);
        (step.abs() <= MAX_STEP).then(|| (self.absolute(view, decided) + step) >> 16)
    }

    /// Takes the decisions of the parts back that do not stand.
    fn open_parts(&mut self, stands: &[bool]) {
        if stands.iter().all(|stands| *stands) {
            return;
        }
        self.owner.par_iter_mut().zip(&mut *self.state).for_each(|(owner, state)| {
            if *owner != NONE && !stands[*owner as usize] {
                (*owner, *state) = (NONE, OPEN);
            }
        });
    }
}

/// The planes that only the resolution needs.
#[derive(Clone, Debug, Default)]
struct Planes {
    state: Vec<u8>,
    owner: Vec<u32>,
    rest: Vec<i16>,
}

impl Planes {
    fn reset(&mut self, count: usize) {
        let Self { state, owner, rest } = self;
        state.clear();
        state.resize(count, OPEN);
        owner.clear();
        owner.resize(count, NONE);
        rest.resize(count, 0);
    }
}

/// Scratch memory, kept from image to image.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    runs: PhaseRuns,
    bases: Vec<i32>,
    /// The order of the middle of the volume at each run, before it is averaged over a surface.
    middles: Vec<f32>,
    /// Their weighted sum over each surface, and the sum of the weights.
    sums_of_surfaces: Vec<[f64; 2]>,
    nodes: Nodes,
    /// Nodes of each surface.
    of_surface: Vec<u32>,
    evidence: Evidence,
    messages: Messages,
    /// Nodes whose order is clear.
    clear: Vec<Clear>,
    rivals: Rivals,
    /// What each rival starts with.
    explanations: Vec<Learned>,
    /// Nodes and evidence of the best explanation so far.
    best_nodes: Nodes,
    best_evidence: Evidence,
    fitting: Fitting,
    values: Values,
    sets: DisjointSets,
    /// Component of each node, and its sums: weighted mean of δ, rad, weight, and ratio, nats.
    set_of: Vec<usize>,
    sums: Vec<[f32; 3]>,
    parts: Vec<Part>,
    part_of: Vec<u32>,
    offsets: Vec<f32>,
    planes: Planes,
    looks: Pool<TileRow>,
    adoption: Adoption,
    verdict: Verdict,
    continuity: Continuity,
    segment_marks: Pool<Vec<u8>>,
}

impl Scratch {
    /// Divides C1 into surfaces, and learns the error field from them. `known` is the field of an earlier window.
    pub(super) fn explain(&mut self, view: View<'_>, known: Option<&Drift>) -> Learned {
        let of_phase = Noise::of_phase(view.cam1, &mut self.values);
        self.runs.find(view, of_phase);
        self.find_bases(view);
        self.learn(view, known, of_phase)
    }

    /// Decides every pixel from what [`Self::explain`] learned; returns the error field.
    pub(super) fn resolve(
        &mut self,
        view: View<'_>,
        learned: Learned,
        limits: &Limits,
        decisions: &mut Decisions<'_>,
    ) -> Drift {
        let count = view.cam1.phase.len();
        let mut planes = std::mem::take(&mut self.planes);
        planes.reset(count);
        let Decisions { outcomes, chosen, passing, confidence, grounds } = decisions;
        chosen.resize(count);
        let mut pixels = Pixels { chosen, state: &mut planes.state, owner: &mut planes.owner, rest: &mut planes.rest };
        self.parts.clear();
        let model = view.model;
        let levels = if model.does(Step::SmallerTiles) { LEVELS } else { 1 };
        for level in 0..levels {
            if level > 0 {
                self.divide(view, level, Some(&pixels));
                self.ask(view, level, &learned, Some(&pixels));
            }
            self.keep(view, level, level + 1 == levels, &learned);
            let parts = (&self.part_of[..], &self.offsets[..]);
            look::look(view, &learned.field, &self.runs, &self.nodes, parts, learned.noise, &mut pixels, &self.looks);
            // A small surface may yet grow in smaller tiles.
            let min_px = if level + 1 < levels { 0 } else { limits.min_region_px };
            if model.does(Step::Reopening) {
                self.reopen(view, min_px, &mut pixels);
            }
        }
        self.adoption.forget(count);
        if model.does(Step::Adoption) {
            self.adoption.adopt(view, &learned.field, &self.parts, learned.noise, &mut pixels);
        }
        self.verdict.judge(view, &self.parts, &learned, &pixels);
        outcomes.clear();
        outcomes.resize(count, Outcome::RejectedByDelta);
        self.drop_unfounded(view, limits.min_region_px, &mut pixels, outcomes);
        self.continuity.count(view, &pixels);
        let Self { parts, verdict, continuity, adoption, segment_marks, .. } = &*self;
        if let Some(grounds) = grounds {
            grounds.clear();
            grounds.extend((0..count).map(|pixel| match pixels.state[pixel] {
                INSIDE => Grounds {
                    cost_nats: verdict.costs_nats()[pixel],
                    continuing: continuity.of_pixels[pixel],
                    depth: adoption.depths[pixel],
                    ..verdict.grounds_of_part(pixels.owner[pixel])
                },
                _ => Grounds::default(),
            }));
        }
        passing.resize(count, 0);
        confidence.resize(count, Confidence::NONE);
        let min_confidence = limits.min_confidence;
        let foundation = Foundation {
            view,
            parts,
            verdict,
            continuing: &continuity.of_pixels,
            depths: &adoption.depths,
            min_confidence,
        };
        let counts = foundation.write(&mut pixels, &mut Written { outcomes, passing, confidence }, segment_marks);
        self.planes = planes;
        let share = f64::from(counts.decided) / f64::from(counts.usable.max(1));
        learned.field.seen(counts.rests.mean_and_sd_rad().1, share)
    }

    /// The order of label 0 of each surface: the middle label is the middle of the volume, averaged over the surface.
    fn find_bases(&mut self, view: View<'_>) {
        let Self { runs, bases, middles, sums_of_surfaces: sums, .. } = self;
        let PhaseRuns { runs, relative, surfaces, .. } = &*runs;
        let middle = |run: &Run| {
            let pixel = (run.pixels().start + run.pixels().end) / 2;
            let segment = view.table.segment(pixel);
            let phase = f32::from(view.cam1.phase[pixel]) / 65536.0;
            let relative = (run.order_offset + i32::from(relative[pixel])) as f32;
            segment.phase_turns(segment.reference_px) - phase - relative
        };
        runs.all.par_iter().with_min_len(256).map(middle).collect_into_vec(middles);
        sums.clear();
        sums.resize(*surfaces, [0.0; 2]);
        for (run, middle) in runs.all.iter().zip(middles).filter(|(_, middle)| middle.is_finite()) {
            let [sum, weight] = &mut sums[run.set as usize];
            *sum += run.pixels().len() as f64 * f64::from(*middle);
            *weight += run.pixels().len() as f64;
        }
        bases.clear();
        bases.extend(sums.iter().map(|[sum, weight]| (sum / weight.max(1.0)) as i32 - LABELS as i32 / 2));
    }

    /// Divides what is open into nodes of a level.
    fn divide(&mut self, view: View<'_>, level: u8, pixels: Option<&Pixels<'_>>) {
        let Self { runs, bases, nodes, of_surface, .. } = self;
        let states = pixels.map(|pixels| &pixels.state[..]);
        nodes.divide([view.cam1.width, view.cam1.height], tile_px(view, level), runs, bases, states);
        of_surface.clear();
        of_surface.resize(runs.surfaces, 0);
        nodes.nodes.iter().for_each(|node| of_surface[node.surface as usize] += 1);
    }

    /// Decides the nodes of a level.
    fn ask(&mut self, view: View<'_>, level: u8, learned: &Learned, pixels: Option<&Pixels<'_>>) {
        self.gather(view, level, learned);
        let Self { runs, nodes, evidence, parts, messages, .. } = self;
        let price_nats = price_nats(view.model, level);
        if let Some(pixels) = pixels.filter(|_| view.model.does(Step::Contacts)) {
            contacts::continue_decided(view, runs, nodes, parts, pixels, price_nats, &mut evidence.scores);
        }
        belief::decide(nodes, &evidence.scores, price_nats, messages);
    }

    /// Gathers the evidence of the nodes of a level.
    fn gather(&mut self, view: View<'_>, level: u8, learned: &Learned) {
        let Self { runs, nodes, of_surface, evidence, .. } = self;
        let space = SearchSpace::from_table(view.table);
        let question = Question {
            // A quarter of the samples is enough to learn from.
            stride_px: tile_px(view, level) / if learned.is_settled { 8 } else { 4 },
            min_px: if level == 0 { 16 } else { 4 },
            cap: learned.cap,
            widths: learned.widths_at(level),
            outside_nats: learned.outside_nats,
            of_surface,
            uncertainty: &learned.uncertainty,
            noise: learned.noise,
            is_vertical: view.table.epipolar_axis() == EpipolarAxis::Vertical,
        };
        evidence.gather(view, &learned.field, &space, runs, nodes, &question);
    }

    /// Opens the pixels of components again whose means speak against them, and of small ones: smaller tiles may see
    /// another order, and pixels beside a surface continue it.
    fn reopen(&mut self, view: View<'_>, min_px: u32, pixels: &mut Pixels<'_>) {
        self.verdict.judge_means(view, &self.parts, pixels);
        pixels.open_parts(self.verdict.find_standing_parts(min_px));
    }

    /// Drops components that are not founded, and points whose place in C2 a better founded component holds.
    fn drop_unfounded(
        &mut self,
        view: View<'_>,
        min_region_px: u32,
        pixels: &mut Pixels<'_>,
        outcomes: &mut [Outcome],
    ) {
        let stands = self.verdict.find_standing_parts(min_region_px);
        outcomes.par_iter_mut().zip(&*pixels.owner).for_each(|(outcome, owner)| {
            if *owner != NONE && !stands[*owner as usize] {
                *outcome = Outcome::Ambiguous;
            }
        });
        pixels.open_parts(stands);
        if !view.model.does(Step::Claims) {
            return;
        }
        for &pixel in self.verdict.taken(view, pixels) {
            let pixel = pixel as usize;
            outcomes[pixel] = Outcome::Contradicted;
            (pixels.owner[pixel], pixels.state[pixel]) = (NONE, OPEN);
        }
    }
}

/// Price of a change of order along a surface in the tiles of a level, nats.
fn price_nats(model: &Model, level: u8) -> f32 {
    model.price_nats / f32::from(1_u16 << level).sqrt()
}

/// Side of the tiles of a level, pixels.
fn tile_px(view: View<'_>, level: u8) -> usize {
    (if view.cam1.phase.len() < LARGE_PX { TILE_PX } else { LARGE_TILE_PX }) >> level
}

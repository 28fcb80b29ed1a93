//! The verdict over whole surfaces.
//!
//! ```text
//! unite parts whose pixels continue each other's absolute phase: components
//! ratio of a component = ratio of the means of δ over its parts
//!                        + evidence of occupancy: the share of its places in C2 that no better founded component holds
//! a component below the least ratio is dropped
//! of two points in one place of C2, the better founded one stays: by its part, its component, its own δ
//! ```
//!
//! The parts of a component were chosen because they fit. So shares and slopes that are good tell no more about it: those
//! of a wrong component are as good. What remains is where the means lie.

use rayon::prelude::*;

use super::confidence::Grounds;
use super::learned::Learned;
use super::likelihood::{ln, radians, student_cost};
use super::model::Step;
use super::nodes::NONE;
use super::offsets::{self, Offsets, PartMean};
use super::{Part, Pixels};
use crate::correspondence::disjoint_sets::DisjointSets;
use crate::correspondence::neighbourhood::MAX_STEP;
use crate::correspondence::pool::Pool;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::view::View;

/// Least share of free places that is counted.
const MIN_FREE: f32 = 0.02;

/// Reach of the places around a contested one, in which claims are counted, pixels, and exponent of their share.
const CLAIM_REACH: isize = 2;

/// What is known of a component.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Component {
    /// Log likelihood ratio, nats.
    nats: f32,
    /// Points.
    size_px: u32,
    /// Number of its parts, small ones counting less.
    weight: f32,
}

impl Component {
    /// Whether it is likelier true than wrong, and of so many pixels at least.
    pub(super) fn stands(&self, min_px: u32) -> bool {
        self.nats >= 0.0 && self.size_px >= min_px
    }
}

/// Components and places; kept from image to image.
#[derive(Clone, Debug, Default)]
pub(super) struct Verdict {
    sets: DisjointSets,
    /// The component of each part.
    component_of: Vec<u32>,
    components: Vec<Component>,
    /// Odds of each part, nats.
    odds_of: Vec<f32>,
    /// Place in C2 of each pixel; [`NONE`] if undecided.
    places: Vec<u32>,
    /// What δ of each pixel speaks against its own point, nats.
    costs: Vec<f32>,
    /// Pixel that holds each place of C2.
    owners: Vec<u32>,
    contest: Contest,
    /// Pixels of each part.
    sizes_px: Vec<u32>,
    offsets: Offsets,
    /// Parts that continue each other, for each row.
    pairs: Vec<Vec<[u32; 2]>>,
    /// Points of each component, and those whose place another holds.
    counts: Vec<[u32; 2]>,
    rows: Pool<SegmentRow>,
}

/// The places of C2 that two surfaces claim.
#[derive(Clone, Debug, Default)]
struct Contest {
    /// A second pixel in each place.
    others: Vec<u32>,
    /// Each pixel of such a place, and the pixel that holds it.
    contested: Vec<[u32; 2]>,
    /// The pixels that lose their place.
    lost: Vec<u32>,
}

impl Verdict {
    /// Forms components of the decided pixels, and computes their ratios with the evidence of occupancy.
    pub(super) fn judge(&mut self, view: View<'_>, parts: &[Part], learned: &Learned, pixels: &Pixels<'_>) {
        self.judge_means(view, parts, pixels);
        self.find_costs(view, parts, learned, pixels);
        self.find_places(view, pixels);
        if view.model.does(Step::FreePlaces) {
            self.count_free_places(view, pixels);
        }
    }

    /// Forms components of the decided pixels, and computes their ratios from the means of δ alone.
    pub(super) fn judge_means(&mut self, view: View<'_>, parts: &[Part], pixels: &Pixels<'_>) {
        self.unite(view, parts, pixels);
        let count = self.sets_of(parts.len());
        let Self { component_of, components, odds_of, sizes_px: sizes, offsets, .. } = self;
        odds_of.clear();
        odds_of.extend(parts.iter().map(|part| part.odds));
        components.clear();
        components.resize(count, Component::default());
        sizes.clear();
        sizes.resize(parts.len(), 0);
        for owner in pixels.owner.iter().filter(|owner| **owner != NONE) {
            sizes[*owner as usize] += 1;
        }
        offsets.parts.clear();
        for (i, part) in parts.iter().enumerate().filter(|(i, _)| sizes[*i] > 0) {
            let own = &mut components[component_of[i] as usize];
            own.size_px += sizes[i];
            own.weight += offsets::weight(sizes[i], view.model);
            let (component, size_px, field_variance) = (component_of[i], sizes[i], part.field_variance);
            offsets.parts.extend(part.moments.map(|moments| PartMean { component, size_px, moments, field_variance }));
        }
        for (own, ratio) in components.iter_mut().zip(offsets.ratios(count, view.model)) {
            own.nats = ratio;
        }
    }

    fn unite(&mut self, view: View<'_>, parts: &[Part], pixels: &Pixels<'_>) {
        let (width, owner) = (view.cam1.width, &*pixels.owner);
        self.pairs.resize_with(view.cam1.height, Vec::new);
        self.pairs.par_iter_mut().enumerate().for_each(|(v, pairs)| {
            pairs.clear();
            let mut last = [NONE; 2];
            let row = v * width;
            for pixel in row..row + width {
                let right = (pixel + 1 < row + width).then(|| pixel + 1);
                let below = (pixel + width < owner.len()).then(|| pixel + width);
                for other in [right, below].into_iter().flatten() {
                    let pair = [owner[pixel], owner[other]];
                    if pair[0] == pair[1] || pair.contains(&NONE) || pair == last {
                        continue;
                    }
                    if !is_other(view, pixels, pixel, other) {
                        pairs.push(pair);
                        last = pair;
                    }
                }
            }
        });
        self.sets.reset(parts.iter().map(|_| 1));
        for &[a, b] in self.pairs.iter().flatten() {
            self.sets.unite(a, b, 0);
        }
    }

    fn sets_of(&mut self, parts: usize) -> usize {
        let Self { sets, component_of, .. } = self;
        component_of.clear();
        component_of.reserve(parts);
        sets.number(|_, offset| component_of.push(offset.set))
    }

    /// What δ of each decided pixel speaks against its point.
    fn find_costs(&mut self, view: View<'_>, parts: &[Part], learned: &Learned, pixels: &Pixels<'_>) {
        self.costs.resize(pixels.owner.len(), 0.0);
        self.costs.par_iter_mut().enumerate().for_each(|(pixel, cost)| {
            let owner = pixels.owner[pixel];
            if owner != NONE {
                let off = radians(f32::from(pixels.rest[pixel]) / 65536.0) - parts[owner as usize].offset;
                let variance = learned.noise.variance(view.cam1.modulation[pixel].grey());
                *cost = student_cost(off * off / variance);
            }
        });
    }

    /// The place of C2 of each decided pixel.
    fn find_places(&mut self, view: View<'_>, pixels: &Pixels<'_>) {
        let (width, columns) = (view.cam1.width, view.cam2.width);
        self.places.resize(pixels.owner.len(), NONE);
        let last = (view.cam2.phase.len() / columns.max(1)).saturating_sub(1) as f32;
        let rows = self.places.par_chunks_mut(width).enumerate();
        let pool = &self.rows;
        rows.for_each(|(v, places)| {
            let own = v * width..(v + 1) * width;
            let owners = &pixels.owner[own.clone()];
            places.fill(NONE);
            if owners.iter().all(|owner| *owner == NONE) {
                return;
            }
            let segments = &mut *pool.take();
            view.table.row(v, segments);
            for ((u, place), column_px) in places.iter_mut().enumerate().zip(&pixels.chosen.column_px[own]) {
                if owners[u] != NONE {
                    let row = (segments.row_px[u] + 0.5).clamp(0.0, last) as u32;
                    *place = row * columns as u32 + (column_px + 0.5).clamp(0.0, (columns - 1) as f32) as u32;
                }
            }
        });
    }

    /// Adds the evidence of occupancy to the components.
    fn count_free_places(&mut self, view: View<'_>, pixels: &Pixels<'_>) {
        self.claim(view, pixels);
        let Self { component_of, components, places, owners, counts, .. } = self;
        counts.clear();
        counts.resize(components.len(), [0; 2]);
        for (pixel, &place) in places.iter().enumerate().filter(|(_, place)| **place != NONE) {
            let own = component_of[pixels.owner[pixel] as usize];
            let top = owners[place as usize] as usize;
            let is_taken = component_of[pixels.owner[top] as usize] != own && is_other(view, pixels, pixel, top);
            counts[own as usize][0] += 1;
            counts[own as usize][1] += u32::from(is_taken);
        }
        for (own, [all, taken]) in components.iter_mut().zip(&*counts).filter(|(_, [all, _])| *all > 0) {
            let exponent = view.model.free_exponent;
            let free = (1.0 - *taken as f32 / *all as f32).max(MIN_FREE);
            own.nats += own.weight * (ln(1.0 + exponent) + exponent * ln(free)).min(0.0);
        }
    }

    /// Gives each place of C2 to the best founded component with a point there.
    fn claim(&mut self, view: View<'_>, pixels: &Pixels<'_>) {
        let mut owners = std::mem::take(&mut self.owners);
        owners.clear();
        owners.resize(view.cam2.phase.len(), NONE);
        let founded = |pixel: usize| self.founded(pixel, pixels.owner[pixel], 0.0);
        for (pixel, &place) in self.places.iter().enumerate().filter(|(_, place)| **place != NONE) {
            let owner = &mut owners[place as usize];
            if *owner == NONE || founded(pixel) > founded(*owner as usize) {
                *owner = pixel as u32;
            }
        }
        self.owners = owners;
    }

    /// Pixels whose place a better founded component holds. A surface that C2 sees claims all places around it; one that
    /// it does not see claims a few by chance.
    pub(super) fn taken(&mut self, view: View<'_>, pixels: &Pixels<'_>) -> &[u32] {
        // Dropped points hold no place.
        let dropped = self.places.iter_mut().zip(&*pixels.owner).filter(|(_, owner)| **owner == NONE);
        dropped.for_each(|(place, _)| *place = NONE);
        self.claim(view, pixels);
        let Contest { mut others, mut contested, mut lost } = std::mem::take(&mut self.contest);
        let Self { places, owners, .. } = &*self;
        let columns = view.cam2.width;
        // A second pixel of another surface in the same place.
        others.clear();
        others.resize(owners.len(), NONE);
        contested.clear();
        for (pixel, &place) in places.iter().enumerate().filter(|(_, place)| **place != NONE) {
            if let Some(rival) = rival(view, pixels, owners, place as usize, pixel) {
                contested.push([pixel as u32, rival]);
                others[place as usize] = pixel as u32;
            }
        }
        let density = |pixel: u32| {
            let place = places[pixel as usize] as usize;
            let mut count = 0_u32;
            for row in -CLAIM_REACH..=CLAIM_REACH {
                for column in -CLAIM_REACH..=CLAIM_REACH {
                    let at = place as isize + row * columns as isize + column;
                    let claims = |of: &[u32]| {
                        let claim = of.get(at as usize).copied().unwrap_or(NONE);
                        claim != NONE && !is_other(view, pixels, pixel as usize, claim as usize)
                    };
                    count += u32::from(claims(owners) || claims(&others));
                }
            }
            let all = (2 * CLAIM_REACH + 1) * (2 * CLAIM_REACH + 1);
            view.model.claim_exponent * ln(count.max(1) as f32 / all as f32)
        };
        let founded = |pixel: u32| self.founded(pixel as usize, pixels.owner[pixel as usize], density(pixel));
        lost.clear();
        for &[pixel, owner] in &contested {
            // Of two surfaces that are founded alike, the nearer one hides the other from C2.
            let is_nearer = view.table.nearness_to_cam2(pixel as usize) > view.table.nearness_to_cam2(owner as usize);
            let nearer = if is_nearer { view.model.nearer_nats } else { -view.model.nearer_nats };
            lost.push(if founded(pixel) + nearer > founded(owner) { owner } else { pixel });
        }
        lost.sort_unstable();
        lost.dedup();
        self.contest = Contest { others, contested, lost };
        &self.contest.lost
    }

    /// How well a point is founded, nats: the odds of its part, the odds that its surface stands, and what else speaks
    /// for it, less what its own δ speaks against it.
    fn founded(&self, pixel: usize, owner: u32, more_nats: f32) -> f32 {
        self.odds_of[owner as usize] + self.standing(owner) + more_nats - self.costs[pixel]
    }

    /// Logarithm of the ratio of the component of a part, nats: what it adds to the part's own evidence.
    fn standing(&self, owner: u32) -> f32 {
        ln(self.of(owner).nats.max(1.0))
    }

    /// What speaks for and against the point of a pixel.
    pub(super) fn grounds(&self, pixel: usize, owner: u32, continuing: u8) -> Grounds {
        let (surface, odds_nats) = (self.standing(owner), self.odds_of[owner as usize]);
        Grounds { surface, odds_nats, cost_nats: self.costs[pixel], continuing }
    }

    /// The component of a decided pixel.
    pub(super) fn of(&self, owner: u32) -> &Component {
        &self.components[self.component_of[owner as usize] as usize]
    }
}

/// The pixel of another surface that holds the place of a pixel in C2, or both places beside it: the claims of a surface
/// that C2 sees enlarged have gaps.
fn rival(view: View<'_>, pixels: &Pixels<'_>, owners: &[u32], place: usize, pixel: usize) -> Option<u32> {
    let at = |place: Option<usize>| {
        let owner = *owners.get(place?)?;
        (owner != NONE && owner != pixel as u32 && is_other(view, pixels, pixel, owner as usize)).then_some(owner)
    };
    let both = |step: usize| {
        let [before, after] = [at(place.checked_sub(step))?, at(place.checked_add(step))?];
        (!is_other(view, pixels, before as usize, after as usize)).then_some(before)
    };
    at(Some(place)).or_else(|| both(1)).or_else(|| both(view.cam2.width))
}

/// Whether two points do not lie on one surface, as points beside each other or in one place of C2 would: their absolute
/// phases differ.
fn is_other(view: View<'_>, pixels: &Pixels<'_>, a: usize, b: usize) -> bool {
    (pixels.absolute(view, a) - pixels.absolute(view, b)).abs() > MAX_STEP
}

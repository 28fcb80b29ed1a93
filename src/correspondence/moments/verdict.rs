//! The verdict over whole surfaces.
//!
//! ```text
//! unite parts whose pixels continue each other's absolute phase: components
//! ratio of a component = ratio of the means of δ over its parts
//!                        − what it costs to break a surface that a better founded component continues
//!                        + evidence of occupancy: the share of its places in C2 that no better founded component holds
//! a component below the least ratio is dropped
//! of two points in one place of C2, the better founded one stays: by its part, its component, its own δ
//! ```
//!
//! The parts of a component were chosen because they fit. So shares and slopes that are good tell no more about it: those
//! of a wrong component are as good. What remains is where the means lie.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use super::breaks::{Breaks, Contact, Side, SurfaceOrder};
use super::claims::{Claims, MIN_PIXELS};
use super::confidence::Grounds;
use super::gaps::Gaps;
use super::learned::Learned;
use super::likelihood::{ln, radians, student_cost};
use super::model::Step;
use super::nodes::NONE;
use super::noise::Noise;
use super::offsets::{self, Offsets, PartMean};
use super::part_rows::{PartRow, differ};
use super::{Part, Pixels};
use crate::correspondence::bands::{self, BAND_ROWS};
use crate::correspondence::disjoint_sets::DisjointSets;
use crate::correspondence::neighbourhood::ABSENT;
use crate::correspondence::pool::Pool;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::view::View;
use crate::phase::Modulation;

/// Least share of free places that is counted.
const MIN_FREE: f32 = 0.02;

/// Reach of the places around a contested one, in which claims are counted, pixels.
const CLAIM_REACH: isize = 2;

/// What is known of a component.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Component {
    /// Log likelihood ratio, nats.
    pub(super) nats: f32,
    /// Points.
    pub(super) size_px: u32,
    /// Number of its parts, small ones counting less.
    pub(super) weight: f32,
}

impl Component {
    /// Whether it is likelier true than wrong, and of so many pixels at least.
    fn stands(&self, min_px: u32) -> bool {
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
    /// Whether the component of each part stands.
    stands: Vec<bool>,
    /// Odds of each part, what its component adds to them, nats, and its offset, rad.
    odds_of: Vec<f32>,
    standing_of: Vec<f32>,
    offset_of: Vec<f32>,
    /// Place in C2 of each pixel; [`NONE`] if undecided.
    places: Vec<u32>,
    /// Absolute phase of each decided pixel, turns · 65536.
    absolute: Vec<i32>,
    /// What δ of each pixel speaks against its own point, nats.
    costs: Vec<f32>,
    /// Pixel that holds each place of C2, and its absolute phase; [`ABSENT`] if there is none.
    owners: Vec<u32>,
    held: Vec<i32>,
    claims: Claims,
    contest: Contest,
    /// Pixels of each part.
    sizes_px: Vec<u32>,
    offsets: Offsets,
    rows: Vec<PartRow>,
    gaps: Gaps,
    breaks: Breaks,
    /// Points of each component, and those whose place another holds, by bands of rows.
    counts: Vec<Vec<[u32; 2]>>,
    segments: Pool<SegmentRow>,
}

/// The places of C2 that two surfaces claim.
#[derive(Clone, Debug, Default)]
struct Contest {
    /// A second pixel in each place.
    others: Vec<u32>,
    /// Each pixel of such a place, and the pixel that holds it, by bands of rows.
    contested: Vec<Vec<[u32; 2]>>,
    /// The pixels that lose their place.
    lost: Vec<u32>,
}

impl Verdict {
    /// Forms components of the decided pixels, and computes their ratios with the evidence of occupancy.
    pub(super) fn judge(&mut self, view: View<'_>, parts: &[Part], learned: &Learned, pixels: &Pixels<'_>) {
        self.judge_means(view, parts, pixels);
        let Self { odds_of, offset_of, .. } = self;
        odds_of.clear();
        odds_of.extend(parts.iter().map(|part| part.odds));
        offset_of.clear();
        offset_of.extend(parts.iter().map(|part| part.offset));
        self.see_pixels(view, learned, pixels);
        // Places are claimed by what the means tell; points are founded by what their places tell too.
        self.find_standing();
        if view.model.does(Step::FreePlaces) {
            self.count_free_places(view, pixels);
            self.find_standing();
        }
    }

    /// Forms components of the decided pixels, and computes their ratios from the means of δ alone.
    pub(super) fn judge_means(&mut self, view: View<'_>, parts: &[Part], pixels: &Pixels<'_>) {
        self.unite(view, parts, pixels);
        let count = self.sets_of(parts.len());
        let Self { component_of, components, sizes_px: sizes, offsets, rows, gaps, breaks, .. } = self;
        components.clear();
        components.resize(count, Component::default());
        sizes.clear();
        sizes.resize(parts.len(), 0);
        rows.iter().flat_map(|row| &row.sizes).for_each(|[part, size]| sizes[*part as usize] += size);
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
        let side = |part: u32| {
            let Part { surface, label, .. } = parts[part as usize];
            (component_of[part as usize], SurfaceOrder { surface, label })
        };
        breaks.sides.clear();
        breaks.sides.extend(rows.iter().flat_map(|row| &row.beside).map(|&([part, joint], pixels)| {
            let (component, order) = side(part);
            Side { component, joint, order, pixels: pixels as f32 }
        }));
        breaks.contacts.clear();
        breaks.contacts.extend(rows.iter().flat_map(|row| &row.broken).map(|&(parts, pixels)| {
            let [a, b] = parts.map(side);
            Contact { sides: [a.min(b), a.max(b)], pixels }
        }));
        breaks.charge(gaps.count, components, view.model.break_nats);
    }

    /// Forms components of parts whose pixels continue each other.
    fn unite(&mut self, view: View<'_>, parts: &[Part], pixels: &Pixels<'_>) {
        self.gaps.find(view, pixels.owner);
        let gaps = &self.gaps;
        self.rows.resize_with(view.cam1.height, PartRow::default);
        self.rows.par_iter_mut().enumerate().for_each(|(v, row)| row.find(view, pixels, gaps, v));
        self.sets.reset(parts.iter().map(|_| 1));
        for &[a, b] in self.rows.iter().flat_map(|row| &row.pairs) {
            self.sets.unite(a, b, 0);
        }
    }

    fn sets_of(&mut self, parts: usize) -> usize {
        let Self { sets, component_of, .. } = self;
        component_of.clear();
        component_of.reserve(parts);
        sets.number(|_, offset| component_of.push(offset.set))
    }

    /// Logarithm of the ratio of the component of each part, nats: what it adds to the part's own evidence.
    fn find_standing(&mut self) {
        let Self { component_of, components, standing_of, .. } = self;
        standing_of.clear();
        standing_of.extend(component_of.iter().map(|component| ln(components[*component as usize].nats.max(1.0))));
    }

    /// What δ of each decided pixel speaks against its point, its place in C2 and its absolute phase.
    fn see_pixels(&mut self, view: View<'_>, learned: &Learned, pixels: &Pixels<'_>) {
        let width = view.cam1.width;
        let Self { costs, places, absolute, segments: pool, offset_of, .. } = self;
        costs.resize(pixels.owner.len(), 0.0);
        places.resize(pixels.owner.len(), NONE);
        absolute.resize(pixels.owner.len(), 0);
        let rows = (costs.par_chunks_mut(width), places.par_chunks_mut(width), absolute.par_chunks_mut(width));
        rows.into_par_iter().enumerate().for_each(|(v, (costs, places, absolute))| {
            let own = v * width..(v + 1) * width;
            let owner = &pixels.owner[own.clone()];
            places.fill(NONE);
            if owner.iter().all(|owner| *owner == NONE) {
                return;
            }
            let segments = &mut *pool.take();
            view.table.row(v, segments);
            for (u, pixel) in own.clone().enumerate().filter(|(u, _)| owner[*u] != NONE) {
                places[u] = view.table.place([pixels.chosen.column_px[pixel], segments.row_px[u]]);
                absolute[u] = pixels.absolute(view, pixel);
                costs[u] = radians(f32::from(pixels.rest[pixel]) / 65536.0) - offset_of[owner[u] as usize];
            }
            let modulation = &view.cam1.modulation[own];
            fringeflow_simd::run(Level::in_use(), CostKernel { noise: learned.noise, modulation, costs });
        });
    }

    /// Adds the evidence of occupancy to the components.
    fn count_free_places(&mut self, view: View<'_>, pixels: &Pixels<'_>) {
        self.claim(view, pixels);
        let Self { component_of, components, places, owners, counts, absolute, .. } = self;
        bands::resize(counts, view.cam1.height);
        counts.par_iter_mut().enumerate().with_max_len(1).for_each(|(band, counts)| {
            counts.clear();
            counts.resize(components.len(), [0; 2]);
            for (pixel, place) in claims_of_band(places, view.cam1.width, band) {
                let own = component_of[pixels.owner[pixel] as usize];
                let top = owners[place] as usize;
                let is_taken =
                    component_of[pixels.owner[top] as usize] != own && differ(absolute[pixel], absolute[top]);
                counts[own as usize][0] += 1;
                counts[own as usize][1] += u32::from(is_taken);
            }
        });
        for (component, own) in components.iter_mut().enumerate() {
            let of_bands = counts.iter().map(|counts| counts[component]);
            let [all, taken] = of_bands.fold([0; 2], |sum, more| [sum[0] + more[0], sum[1] + more[1]]);
            if all == 0 {
                continue;
            }
            let exponent = view.model.free_exponent;
            let free = (1.0 - taken as f32 / all as f32).max(MIN_FREE);
            own.nats += own.weight * (ln(1.0 + exponent) + exponent * ln(free)).min(0.0);
        }
    }

    /// Gives each place of C2 to the best founded component with a point there.
    fn claim(&mut self, view: View<'_>, pixels: &Pixels<'_>) {
        let (mut owners, mut claims) = (std::mem::take(&mut self.owners), std::mem::take(&mut self.claims));
        owners.resize(view.cam2.phase.len(), NONE);
        claims.award(&self.places, |pixel| self.founded(pixel, pixels.owner[pixel], 0.0), &mut owners);
        (self.owners, self.claims) = (owners, claims);
    }

    /// Pixels whose place a better founded component holds. A surface that C2 sees claims all places around it; one that
    /// it does not see claims a few by chance.
    pub(super) fn taken(&mut self, view: View<'_>, pixels: &Pixels<'_>) -> &[u32] {
        // Dropped points hold no place.
        let dropped = self.places.iter_mut().zip(&*pixels.owner).filter(|(_, owner)| **owner == NONE);
        dropped.for_each(|(place, _)| *place = NONE);
        self.claim(view, pixels);
        let Self { owners, held, absolute, .. } = self;
        let of_owner = |&owner: &u32| if owner == NONE { ABSENT } else { absolute[owner as usize] };
        owners.par_iter().with_min_len(MIN_PIXELS).map(of_owner).collect_into_vec(held);
        let Contest { mut others, mut contested, mut lost } = std::mem::take(&mut self.contest);
        let Self { places, owners, held, absolute, .. } = &*self;
        let columns = view.cam2.width;
        // A second pixel of another surface in the same place.
        others.clear();
        others.resize(owners.len(), NONE);
        bands::resize(&mut contested, view.cam1.height);
        contested.par_iter_mut().enumerate().with_max_len(1).for_each(|(band, contested)| {
            contested.clear();
            contested.extend(claims_of_band(places, view.cam1.width, band).filter_map(|(pixel, place)| {
                let rival = place_of_rival(held, columns, place, absolute[pixel])?;
                Some([pixel as u32, owners[rival]])
            }));
        });
        contested.iter().flatten().for_each(|[pixel, _]| others[places[*pixel as usize] as usize] = *pixel);
        let density = |pixel: u32| {
            let place = places[pixel as usize] as usize;
            let mut count = 0_u32;
            for row in -CLAIM_REACH..=CLAIM_REACH {
                for column in -CLAIM_REACH..=CLAIM_REACH {
                    let at = place as isize + row * columns as isize + column;
                    let claims = |of: &[u32]| {
                        let claim = of.get(at as usize).copied().unwrap_or(NONE);
                        claim != NONE && !differ(absolute[pixel as usize], absolute[claim as usize])
                    };
                    count += u32::from(claims(owners) || claims(&others));
                }
            }
            let all = (2 * CLAIM_REACH + 1) * (2 * CLAIM_REACH + 1);
            view.model.free_exponent * ln(count.max(1) as f32 / all as f32)
        };
        let founded = |pixel: u32| self.founded(pixel as usize, pixels.owner[pixel as usize], density(pixel));
        let loser = |&[pixel, owner]: &[u32; 2]| {
            // Of two surfaces that are founded alike, the nearer one hides the other from C2.
            let is_nearer = view.table.nearness_to_cam2(pixel as usize) > view.table.nearness_to_cam2(owner as usize);
            let nearer = if is_nearer { view.model.nearer_nats } else { -view.model.nearer_nats };
            if founded(pixel) + nearer > founded(owner) { owner } else { pixel }
        };
        contested.par_iter_mut().flatten().for_each(|pair| pair[0] = loser(pair));
        lost.clear();
        lost.extend(contested.iter().flatten().map(|[loser, _]| loser));
        lost.sort_unstable();
        lost.dedup();
        self.contest = Contest { others, contested, lost };
        &self.contest.lost
    }

    /// How well a point is founded, nats: the odds of its part, the odds that its surface stands, and what else speaks
    /// for it, less what its own δ speaks against it.
    fn founded(&self, pixel: usize, owner: u32, more_nats: f32) -> f32 {
        let owner = owner as usize;
        self.odds_of[owner] + self.standing_of[owner] + more_nats - self.costs[pixel]
    }

    /// What speaks for and against all points of a part.
    pub(super) fn grounds_of_part(&self, part: u32) -> Grounds {
        let part = part as usize;
        Grounds { surface: self.standing_of[part], odds_nats: self.odds_of[part], ..Grounds::default() }
    }

    /// What δ of each decided pixel speaks against its own point, nats.
    pub(super) fn costs_nats(&self) -> &[f32] {
        &self.costs
    }

    /// Which parts belong to components that are likelier true than wrong, and of so many pixels at least.
    pub(super) fn find_standing_parts(&mut self, min_px: u32) -> &[bool] {
        let Self { component_of, components, stands, .. } = self;
        stands.clear();
        stands.extend(component_of.iter().map(|&component| components[component as usize].stands(min_px)));
        stands
    }
}

/// The pixels of a band that have a place in C2, with their places.
fn claims_of_band(places: &[u32], width: usize, band: usize) -> impl Iterator<Item = (usize, usize)> {
    let of_band = places.iter().enumerate().skip(band * BAND_ROWS * width).take(BAND_ROWS * width);
    of_band.filter(|(_, place)| **place != NONE).map(|(pixel, place)| (pixel, *place as usize))
}

/// The place that a point of another surface holds: that of a point in C2, or both places beside it: the claims of a
/// surface that C2 sees enlarged have gaps.
fn place_of_rival(held: &[i32], columns: usize, place: usize, absolute: i32) -> Option<usize> {
    let at = |place: usize| held.get(place).copied().filter(|&other| other != ABSENT && differ(absolute, other));
    let both = |before: usize, after: usize| Some(!differ(at(before)?, at(after)?));
    let beside = |step: usize| both(place.checked_sub(step)?, place + step)?.then_some(place - step);
    at(place).map(|_| place).or_else(|| beside(1)).or_else(|| beside(columns))
}

/// Turns distances of δ from the offset of the part, rad, into what they cost, nats.
struct CostKernel<'a> {
    noise: Noise,
    modulation: &'a [Modulation],
    costs: &'a mut [f32],
}

impl Kernel for CostKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { noise, modulation, costs } = self;
        for (cost, modulation) in costs.iter_mut().zip(modulation) {
            *cost = student_cost(*cost * *cost / noise.variance(modulation.grey()));
        }
    }
}

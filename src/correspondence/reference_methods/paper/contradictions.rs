//! Step 4, rejection of correspondences by geometric contradictions (paper, 2.2.3), region by region.
//!
//! A region must be large enough, its δ level, and its places in C2 its own: two pixels of C1 that claim one place of
//! C2 with different absolute phases lie on different points of one ray, and C2 sees only one of them. The paper leaves
//! this step open ("this should not be explicitly described here").

use rayon::prelude::*;

use super::claims::{Claim, Claims};
use super::image::Image;
use super::region_delta::Division;
use crate::correspondence::segment::SegmentRow;

/// Share of its places that a region may lose before it is rejected.
const MAX_LOST_SHARE: f64 = 0.3;
/// Reduction of the precedence of a claim with a steep δ: more than any region has pixels.
const STEEP_HANDICAP: f32 = 16_777_216.0;

/// Which of two claims on one place of C2 wins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precedence {
    /// The one with a level δ, then the one of the larger region. While decisions still change, nearness would not do:
    /// pixels of a right region behind a nearer wrong one would be decided again and join the wrong one.
    Foundation,
    /// The one nearer to C2, which hides the other. Between regions that stand, as both do.
    Nearness,
}

impl Image<'_> {
    /// Rejects and excludes contradicted regions (2.2.3): small regions, regions whose δ is not level, and regions
    /// whose places in C2 serve others. Returns the number of pixels.
    pub(super) fn reject_by_contradictions(&mut self, precedence: Precedence) -> usize {
        let division = self.divide(self.tolerance);
        let mut stands = self.level(&division);
        let is_large = |size: &u32| *size >= self.scene.settings.min_region_px;
        stands.iter_mut().zip(&division.regions.size_px).for_each(|(stands, size)| *stands &= is_large(size));
        let contradicted_pixels = self.contradicted_pixels(&division, stands, precedence);
        self.exclude(&contradicted_pixels);
        contradicted_pixels.len()
    }

    /// Rejects and excludes regions whose δ is not level; δ continues in a region within `tolerance`. Parts that votes
    /// alone joined to a region are judged by themselves.
    pub(super) fn reject_by_region_delta(&mut self, tolerance: i32) {
        let division = self.divide(tolerance);
        let level = self.level(&division);
        self.exclude(&self.decided_where(|pixel| !level[division.of_pixels[pixel] as usize]));
    }

    /// Pixels of regions that do not stand, and pixels whose place of C2 another order takes.
    ///
    /// A region stands if it has stood so far and better founded claims do not take a good part of it. Between the
    /// pixels of standing regions, `precedence` decides.
    fn contradicted_pixels(&self, division: &Division, mut stands: Vec<bool>, precedence: Precedence) -> Vec<usize> {
        let (places, sizes) = (self.places(), &division.regions.size_px);
        let region = |pixel: usize| division.of_pixels[pixel] as usize;
        let foundation = |pixel: usize| {
            let size = sizes[region(pixel)] as f32;
            if self.is_steep(division, pixel) { size - STEEP_HANDICAP } else { size }
        };
        // First whole regions compete, by foundation; then their pixels.
        let mut is_lost = self.lost_places(&places, |pixel| stands[region(pixel)], foundation);
        let mut lost_by_region = vec![0_u32; sizes.len()];
        self.decided_where(|pixel| is_lost[pixel]).into_iter().for_each(|pixel| lost_by_region[region(pixel)] += 1);
        for (stands, (&lost, &size)) in stands.iter_mut().zip(lost_by_region.iter().zip(sizes)) {
            *stands &= f64::from(lost) <= MAX_LOST_SHARE * f64::from(size);
        }
        if precedence == Precedence::Nearness {
            let table = self.scene.view.table;
            is_lost = self.lost_places(&places, |pixel| stands[region(pixel)], |pixel| table.nearness_to_cam2(pixel));
        }
        self.decided_where(|pixel| !stands[region(pixel)] || is_lost[pixel])
    }

    /// For each decided pixel whether its place of C2 goes to another order that a pixel that stands claims with
    /// greater precedence.
    fn lost_places(
        &self,
        places: &[u32],
        stands: impl Fn(usize) -> bool,
        precedence: impl Fn(usize) -> f32 + Sync,
    ) -> Vec<bool> {
        let pixels = 0..self.absolute.len();
        let of_pixel = |pixel: usize| if self.is_decided(pixel) { precedence(pixel) } else { 0.0 };
        let precedence: Vec<f32> = pixels.clone().into_par_iter().map(of_pixel).collect();
        let claim = |pixel: usize| Claim {
            place: places[pixel],
            precedence: precedence[pixel],
            absolute: self.absolute[pixel],
        };
        let mut claims = Claims::default();
        claims.clear(self.scene.view.table.epipolar_size_px().iter().product());
        self.decided_where(stands).into_iter().for_each(|pixel| claims.add(claim(pixel)));
        pixels.map(|pixel| self.is_decided(pixel) && claims.is_lost(claim(pixel), 0.0)).collect()
    }

    /// The place of C2 of each decided pixel.
    fn places(&self) -> Vec<u32> {
        let (width, table) = (self.scene.view.cam1.width.max(1), self.scene.view.table);
        let mut places = vec![0; self.absolute.len()];
        places.par_chunks_mut(width).enumerate().for_each_init(SegmentRow::default, |segments, (v, places)| {
            table.row(v, segments);
            for (u, place) in places.iter_mut().enumerate() {
                let column_px = self.candidate(v * width + u).map_or(0.0, |candidate| candidate.column_px);
                *place = table.place([column_px, segments.row_px[u]]);
            }
        });
        places
    }

    /// The decided pixels that meet a condition.
    pub(super) fn decided_where(&self, condition: impl Fn(usize) -> bool) -> Vec<usize> {
        (0..self.absolute.len()).filter(|&pixel| self.is_decided(pixel) && condition(pixel)).collect()
    }
}

//! A scene of nothing but chance, on which kernels are held to what walks say.

use rayon::prelude::*;

use crate::phase::PhaseMap;
use crate::simd::LANES;

use super::super::candidates::Candidate;
use super::super::grid::{bit, places_of};
use super::super::search::Candidates;
use super::continuity::Continuity;
use super::decisions::Decisions;

/// Patches of slopes of all kinds with holes, two of three pixels decided, a tenth of those for a wrong order.
pub(super) struct TestScene {
    pub(super) continuity: Continuity,
    /// A bit a place.
    pub(super) decided: Vec<u32>,
    pub(super) candidates: Candidates,
}

impl TestScene {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let mut state = 11_u64;
        let mut random = move |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        // Steep patches have walks of a period within three steps.
        let slopes: Vec<[i32; 2]> =
            (0..100).map(|_| [random(48_000) as i32 - 24_000, random(12_000) as i32 - 6000]).collect();
        let absolute: Vec<i32> = (0..width * height)
            .map(|i| {
                let (u, v) = (i % width, i / width);
                let [along, across] = slopes[u / 23 % 10 * 10 + v / 17 % 10];
                along * (u % 23) as i32 + across * (v % 17) as i32 + random(300) as i32
            })
            .collect();
        let phase = absolute.iter().map(|&absolute| absolute as u16).collect();
        let valid = (0..width * height).map(|_| random(40) > 0).collect();
        let map = PhaseMap { width, height, phase, valid, ..PhaseMap::default() };
        let continuity = Continuity::of(&map);
        let mut decided = vec![0; continuity.grid.all_blocks()];
        let (mut lists, mut decisions) = (Vec::new(), Vec::new());
        for (pixel, &absolute) in absolute.iter().enumerate() {
            let right = (absolute >> 16) as i16;
            let candidate =
                |order: i16, delta: u64| Candidate { column_px: 0.0, order, delta: delta as i16 - 300, slope: 900 };
            let mut list =
                vec![candidate(right - 1, random(600)), candidate(right, random(600)), candidate(right + 1, 0)];
            if map.valid[pixel] && random(3) > 0 {
                let place = continuity.grid.place(pixel);
                decided[place / LANES] |= 1 << (place % LANES);
                decisions.push((pixel, list[if random(10) > 0 { 1 } else { 2 }]));
            } else if random(2) > 0 {
                list = vec![list[1]];
            }
            lists.push(if map.valid[pixel] { list } else { Vec::new() });
        }
        let mut candidates = Candidates::of_pixels([width, height], &lists);
        candidates.rows().enumerate().for_each(|(v, mut row)| {
            let here = decisions.iter().filter(|(pixel, _)| pixel / width == v);
            here.for_each(|&(pixel, candidate)| row.enter(pixel % width, candidate));
        });
        Self { continuity, decided, candidates }
    }

    pub(super) fn decisions(&self) -> Decisions<'_> {
        Decisions::of(&self.candidates, &self.decided)
    }

    /// Places of the image whose bits are set, or those whose are not.
    pub(super) fn places(&self, bits: &[u32], set: bool) -> Vec<usize> {
        let grid = self.continuity.grid;
        let all = grid.blocks_of_image().flat_map(|block| places_of(block, u32::MAX));
        let in_image = move |place: &usize| grid.column_and_row(*place)[0] < grid.width();
        all.filter(in_image).filter(|&place| bit(bits, place) == set).collect()
    }
}

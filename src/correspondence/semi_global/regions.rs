//! Regions of selected candidates whose absolute phases run on from pixel to pixel.

use super::super::neighbourhood::{MAX_STEP, TURN, neighbours};
use super::selection::Selected;
use crate::phase::PhaseMap;

/// A pixel without region.
const NONE: u32 = u32::MAX;

/// Absolute phase of a selected candidate, turns · 65536.
#[inline]
pub(super) fn absolute(cam1: &PhaseMap, pixel: usize, selected: &Selected) -> i32 {
    i32::from(selected.candidate.order) * TURN + i32::from(cam1.phase[pixel])
}

/// Division of the selected pixels into regions, one after the other in `pixels`.
pub(super) struct Regions {
    pixels: Vec<u32>,
    /// Where each region begins in `pixels`, and where the last one ends.
    begins: Vec<usize>,
}

impl Regions {
    /// Neighbours belong together if their absolute phases run on and their z differ by no more than `max_z_step`.
    pub(super) fn of(cam1: &PhaseMap, selected: &[Option<Selected>], max_z_step: f32) -> Self {
        let mut label = vec![NONE; selected.len()];
        let mut regions = Self { pixels: Vec::new(), begins: vec![0] };
        for seed in 0..selected.len() {
            if selected[seed].is_some() && label[seed] == NONE {
                regions.fill(seed, cam1, selected, max_z_step, &mut label);
            }
        }
        regions
    }

    /// Pixels of each region.
    pub(super) fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.begins.windows(2).map(|ends| &self.pixels[ends[0]..ends[1]])
    }

    fn fill(
        &mut self,
        seed: usize,
        cam1: &PhaseMap,
        selected: &[Option<Selected>],
        max_z_step: f32,
        label: &mut [u32],
    ) {
        let number = self.begins.len() as u32;
        label[seed] = number;
        let mut next = self.pixels.len();
        self.pixels.push(seed as u32);
        while let Some(&pixel) = self.pixels.get(next) {
            next += 1;
            let pixel = pixel as usize;
            let Some(here) = &selected[pixel] else { continue };
            for neighbour in neighbours(pixel, cam1.width, selected.len()).into_iter().flatten() {
                let Some(there) = &selected[neighbour] else { continue };
                let linked = label[neighbour] == NONE
                    && (absolute(cam1, neighbour, there) - absolute(cam1, pixel, here)).abs() <= MAX_STEP
                    && (there.z - here.z).abs() <= max_z_step;
                if linked {
                    label[neighbour] = number;
                    self.pixels.push(neighbour as u32);
                }
            }
        }
        self.begins.push(self.pixels.len());
    }
}

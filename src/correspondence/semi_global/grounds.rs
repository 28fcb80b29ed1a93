//! The grounds on which a candidate is held to be true.

use rayon::prelude::*;

use super::super::neighbourhood::MAX_STEP;
use super::claims::Claims;
use super::paths::{PATHS, Verdict};
use super::regions::{Regions, absolute};
use super::selection::Selected;
use super::{Scene, UNITS_PER_NAT};

/// Pixels on either side within which support counts.
const REACH_PX: isize = 3;
/// Absolute phase of a pixel that does not stand: none is near it.
const ABSENT: i32 = i32::MIN;

/// What speaks for the selected candidate of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Grounds {
    /// Lead of its order over the next best, nats a path.
    pub margin_nats: f32,
    /// |δ − drift| in sd of true candidates.
    pub abs_z: f32,
    /// Pixels of its region.
    pub region_px: u32,
    /// Mean lead of its region, nats a path.
    pub region_lead_nats: f32,
    /// Of the 8 pixels beside it those that stand and whose absolute phases run on to its own.
    pub beside: u8,
    /// Of the 48 pixels around it those.
    pub around: u8,
    /// Whether its place in C2 serves a point that is nearer to C2.
    pub is_hidden: bool,
    /// Share of its region for which that is so.
    pub hidden_share: f32,
}

/// The grounds of every pixel with a selected candidate; `standing` are those whose region stands, `leads_nats` the leads of
/// the regions.
pub(super) fn gather(
    scene: &Scene<'_>,
    selected: &[Option<Selected>],
    standing: &[Option<Selected>],
    verdicts: &[Verdict],
    regions: &Regions,
    leads_nats: impl Iterator<Item = f32>,
) -> Vec<Grounds> {
    let mut grounds = of_pixels(scene, selected, standing, verdicts);
    for (region, lead_nats) in regions.iter().zip(leads_nats) {
        let hidden = region.iter().filter(|&&pixel| grounds[pixel as usize].is_hidden).count();
        for &pixel in region {
            let grounds = &mut grounds[pixel as usize];
            grounds.region_px = region.len() as u32;
            grounds.region_lead_nats = lead_nats;
            grounds.hidden_share = hidden as f32 / region.len() as f32;
        }
    }
    grounds
}

/// What each pixel has by itself.
fn of_pixels(
    scene: &Scene<'_>,
    selected: &[Option<Selected>],
    standing: &[Option<Selected>],
    verdicts: &[Verdict],
) -> Vec<Grounds> {
    let claims = Claims::new(scene, standing, |pixel| scene.table.nearness_to_cam2(pixel), 0.0);
    let surroundings = Surroundings::of(scene, standing);
    let of_pixel = |(pixel, selected): (usize, &Option<Selected>)| {
        let Some(selected) = selected else { return Grounds::default() };
        let (beside, around) = surroundings.support(pixel, absolute(scene.cam1, pixel, selected));
        Grounds {
            margin_nats: f32::from(verdicts[pixel].margin) / (PATHS as f32 * UNITS_PER_NAT),
            abs_z: selected.z.abs(),
            beside,
            around,
            is_hidden: claims.is_lost(pixel, selected),
            ..Grounds::default()
        }
    };
    selected.par_iter().enumerate().map(of_pixel).collect()
}

/// Absolute phases of the pixels that stand.
struct Surroundings {
    absolute: Vec<i32>,
    width: usize,
}

impl Surroundings {
    fn of(scene: &Scene<'_>, standing: &[Option<Selected>]) -> Self {
        let of_pixel = |(pixel, standing): (usize, &Option<Selected>)| {
            standing.map_or(ABSENT, |s| absolute(scene.cam1, pixel, &s))
        };
        Self { absolute: standing.par_iter().enumerate().map(of_pixel).collect(), width: scene.cam1.width }
    }

    /// How many pixels beside and around a pixel stand with an absolute phase that runs on to `own`.
    fn support(&self, pixel: usize, own: i32) -> (u8, u8) {
        let (u, v) = ((pixel % self.width) as isize, (pixel / self.width) as isize);
        let (width, height) = (self.width as isize, (self.absolute.len() / self.width) as isize);
        let columns = (u - REACH_PX).max(0)..(u + REACH_PX + 1).min(width);
        let (mut beside, mut around) = (0, 0);
        for y in (v - REACH_PX).max(0)..(v + REACH_PX + 1).min(height) {
            for x in columns.clone() {
                let away = (x - u).abs().max((y - v).abs());
                let step = self.absolute[(y * width + x) as usize].wrapping_sub(own);
                let runs_on = away > 0 && step.unsigned_abs() <= MAX_STEP as u32 * away as u32;
                around += u8::from(runs_on);
                beside += u8::from(runs_on && away == 1);
            }
        }
        (beside, around)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn support_is_what_stands_around_and_runs_on() {
        let turn = 65536;
        // A ramp of an eighth of a turn a column; the last column lies an order higher, one pixel does not stand.
        let mut absolute: Vec<i32> = (0..25).map(|i| (i % 5) * turn / 8 + if i % 5 == 4 { turn } else { 0 }).collect();
        absolute[6] = ABSENT;
        let surroundings = Surroundings { absolute, width: 5 };
        assert_eq!(surroundings.support(12, turn / 4), (7, 18));
        assert_eq!(surroundings.support(12, turn / 4 + turn), (0, 5));
        assert_eq!(surroundings.support(0, 0), (2, 14));
    }
}

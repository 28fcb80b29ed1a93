//! The grounds on which a candidate is held to be true.

use rayon::prelude::*;

use super::super::neighbourhood::MAX_STEP;
use super::super::places::Places;
use super::claims::Claims;
use super::paths::{PATHS, Verdict};
use super::regions::{Regions, absolute};
use super::selection::Selected;
use super::{Scene, UNITS_PER_NAT};

/// Pixels on either side within which support counts.
const REACH_PX: usize = 3;
/// Pixels along a side of that surrounding.
const SIDE: usize = 2 * REACH_PX + 1;
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
    places: &Places,
    verdicts: &[Verdict],
    regions: &Regions,
    leads_nats: &[f32],
) -> Vec<Grounds> {
    let mut grounds = of_pixels(scene, selected, standing, places, verdicts);
    for (region, &lead_nats) in regions.iter().zip(leads_nats) {
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
    places: &Places,
    verdicts: &[Verdict],
) -> Vec<Grounds> {
    let claims = Claims::new(scene, places, standing, |pixel| places.nearness[pixel], 0.0);
    let surroundings = Surroundings::of(scene, standing);
    let width = scene.cam1.width;
    let of_pixel = |(pixel, selected): (usize, &Option<Selected>)| {
        let Some(selected) = selected else { return Grounds::default() };
        let (beside, around) =
            surroundings.support([pixel % width, pixel / width], absolute(scene.cam1, pixel, selected));
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

/// Absolute phases of the pixels that stand, in a frame of absent ones as wide as support reaches.
struct Surroundings {
    absolute: Vec<i32>,
    /// Width of the image and of the frame on both sides.
    stride: usize,
}

/// How far the absolute phase of a pixel may differ that is so many rows and columns away.
const MAX_DIFFERENCE: [[u32; SIDE]; SIDE] = {
    let mut limits = [[0; SIDE]; SIDE];
    let mut i = 0;
    while i < SIDE * SIDE {
        let (rows, columns) = ((i / SIDE).abs_diff(REACH_PX), (i % SIDE).abs_diff(REACH_PX));
        let away = if rows > columns { rows } else { columns };
        limits[i / SIDE][i % SIDE] = MAX_STEP as u32 * away as u32;
        i += 1;
    }
    limits
};

impl Surroundings {
    fn of(scene: &Scene<'_>, standing: &[Option<Selected>]) -> Self {
        let absolute = |pixel: usize| standing[pixel].map_or(ABSENT, |s| absolute(scene.cam1, pixel, &s));
        Self::framed(standing.len(), scene.cam1.width, absolute)
    }

    fn framed(pixels: usize, width: usize, absolute: impl Fn(usize) -> i32 + Sync) -> Self {
        let stride = width + 2 * REACH_PX;
        let height = pixels / width.max(1);
        let mut framed = vec![ABSENT; stride * (height + 2 * REACH_PX)];
        framed.par_chunks_exact_mut(stride).skip(REACH_PX).take(height).enumerate().for_each(|(v, row)| {
            let row = &mut row[REACH_PX..REACH_PX + width];
            row.iter_mut().enumerate().for_each(|(u, place)| *place = absolute(v * width + u));
        });
        Self { absolute: framed, stride }
    }

    /// How many pixels beside and around pixel u of row v stand with an absolute phase that runs on to `own`.
    fn support(&self, [u, v]: [usize; 2], own: i32) -> (u8, u8) {
        let (mut beside, mut around) = (0, 0);
        for (row, limits) in MAX_DIFFERENCE.iter().enumerate() {
            let begin = (v + row) * self.stride + u;
            let runs_on = |column: usize| {
                let difference = self.absolute[begin..begin + SIDE][column].wrapping_sub(own);
                u8::from(difference.unsigned_abs() <= limits[column])
            };
            around += (0..SIDE).map(runs_on).sum::<u8>();
            if row.abs_diff(REACH_PX) <= 1 {
                beside += (REACH_PX - 1..=REACH_PX + 1).map(runs_on).sum::<u8>();
            }
        }
        // The pixel itself is no support.
        let itself = u8::from(self.absolute[(v + REACH_PX) * self.stride + u + REACH_PX] == own);
        (beside - itself, around - itself)
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
        let surroundings = Surroundings::framed(25, 5, |pixel| absolute[pixel]);
        assert_eq!(surroundings.support([2, 2], turn / 4), (7, 18));
        assert_eq!(surroundings.support([2, 2], turn / 4 + turn), (0, 5));
        assert_eq!(surroundings.support([0, 0], 0), (2, 14));
    }
}

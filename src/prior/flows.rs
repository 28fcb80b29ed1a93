//! Flow of the scene through the images of both cameras. In: a [`Prior`] and the times of a window. Out: a [`Flow`] per
//! camera. Cost: eight projections for each square of 32 × 32 pixels.

use std::f64::consts::TAU;

use crate::geometry::{Camera, FringePattern, Pixel, Point3, Rig};
use crate::phase::{FLOW_TILE_PX, Flow, SurfaceMotion};

use super::{CELL_PX, Moment, Prior};

/// Age from which a prior is useless: a hand can do anything within a second.
const MAX_AGE_S: f64 = 1.0;
/// Most rounds in which empty tiles take the mean flow of their neighbours.
const FILL_ROUNDS: usize = 64;

impl Prior {
    /// The flows of cameras 1 and 2 during a window. `None` if the prior is too old, later than the window, or holds no
    /// point that the camera sees.
    #[must_use]
    pub fn flows(&self, rig: &Rig, pattern: &FringePattern, moment: Moment) -> Option<[Flow; 2]> {
        let Moment { age_s, spacing_s } = moment;
        let is_usable = self.motion.is_finite() && (0.0..=MAX_AGE_S).contains(&age_s) && spacing_s > 0.0;
        let cam1_size_px = [rig.cam1.width_px(), rig.cam1.height_px()];
        if !is_usable || self.relief.size_px() != cam1_size_px {
            return None;
        }
        // C1 half an image before the middle of the window, at the middle, and half an image after it. Differences
        // between the outer two are then per image.
        let cam1_now_from_then =
            [-0.5, 0.0, 0.5].map(|images| self.motion.pose_after(age_s + images * spacing_s).inverse());
        let mut tiles = [&rig.cam1, &rig.cam2].map(Tiles::from_camera);
        for ([u, v], depth_m) in self.relief.square_depths(FLOW_TILE_PX / CELL_PX) {
            let Some(ray) = rig.cam1.ray(&Pixel::new(u, v)) else { continue };
            let point = Point3::from(ray / ray.z * depth_m);
            let [before, middle, after] = cam1_now_from_then.map(|now_from_then| now_from_then * point);
            let phase_rad = |point: &Point3| Some(TAU * pattern.phase_turns(rig.project_projector(point)?.x));
            let Some(motion_rad) = phase_rad(&after).zip(phase_rad(&before)).map(|(after, before)| after - before)
            else {
                continue;
            };
            let to_camera = [|_: &Rig, p: &Point3| *p, |rig: &Rig, p: &Point3| rig.cam2_from_cam1 * p];
            for ((tiles, camera), to_camera) in tiles.iter_mut().zip([&rig.cam1, &rig.cam2]).zip(to_camera) {
                let seen = [before, middle, after].map(|point| camera.project(&to_camera(rig, &point)));
                if let [Some(before), Some(middle), Some(after)] = seen {
                    let velocity = after - before;
                    tiles.add(&middle, [velocity.x, velocity.y, motion_rad]);
                }
            }
        }
        let [cam1, cam2] = tiles;
        Some([cam1.flow()?, cam2.flow()?])
    }
}

/// Motion accumulated per tile of an image.
struct Tiles {
    size_px: [usize; 2],
    columns: usize,
    /// Sums of column and row velocity and of the phase motion, and how many were added.
    sums: Vec<Option<([f64; 3], f64)>>,
}

impl Tiles {
    fn from_camera(camera: &Camera) -> Self {
        let size_px = [camera.width_px(), camera.height_px()];
        let [columns, rows] = Flow::tile_counts(size_px);
        Self { size_px, columns, sums: vec![None; columns * rows] }
    }

    fn add(&mut self, pixel: &Pixel, motion: [f64; 3]) {
        let tile = |x: f64, length: usize| {
            let x = x + 0.5;
            (x >= 0.0 && x < length as f64).then_some(x as usize / FLOW_TILE_PX)
        };
        if let (Some(u), Some(v)) = (tile(pixel.x, self.size_px[0]), tile(pixel.y, self.size_px[1])) {
            let (sums, count) = self.sums[v * self.columns + u].get_or_insert(([0.0; 3], 0.0));
            sums.iter_mut().zip(motion).for_each(|(sum, value)| *sum += value);
            *count += 1.0;
        }
    }

    /// The mean motion of each tile. Empty tiles take the mean of their neighbours.
    fn flow(self) -> Option<Flow> {
        let Self { size_px, columns, sums } = self;
        let mean = |sum: &([f64; 3], f64)| sum.0.map(|value| value / sum.1);
        let mut tiles: Vec<Option<[f64; 3]>> = sums.iter().map(|sum| sum.as_ref().map(mean)).collect();
        for _ in 0..FILL_ROUNDS {
            if tiles.iter().all(Option::is_some) {
                break;
            }
            // Every round reads the tiles of the round before, so the order of the tiles does not matter.
            let known = tiles.clone();
            let at = |place: Option<usize>| place.and_then(|place| *known.get(place)?);
            for (place, tile) in tiles.iter_mut().enumerate().filter(|(_, tile)| tile.is_none()) {
                let column = place % columns;
                let left = (column > 0).then(|| place - 1);
                let right = (column + 1 < columns).then_some(place + 1);
                let neighbours = [at(left), at(right), at(place.checked_sub(columns)), at(Some(place + columns))];
                let found: Vec<[f64; 3]> = neighbours.into_iter().flatten().collect();
                if !found.is_empty() {
                    let sum = |k: usize| found.iter().map(|motion| motion[k]).sum::<f64>() / found.len() as f64;
                    *tile = Some(std::array::from_fn(sum));
                }
            }
        }
        let tile = |motion: Option<[f64; 3]>| {
            let [x, y, motion_rad] = motion?.map(|value| value as f32);
            Some(SurfaceMotion { velocity_px: [x, y], motion_rad })
        };
        Flow::new(size_px, tiles.into_iter().map(tile).collect::<Option<_>>()?)
    }
}

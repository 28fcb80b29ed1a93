//! The crumbs: small separate discs at random heights. No region is large enough to determine its fringe order by
//! itself.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::simulation::solid::{PointMm, Solid, cylinder};

/// Discs of 1.4 mm diameter. In images of 640 × 512 pixels, each covers about 50 pixels of C1.
pub(super) struct Crumbs {
    /// For each cell of the (x, y) plane, row by row, the centres of the discs in it and in its neighbours.
    near: Vec<Vec<PointMm>>,
}

const COUNT: usize = 120;
/// Maximum number of random positions tried.
const DRAWS: usize = 40_000;
const RADIUS: f64 = 0.7;
const HALF_THICKNESS: f64 = 0.4;
const ROUNDING: f64 = 0.2;
/// Half the extent of the positions, and their lowest and highest height, millimetres.
const HALF_EXTENT: [f64; 2] = [41.0, 31.0];
const HEIGHTS: [f64; 2] = [1.0, 22.5];
/// Centres of C1, C2 and P of the default rig, in the frame of the object.
const EYES: [[f64; 3]; 3] = [[-55.0, 0.0, 317.0], [55.0, -2.0, 316.0], [-13.0, 55.0, 320.0]];
/// Minimum distance between the lines of sight to two crumbs at half height, millimetres.
const MIN_SIGHT_DISTANCE: f64 = 2.3;

/// Side of a cell, millimetres. Discs that are not in a neighbouring cell are at least [`FAR`] away.
const CELL: f64 = 6.0;
const FAR: f64 = CELL - RADIUS;
const CELLS: [usize; 2] = [15, 12];

impl Crumbs {
    pub(super) fn new() -> Self {
        let mut near = vec![Vec::new(); CELLS[0] * CELLS[1]];
        for centre in centres() {
            let [column, row] = cell(&centre);
            for (x, y) in (column - 1..=column + 1).flat_map(|x| (row - 1..=row + 1).map(move |y| (x, y))) {
                if let Some(index) = index([x, y]) {
                    near[index].push(centre);
                }
            }
        }
        Self { near }
    }
}

/// Returns positions at which no crumb hides another from the cameras or shadows it, for the default rig.
fn centres() -> Vec<PointMm> {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut within = |[low, high]: [f64; 2]| low + (high - low) * rng.random::<f64>();
    let mut found: Vec<(PointMm, [[f64; 2]; 3])> = Vec::new();
    for _ in 0..DRAWS {
        let [x, y] = HALF_EXTENT.map(|half| within([-half, half]));
        let centre = PointMm::new(x, y, within(HEIGHTS));
        let seen = EYES.map(|eye| halfway_up(&PointMm::from(eye), &centre));
        let is_apart = |(_, other): &(_, [[f64; 2]; 3])| {
            seen.iter().zip(other).all(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) > MIN_SIGHT_DISTANCE)
        };
        if found.iter().all(is_apart) {
            found.push((centre, seen));
        }
        if found.len() == COUNT {
            break;
        }
    }
    found.into_iter().map(|(centre, _)| centre).collect()
}

/// Intersects the line of sight from an eye to a point with the plane at half height.
fn halfway_up(eye: &PointMm, target: &PointMm) -> [f64; 2] {
    let share = (eye.z - (HEIGHTS[0] + HEIGHTS[1]) / 2.0) / (eye.z - target.z);
    let point = eye + (target - eye) * share;
    [point.x, point.y]
}

fn cell(p: &PointMm) -> [isize; 2] {
    [0, 1].map(|i| (p[i] / CELL + CELLS[i] as f64 / 2.0).floor() as isize)
}

fn index([column, row]: [isize; 2]) -> Option<usize> {
    let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
    (column < CELLS[0] && row < CELLS[1]).then_some(row * CELLS[0] + column)
}

impl Solid for Crumbs {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let near = index(cell(point)).map_or(&[][..], |index| &self.near[index]);
        let disc = |centre: &PointMm| {
            let heights = [centre.z - HALF_THICKNESS, centre.z + HALF_THICKNESS];
            cylinder(point, [centre.x, centre.y], RADIUS, heights, ROUNDING)
        };
        near.iter().map(disc).fold(FAR, f64::min)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-42.0, -32.0, 0.5), PointMm::new(42.0, 32.0, 23.0))
    }
}

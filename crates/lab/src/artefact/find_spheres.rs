//! Finds balls of a known diameter among other things.
//!
//! Three points near each other and the radius give a centre. The ball with the most points near its surface is taken if
//! these cover the middle of what would be seen of it; its points are put aside, and the next one is searched. So a
//! plane, or a surface that bends as the ball only here and there, is none.

use std::collections::HashMap;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use fringeflow::geometry::{Point3, Vector3};

use super::plane::axes_across;
use super::region::thinned;
use super::sphere::{Sphere, SphereFit, through_three};

/// Seed of the samples.
const SEED: u64 = 2634;
/// Samples for each ball. A ball that holds a hundredth of the points is hit by about 40 of them.
const SAMPLES: usize = 4000;
/// Most points that are searched.
const SEARCHED: usize = 40_000;
/// Half width of the shell that counts as the surface, as a share of the radius.
const SHELL_SHARE: f64 = 0.02;
/// Largest difference between the fitted and the known radius, as a share.
const RADIUS_SHARE: f64 = 0.05;
/// Radius of the covered disc, as a share of that of the ball, its cells along each side, and how many must have points.
const DISC_SHARE: f64 = 0.7;
const DISC_CELLS: usize = 8;
const COVERED_SHARE: f64 = 0.8;
/// Smallest share of points on the shell among all points in a ball a little larger: what is inside or around a true
/// ball is little.
const SOLID_SHARE: f64 = 0.5;

/// All balls of this radius, the one with the most points first, at most `most`. The radii found are fitted.
#[must_use]
pub fn find_spheres(points: &[Point3], radius_m: f64, most: usize) -> Vec<Sphere> {
    let mut left = thinned(points, SEARCHED);
    let mut found = Vec::new();
    while found.len() < most {
        let Some(ball) = best_ball(&left, radius_m) else { break };
        left.retain(|point| (point - ball.centre).norm() > 1.1 * radius_m);
        found.push(ball);
    }
    found
}

/// Width of the cubes, as a share of the radius. A cube and its neighbours hold all within this distance.
const CUBE_SHARE: f64 = 1.1;

/// Points by cubes.
struct Cubes<'a> {
    points: &'a [Point3],
    width_m: f64,
    cubes: HashMap<[i64; 3], Vec<usize>>,
}

impl<'a> Cubes<'a> {
    fn new(points: &'a [Point3], width_m: f64) -> Self {
        let mut cubes: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
        for (i, point) in points.iter().enumerate() {
            cubes.entry(Self::key(point, width_m)).or_default().push(i);
        }
        Self { points, width_m, cubes }
    }

    fn key(point: &Point3, width_m: f64) -> [i64; 3] {
        [point.x, point.y, point.z].map(|value| (value / width_m).floor() as i64)
    }

    /// The points whose cubes are at most `reach` cubes away, in a fixed order.
    fn around(&self, point: &Point3, reach: i64) -> impl Iterator<Item = &'a Point3> + '_ {
        let [x, y, z] = Self::key(point, self.width_m);
        let side = move |centre: i64| centre - reach..=centre + reach;
        let keys = side(x).flat_map(move |x| side(y).flat_map(move |y| side(z).map(move |z| [x, y, z])));
        keys.filter_map(|key| self.cubes.get(&key)).flatten().map(|&i| &self.points[i])
    }
}

/// The ball with the most points on its surface, if it is one.
fn best_ball(points: &[Point3], radius_m: f64) -> Option<Sphere> {
    let cubes = Cubes::new(points, CUBE_SHARE * radius_m);
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let mut candidates: Vec<(usize, Point3)> = Vec::new();
    for _ in 0..SAMPLES {
        let Some(first) = points.get(random.random_range(0..points.len().max(1))) else { break };
        let near: Vec<&Point3> = cubes.around(first, 0).collect();
        let [second, third] = std::array::from_fn(|_| near[random.random_range(0..near.len())]);
        for centre in through_three([first, second, third], radius_m).into_iter().flatten() {
            let count = cubes.around(&centre, 1).filter(|point| is_on_shell(point, &centre, radius_m)).count();
            if count > 2 * DISC_CELLS * DISC_CELLS {
                candidates.push((count, centre));
            }
        }
    }
    candidates.sort_by_key(|candidate| std::cmp::Reverse(candidate.0));
    let mut refused: Vec<Point3> = Vec::new();
    for (_, centre) in candidates {
        // Its neighbours were judged already.
        if refused.iter().any(|other| (other - centre).norm() < 0.05 * radius_m) {
            continue;
        }
        match confirmed(&cubes, centre, radius_m) {
            Some(ball) => return Some(ball),
            None => refused.push(centre),
        }
    }
    None
}

fn is_on_shell(point: &Point3, centre: &Point3, radius_m: f64) -> bool {
    ((point - centre).norm() - radius_m).abs() <= SHELL_SHARE * radius_m
}

/// The fitted ball, if its points cover the middle of its visible side and are most of what is there.
fn confirmed(cubes: &Cubes<'_>, centre: Point3, radius_m: f64) -> Option<Sphere> {
    let mut ball = Sphere { centre, radius_m };
    let mut shell = Vec::new();
    for _ in 0..3 {
        shell = cubes
            .around(&ball.centre, 1)
            .filter(|point| is_on_shell(point, &ball.centre, ball.radius_m))
            .copied()
            .collect();
        ball = SphereFit::new(&shell, ball)?.sphere;
        if (ball.radius_m / radius_m - 1.0).abs() > RADIUS_SHARE || (ball.centre - centre).norm() > 0.2 * radius_m {
            return None;
        }
    }
    let axis = shell.iter().map(|point| (point - ball.centre).normalize()).sum::<Vector3>().try_normalize(0.0)?;
    let within = |point: &&Point3| {
        let away = *point - ball.centre;
        away.norm() <= (1.0 + 4.0 * SHELL_SHARE) * ball.radius_m && across(&away, &axis) <= DISC_SHARE * ball.radius_m
    };
    let all =
        cubes.around(&ball.centre, 1).filter(within).filter(|point| (*point - ball.centre).dot(&axis) > 0.0).count();
    let on_disc = shell.iter().filter(within).count();
    let is_solid = on_disc as f64 >= SOLID_SHARE * all as f64;
    (is_solid && covered_share(&shell, &ball, &axis) >= COVERED_SHARE).then_some(ball)
}

fn across(away: &Vector3, axis: &Vector3) -> f64 {
    away.cross(axis).norm()
}

/// Share of the cells of the disc that have a point of the shell.
fn covered_share(shell: &[Point3], ball: &Sphere, axis: &Vector3) -> f64 {
    let sides = axes_across(axis);
    let half = DISC_CELLS as f64 / 2.0;
    let is_cell = |column: usize, row: usize| {
        [column, row].iter().map(|&i| ((i as f64 + 0.5) / half - 1.0).powi(2)).sum::<f64>() <= 1.0
    };
    let mut hit = [[false; DISC_CELLS]; DISC_CELLS];
    for point in shell {
        let away = point - ball.centre;
        let [column, row] = sides.map(|side| (away.dot(&side) / (DISC_SHARE * ball.radius_m) + 1.0) * half);
        let is_on_grid = away.dot(axis) > 0.0 && column >= 0.0 && row >= 0.0;
        if is_on_grid && let Some(cell) = hit.get_mut(row as usize).and_then(|cells| cells.get_mut(column as usize)) {
            *cell = true;
        }
    }
    let places = (0..DISC_CELLS * DISC_CELLS).map(|i| (i % DISC_CELLS, i / DISC_CELLS));
    let disc: Vec<_> = places.filter(|&(column, row)| is_cell(column, row)).collect();
    disc.iter().filter(|&&(column, row)| hit[row][column]).count() as f64 / disc.len() as f64
}

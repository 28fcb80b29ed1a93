//! Finds the plane that most of the points lie on.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use fringeflow::geometry::Point3;

use super::plane::Plane;
use super::region::{extent_m, thinned};

/// Seed of the samples.
const SEED: u64 = 2634;
/// Number of samples of three points. If half of the points lie on the plane, a sample misses it with a probability of
/// 7/8: all of them with one of 1e-23.
const SAMPLES: usize = 400;
/// Most points that a sample is judged by.
const JUDGES: usize = 5000;
/// Half width of the band around the plane, as a share of the extent of the cloud.
pub(super) const BAND_SHARE: f64 = 0.002;
/// Rounds of least squares after the samples.
const ROUNDS: usize = 4;

/// The plane that most points lie on, the share of the points within its band, and the half width of the band, metres;
/// `None` if no three points span a plane.
#[must_use]
pub fn find_plane(points: &[Point3]) -> Option<(Plane, f64, f64)> {
    let judges = thinned(points, JUDGES);
    let band_m = BAND_SHARE * extent_m(&judges);
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let (mut best, mut most) = (None, 0);
    for _ in 0..SAMPLES {
        let [a, b, c] = std::array::from_fn(|_| judges.get(random.random_range(0..judges.len().max(1))));
        let (Some(a), Some(b), Some(c)) = (a, b, c) else { return None };
        let Some(normal) = (b - a).cross(&(c - a)).try_normalize(1e-12) else { continue };
        let plane = Plane::through(*a, normal);
        let count = judges.iter().filter(|point| plane.distance_m(point).abs() <= band_m).count();
        if count > most {
            (best, most) = (Some(plane), count);
        }
    }
    let mut plane = best?;
    for _ in 0..ROUNDS {
        let near: Vec<Point3> =
            points.iter().filter(|point| plane.distance_m(point).abs() <= band_m).copied().collect();
        plane = Plane::fit(&near)?;
    }
    let near = points.iter().filter(|point| plane.distance_m(point).abs() <= band_m).count();
    Some((plane, near as f64 / points.len() as f64, band_m))
}

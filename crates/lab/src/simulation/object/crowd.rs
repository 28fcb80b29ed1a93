//! The crowd: forty small bodies at random places. Half of them lie outside the default measurement volume, before or
//! behind it, where they are seen but not measured.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::bodies::{Bodies, Body, Shape};

/// Number of bodies inside the volume, behind and before it.
const COUNTS: [usize; 3] = [20, 10, 10];
/// Range of the heights of their centres, millimetres. The volume reaches from about 0 to 25.
const HEIGHTS: [[f64; 2]; 3] = [[5.0, 19.5], [-45.0, -10.0], [35.0, 65.0]];
/// Half the extent of their places.
const HALF_EXTENT: [f64; 2] = [44.0, 34.0];
/// Smallest gap between two bodies.
const GAP: f64 = 1.0;
/// Maximum number of random places tried for a body.
const DRAWS: usize = 4000;

/// Draws the bodies.
pub(super) fn crowd() -> Bodies {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut placed: Vec<([f64; 3], f64)> = Vec::new();
    let mut bodies = Vec::new();
    for (count, heights) in COUNTS.into_iter().zip(HEIGHTS) {
        for number in 0..count {
            let shape = shape(number, &mut rng);
            for _ in 0..DRAWS {
                let [x, y] = HALF_EXTENT.map(|half| within([-half, half], &mut rng));
                let centre = [x, y, within(heights, &mut rng)];
                let is_apart = |&(other, reach): &([f64; 3], f64)| {
                    let squares: f64 = (0..3).map(|i| (other[i] - centre[i]).powi(2)).sum();
                    squares.sqrt() > reach + shape.reach() + GAP
                };
                if placed.iter().all(is_apart) {
                    placed.push((centre, shape.reach()));
                    let turn = [0; 3].map(|_| within([-1.0, 1.0], &mut rng));
                    bodies.push(Body::new(shape, centre).turned(turn));
                    break;
                }
            }
        }
    }
    Bodies::apart(bodies)
}

/// A small shape: balls, eggs, blocks and rods in turn.
fn shape(number: usize, rng: &mut ChaCha8Rng) -> Shape {
    let mut size = |low, high| within([low, high], rng);
    match number % 4 {
        0 => Shape::Ball(size(2.0, 4.0)),
        1 => Shape::Egg([size(2.5, 4.5), size(2.0, 3.5), size(1.5, 3.0)]),
        2 => Shape::Block([size(1.5, 3.0), size(1.5, 3.0), size(1.0, 2.5)], 0.2),
        _ => Shape::Rod(size(1.0, 2.0), size(2.0, 4.0)),
    }
}

fn within([low, high]: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::Object;
    use crate::simulation::solid::Solid;

    #[test]
    fn forty_bodies_are_placed_and_half_of_them_outside_the_volume() {
        let crowd = crowd();
        let (min, max) = crowd.bounds_mm();
        let depth_mm = Object::Crowd.usual_depth_m() * 1e3;
        assert!(min.z < -10.0 && max.z > depth_mm + 10.0, "{min} {max}");
        assert_eq!(crowd.len(), COUNTS.iter().sum::<usize>());
        assert_eq!(COUNTS[0], COUNTS[1] + COUNTS[2]);
    }
}

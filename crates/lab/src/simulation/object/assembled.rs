//! Objects that are put together from simple bodies: balls on a plate, a ring, pipes, stairs, ridges with wires, and
//! isolated bodies.
//!
//! All but the isolated bodies lie on the board and within the default volume of 25 mm.

use std::f64::consts::FRAC_PI_2;

use super::bodies::{Bodies, Body, Shape};
use crate::simulation::solid::Material;

/// Position (x, y) and radius of the balls, millimetres.
const BALLS: [[f64; 3]; 11] = [
    [-32.0, 18.0, 9.5],
    [-9.0, 20.0, 7.0],
    [9.0, 22.0, 4.0],
    [27.0, 17.0, 9.0],
    [-30.0, -4.0, 3.0],
    [-14.0, -1.0, 6.0],
    [6.0, 2.0, 8.5],
    [24.0, -4.0, 5.0],
    [-27.0, -21.0, 7.5],
    [-6.0, -21.0, 4.5],
    [18.0, -20.0, 9.0],
];
/// Height of the plates under balls and ridges.
const PLATE: f64 = 3.0;

/// Balls of 6 to 19 mm diameter on a plate.
pub(super) fn balls() -> Bodies {
    let ball = |[x, y, radius]: [f64; 3]| Body::new(Shape::Ball(radius), [x, y, PLATE + radius]);
    let bodies = std::iter::once(plate()).chain(BALLS.map(ball)).collect();
    Bodies::new(bodies, ([-45.0, -34.0, 0.0], [45.0, 34.0, 22.5]))
}

/// A plate of 88 mm × 66 mm.
fn plate() -> Body {
    Body::new(Shape::Block([44.0, 33.0, PLATE / 2.0], 0.3), [0.0, 0.0, PLATE / 2.0])
}

/// A ring of 58 mm diameter, tilted, so that it hovers above the board on one side.
pub(super) fn torus() -> Bodies {
    let ring = Body::new(Shape::Ring(22.0, 7.0), [0.0, 0.0, 12.0]).turned([0.12, -0.17, 0.0]);
    Bodies::new(vec![ring], ([-30.0, -30.0, 0.2], [30.0, 30.0, 23.8]))
}

/// Pipes that lie across each other. Two stand, and show their inside.
pub(super) fn pipes() -> Bodies {
    let lying = |radii: [f64; 2], half: f64, centre: [f64; 3], turn_rad: f64| {
        Body::new(Shape::Pipe(radii, half), centre).turned([FRAC_PI_2, 0.0, turn_rad])
    };
    let standing =
        |radii: [f64; 2], half: f64, x: f64, y: f64| Body::new(Shape::Pipe(radii, half), [x, y, half]).turned([0.0; 3]);
    let bodies = vec![
        lying([5.0, 4.0], 34.0, [-8.0, -4.0, 5.0], 1.3),
        lying([3.5, 2.5], 30.0, [2.0, 2.0, 13.6], 0.4),
        lying([2.0, 1.2], 36.0, [0.0, -8.0, 19.4], 1.9),
        lying([4.0, 3.0], 20.0, [36.0, 4.0, 4.0], 0.1),
        lying([1.5, 0.8], 24.0, [-36.0, 8.0, 1.5], -0.1).of_material(Material::DARK),
        standing([8.0, 6.8], 9.0, -20.0, 22.0),
        standing([6.0, 4.5], 11.0, 22.0, -24.0).of_material(Material::GLOSSY),
    ];
    Bodies::new(bodies, ([-44.0, -34.5, 0.0], [44.0, 34.5, 22.5]))
}

/// Heights of the treads. From tread to tread they change by 1, 2, … 9 mm.
const TREADS: [f64; 10] = [11.0, 12.0, 10.0, 13.0, 9.0, 14.0, 8.0, 15.0, 7.0, 16.0];
/// Width of a tread, and half its length.
const TREAD: f64 = 8.0;
const HALF_TREAD: f64 = 27.0;

/// A flight of ten treads with steps of 1 to 9 mm up and down, turned against the columns of the cameras.
pub(super) fn stairs() -> Bodies {
    let turn_rad = 0.2_f64;
    let (sin, cos) = turn_rad.sin_cos();
    let tread = |(i, height): (usize, f64)| {
        let along = TREAD * (i as f64 - 4.5);
        let half = [TREAD / 2.0, HALF_TREAD, height / 2.0];
        Body::new(Shape::Block(half, 0.0), [cos * along, sin * along, height / 2.0]).turned([0.0, 0.0, turn_rad])
    };
    let bodies = TREADS.into_iter().enumerate().map(tread).collect();
    Bodies::new(bodies, ([-46.0, -36.0, 0.0], [46.0, 36.0, 16.5]))
}

/// Width and place of the ridges: the left ones run along the columns of the cameras, the right ones along the rows.
const RIDGES: [[f64; 2]; 6] = [[1.0, -40.0], [1.5, -35.0], [2.0, -29.5], [3.0, -23.0], [4.0, -15.5], [1.0, -10.0]];
const CROSS_RIDGES: [[f64; 2]; 6] = [[1.0, 25.0], [1.5, 20.0], [2.0, 14.0], [3.0, 7.0], [4.0, -1.0], [1.0, -7.0]];
/// Diameter and place of the wires above the plate: x or y, z.
const WIRES: [[f64; 3]; 3] = [[1.0, 8.0, 14.0], [1.5, 22.0, 18.0], [3.0, 36.0, 12.0]];
const CROSS_WIRES: [[f64; 3]; 3] = [[1.0, -16.0, 20.0], [2.0, -22.0, 11.0], [1.5, -28.0, 16.0]];
/// Height of the ridges above the plate.
const RIDGE: f64 = 6.0;

/// Ridges 1 to 4 mm wide on a plate, and wires of 1 to 3 mm above it.
pub(super) fn ridges() -> Bodies {
    let z = PLATE + RIDGE / 2.0;
    let ridge = |[width, x]: [f64; 2]| Body::new(Shape::Block([width / 2.0, 19.0, RIDGE / 2.0], 0.0), [x, 10.0, z]);
    let cross = |[width, y]: [f64; 2]| Body::new(Shape::Block([20.0, width / 2.0, RIDGE / 2.0], 0.0), [20.0, y, z]);
    let wire = |[diameter, x, z]: [f64; 3]| {
        Body::new(Shape::Rod(diameter / 2.0, 33.0), [x, 0.0, z]).turned([FRAC_PI_2, 0.0, 0.0])
    };
    let cross_wire = |[diameter, y, z]: [f64; 3]| {
        Body::new(Shape::Rod(diameter / 2.0, 43.0), [0.0, y, z]).turned([0.0, FRAC_PI_2, 0.0])
    };
    let lines = RIDGES.map(ridge).into_iter().chain(CROSS_RIDGES.map(cross));
    let wires = WIRES.map(wire).into_iter().chain(CROSS_WIRES.map(cross_wire));
    let bodies = std::iter::once(plate()).chain(lines).chain(wires).collect();
    Bodies::new(bodies, ([-45.0, -34.0, 0.0], [45.0, 34.0, 21.5]))
}

/// Isolated bodies of 5 to 18 mm at all heights of the volume, without a plate.
pub(super) fn isolated() -> Bodies {
    let block = Shape::Block([6.0, 4.0, 3.0], 0.5);
    Bodies::apart(vec![
        Body::new(Shape::Ball(7.5), [-30.0, 18.0, 9.0]),
        Body::new(block, [-4.0, 20.0, 15.0]).turned([0.2, -0.3, 0.6]),
        Body::new(Shape::Egg([8.0, 5.0, 4.0]), [24.0, 20.0, 13.0]).turned([0.1, 0.3, -0.5]),
        Body::new(Shape::Ring(6.0, 1.8), [-33.0, -14.0, 14.0]).turned([0.2, 0.1, 0.0]),
        Body::new(Shape::Rod(2.5, 7.0), [-10.0, -6.0, 8.5]).turned([1.4, 0.0, 0.8]),
        Body::new(Shape::Ball(2.5), [4.0, 2.0, 20.0]),
        Body::new(Shape::Block([4.0, 4.0, 4.0], 0.0), [17.0, -3.0, 10.0]).turned([0.3, 0.4, 0.2]),
        Body::new(Shape::Ball(4.0), [36.0, -2.0, 17.0]).of_material(Material::GLOSSY),
        Body::new(Shape::Egg([5.0, 3.0, 3.0]), [-16.0, -24.0, 6.0]).of_material(Material::DARK),
        Body::new(Shape::Rod(1.5, 8.0), [10.0, -23.0, 12.0]).turned([1.5, 0.0, -0.9]),
        Body::new(Shape::Block([7.0, 5.0, 1.5], 0.4), [32.0, -22.0, 14.0]).turned([-0.2, 0.2, 0.4]),
    ])
}

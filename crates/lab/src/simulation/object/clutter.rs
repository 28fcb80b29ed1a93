//! The clutter: solids at many heights that hide and shadow each other, some dark, some glossy.
//!
//! The cameras look from 10° to the left and right, and the projector from 10° above. So a solid 20 mm high hides and
//! shadows strips 4 mm wide. A rod and a grid hover above other solids.

use crate::simulation::solid::{
    Material, PointMm, RoundCone, Solid, cut, cylinder, length, rotated_about_z, rounded_box, sphere,
};

/// Twelve solids on 84 mm × 62 mm, up to 23 mm high.
pub(super) struct Clutter;

/// Distance field of a solid.
type Field = fn(&PointMm) -> f64;

/// The solids and their materials.
const BODIES: [(Field, Material); 12] = [
    (tower, Material::PLASTER),
    (glossy_ball, Material::GLOSSY),
    (cup, Material::PLASTER),
    (glossy_drum, Material::GLOSSY),
    (dark_crate, Material::DARK),
    (ball_on_crate, Material::PLASTER),
    (dark_post, Material::DARK),
    (ring, Material::PLASTER),
    (block, Material::PLASTER),
    (low_block, Material::DARK),
    (grid, Material::PLASTER),
    (rod, Material::PLASTER),
];

impl Solid for Clutter {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        BODIES.iter().map(|(distance, _)| distance(point)).fold(f64::INFINITY, f64::min)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-43.0, -32.0, 0.0), PointMm::new(43.0, 32.0, 23.5))
    }

    fn material(&self, point: &PointMm) -> Material {
        let nearest = BODIES.iter().min_by(|(a, _), (b, _)| a(point).total_cmp(&b(point)));
        nearest.map_or(Material::PLASTER, |&(_, material)| material)
    }
}

fn tower(p: &PointMm) -> f64 {
    let p = rotated_about_z(&(p - PointMm::new(-30.0, 17.0, 0.0)), 0.45);
    rounded_box(&p, PointMm::new(0.0, 0.0, 11.5), PointMm::new(5.0, 7.0, 11.5), 0.2)
}

fn glossy_ball(p: &PointMm) -> f64 {
    sphere(p, PointMm::new(-10.0, 17.0, 8.5), 9.0)
}

fn cup(p: &PointMm) -> f64 {
    let outside = cylinder(p, [12.0, 18.0], 9.5, [0.0, 15.0], 0.4);
    cut(outside, cylinder(p, [12.0, 18.0], 7.8, [2.0, 30.0], 0.4))
}

fn glossy_drum(p: &PointMm) -> f64 {
    cylinder(p, [33.0, 18.0], 6.5, [0.0, 20.0], 2.0)
}

fn dark_crate(p: &PointMm) -> f64 {
    let p = rotated_about_z(&(p - PointMm::new(-30.0, -17.0, 0.0)), -0.25);
    rounded_box(&p, PointMm::new(0.0, 0.0, 4.0), PointMm::new(9.0, 8.0, 4.0), 0.2)
}

fn ball_on_crate(p: &PointMm) -> f64 {
    sphere(p, PointMm::new(-30.0, -17.0, 12.5), 4.8)
}

fn dark_post(p: &PointMm) -> f64 {
    cylinder(p, [-17.0, -6.0], 2.5, [0.0, 22.0], 0.3)
}

/// A ring that hovers above the board.
fn ring(p: &PointMm) -> f64 {
    length(length(p.x + 6.0, p.y + 19.0) - 8.0, p.z - 13.0) - 1.5
}

fn block(p: &PointMm) -> f64 {
    let p = rotated_about_z(&(p - PointMm::new(5.0, -3.0, 0.0)), 0.7);
    rounded_box(&p, PointMm::new(0.0, 0.0, 6.0), PointMm::new(4.5, 3.0, 6.0), 0.0)
}

fn low_block(p: &PointMm) -> f64 {
    rounded_box(p, PointMm::new(30.0, -20.0, 3.0), PointMm::new(6.0, 5.0, 3.0), 0.0)
}

/// Distance between the axes of the bars of the grid, and the centre of the grid, millimetres.
const GRID_PITCH: f64 = 5.0;
const GRID_CENTRE: [f64; 3] = [26.0, -17.0, 16.0];

/// Five by five bars above the low block.
fn grid(p: &PointMm) -> f64 {
    let p = p - PointMm::from(GRID_CENTRE);
    let beside = |x: f64| x - (x / GRID_PITCH).round().clamp(-2.0, 2.0) * GRID_PITCH;
    let beyond = |x: f64| (x.abs() - 2.0 * GRID_PITCH).max(0.0);
    let along_x = PointMm::new(beyond(p.x), beside(p.y), p.z).norm();
    let along_y = PointMm::new(beside(p.x), beyond(p.y), p.z).norm();
    along_x.min(along_y) - 0.55
}

fn rod(p: &PointMm) -> f64 {
    let [left, right] = [PointMm::new(-41.0, 2.0, 22.0), PointMm::new(41.0, 6.0, 18.0)];
    RoundCone::new((left, 0.8), (right, 0.8)).distance(p)
}

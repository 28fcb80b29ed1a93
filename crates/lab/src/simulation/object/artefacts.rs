//! Artefacts of known size, on which a field check measures a scanner: a ball on a pin, and a ball bar.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;

use super::bodies::{Bodies, Body, Shape};

/// Radius of the balls, millimetres.
const RADIUS: f64 = 10.0;
/// Radius of the pin and of the bar, millimetres.
const ROD: f64 = 3.0;
/// Height of the centres, or of their middle, above the board, millimetres.
const HEIGHT: f64 = 12.0;
/// Distance of the two centres of the ball bar, millimetres.
const SPACING: f64 = 60.0;
/// Direction of the bar: its turn about z, and its rise. So no row or column of a camera runs along it.
const TURN_RAD: f64 = 0.3;
const RISE_RAD: f64 = 0.04;

/// A ball of 20 mm diameter on a pin.
pub(super) fn sphere() -> Bodies {
    let pin = Body::new(Shape::Rod(ROD, HEIGHT / 2.0), [0.0, 0.0, HEIGHT / 2.0]);
    let ball = Body::new(Shape::Ball(RADIUS), [0.0, 0.0, HEIGHT]);
    Bodies::new(vec![pin, ball], ([-10.5, -10.5, 0.0], [10.5, 10.5, HEIGHT + RADIUS + 0.5]))
}

/// Two balls of 20 mm diameter, 60 mm apart, on a bar.
pub(super) fn ball_bar() -> Bodies {
    let ((sin, cos), (rise, run)) = (TURN_RAD.sin_cos(), RISE_RAD.sin_cos());
    let half = Vector3::new(run * cos, run * sin, rise) * (SPACING / 2.0);
    let middle = Vector3::new(0.0, 0.0, HEIGHT);
    let ball = |side: f64| Body::new(Shape::Ball(RADIUS), (middle + half * side).into());
    let bar = Body::new(Shape::Rod(ROD, SPACING / 2.0), middle.into()).turned([0.0, FRAC_PI_2 - RISE_RAD, TURN_RAD]);
    Bodies::new(vec![bar, ball(-1.0), ball(1.0)], ([-39.5, -19.5, 0.5], [39.5, 19.5, 24.0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::solid::Solid;

    #[test]
    fn the_balls_stand_60_mm_apart_and_the_bar_joins_them() {
        let solid = ball_bar();
        let along = Vector3::new(RISE_RAD.cos() * TURN_RAD.cos(), RISE_RAD.cos() * TURN_RAD.sin(), RISE_RAD.sin());
        let at = |mm: f64| Vector3::new(0.0, 0.0, HEIGHT) + along * mm;
        assert!(solid.distance_mm(&at(40.0)).abs() < 1e-9 && solid.distance_mm(&at(-40.0)).abs() < 1e-9);
        let across = Vector3::new(-TURN_RAD.sin(), TURN_RAD.cos(), 0.0);
        assert!((solid.distance_mm(&(at(5.0) + across * 5.0)) - (5.0 - ROD)).abs() < 1e-9);
    }
}

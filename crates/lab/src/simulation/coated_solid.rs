//! A solid with another brightness, or with a gloss.

use std::sync::Arc;

use super::scene::PLASTER_ALBEDO;
use super::solid::{Material, PointMm, Solid};

/// A solid under a coat. Differences between its materials stay.
pub(super) struct CoatedSolid {
    solid: Arc<dyn Solid>,
    /// Factor of the brightness.
    brightness: f64,
    /// Specular reflection of parts that are matt without the coat.
    gloss: f64,
}

impl CoatedSolid {
    /// Coats a solid. Plaster gets the mean albedo `albedo`; `None` leaves the brightness as it is.
    pub(super) fn new(solid: Arc<dyn Solid>, albedo: Option<f64>, gloss: f64) -> Self {
        Self { solid, brightness: albedo.map_or(1.0, |albedo| albedo / PLASTER_ALBEDO), gloss }
    }
}

impl Solid for CoatedSolid {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        self.solid.distance_mm(point)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        self.solid.bounds_mm()
    }

    fn material(&self, point: &PointMm) -> Material {
        let Material { brightness, gloss } = self.solid.material(point);
        Material { brightness: brightness * self.brightness, gloss: gloss.max(self.gloss) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::Object;

    #[test]
    fn a_coat_changes_brightness_and_gloss_and_nothing_else() {
        let clutter: Arc<dyn Solid> = Object::Clutter.solid().into();
        let coated = CoatedSolid::new(clutter.clone(), Some(0.2), 0.5);
        let (tower, glossy_ball) = (PointMm::new(-30.0, 17.0, 23.0), PointMm::new(-10.0, 17.0, 17.5));
        assert_eq!(coated.material(&tower), Material { brightness: 0.25, gloss: 0.5 });
        assert_eq!(coated.material(&glossy_ball), Material { brightness: 0.45 * 0.25, gloss: 3.0 });
        assert_eq!(coated.distance_mm(&tower), clutter.distance_mm(&tower));
        let bare = CoatedSolid::new(clutter.clone(), None, 0.0);
        assert_eq!(bare.material(&glossy_ball), clutter.material(&glossy_ball));
    }
}

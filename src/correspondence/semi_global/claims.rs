//! Claims on places of C2: one place serves one order (paper, 2.2.3).

use super::super::places::Places;
use super::Scene;
use super::regions::absolute;
use super::selection::Selected;
use crate::correspondence::neighbourhood::TURN;
use crate::phase::PhaseMap;

/// Absolute phases in one place of C2 that differ by more than this are different orders.
const SAME_ORDER: i32 = TURN / 2;

/// Who claims which place of C2, and with what precedence: the greater by more than a handicap takes it.
pub(super) struct Claims<'a, P> {
    cam1: &'a PhaseMap,
    /// Places of all selected candidates.
    places: &'a Places,
    precedence: P,
    handicap: f32,
    /// For each place of the epipolar frame the greatest precedence, and the absolute phase that has it.
    owners: Vec<(f32, i32)>,
}

impl<'a, P: Fn(usize) -> f32> Claims<'a, P> {
    /// The claims of those that stand, each with the precedence of its pixel.
    pub(super) fn new(
        scene: &'a Scene<'a>,
        places: &'a Places,
        standing: &[Option<Selected>],
        precedence: P,
        handicap: f32,
    ) -> Self {
        let [width, height] = scene.table.epipolar_size_px();
        let mut owners = vec![(f32::NEG_INFINITY, 0); width * height];
        for (pixel, selected) in standing.iter().enumerate() {
            let Some(selected) = selected else { continue };
            let owner = &mut owners[places.of_pixels[pixel] as usize];
            let precedence = precedence(pixel);
            if precedence > owner.0 {
                *owner = (precedence, absolute(scene.cam1, pixel, selected));
            }
        }
        Self { cam1: scene.cam1, places, precedence, handicap, owners }
    }

    /// Whether another order takes the place that a pixel selected.
    pub(super) fn is_lost(&self, pixel: usize, selected: &Selected) -> bool {
        let precedence = (self.precedence)(pixel);
        let own = absolute(self.cam1, pixel, selected);
        let loses = |place: usize| {
            let owner = self.owners.get(place);
            owner.is_some_and(|&(greatest, other)| {
                greatest > precedence + self.handicap && (other - own).abs() > SAME_ORDER
            })
        };
        let place = self.places.of_pixels[pixel] as usize;
        // A surface that C2 sees larger than C1 leaves gaps between its claims; a gap between two is claimed too.
        loses(place) || (loses(place.wrapping_sub(1)) && loses(place + 1))
    }
}

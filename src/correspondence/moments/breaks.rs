//! Breaks: where the phase of a surface goes on and its order changes.
//!
//! ```text
//! a break: two pixels beside each other, of parts of one surface, whose absolute phases differ,
//!          though step and slope of the wrapped phase go on from the one to the other
//! component by component, the best founded first:
//!     ratio −= price · breaks to better founded components that stand
//! ```
//!
//! Where two components break one surface, one of them is wrong at least, or the surface is two surfaces whose phases
//! happen to go on. The price is what the latter costs for each pixel of contact.

use std::cmp::Ordering;

use super::verdict::Component;
use crate::correspondence::neighbourhood::MAX_STEP;
use crate::correspondence::view::View;

/// Lets components pay for breaks: pairs of components with the pixels of their contact, which are put into order.
pub(super) fn charge(components: &mut [Component], broken: &mut [[u32; 3]], price_nats: f32) {
    // The better founded component is the lesser one; of two alike, the first.
    let founded = |a: u32, b: u32| {
        let [of_a, of_b] = [a, b].map(|component| components[component as usize].nats);
        of_b.total_cmp(&of_a).then(a.cmp(&b))
    };
    for [worse, better, _] in &mut *broken {
        if founded(*worse, *better) == Ordering::Less {
            std::mem::swap(worse, better);
        }
    }
    // A component comes after all that are better founded, so what they pay is known.
    broken.sort_unstable_by(|a, b| founded(a[0], b[0]).then_with(|| founded(a[1], b[1])).then(a[2].cmp(&b[2])));
    for &[worse, better, pixels] in &*broken {
        if components[better as usize].nats >= 0.0 {
            components[worse as usize].nats -= price_nats * pixels as f32;
        }
    }
}

/// Whether step and slope of the wrapped phase of C1 go on from a pixel to the one beside or below it.
pub(super) fn goes_on(view: View<'_>, pixel: usize, next: usize) -> bool {
    let (phase, by) = (&view.cam1.phase, next - pixel);
    if pixel < by || next + by >= phase.len() {
        return false;
    }
    let step = |pixel: usize| i32::from(phase[pixel + by].wrapping_sub(phase[pixel]) as i16);
    let [before, own, after] = [pixel - by, pixel, next].map(step);
    let limit = (65536.0 * view.model.max_bend_turns) as i32;
    own.abs() <= MAX_STEP && (own - before).abs() < limit && (after - own).abs() < limit
}

#[cfg(test)]
mod tests {
    use super::*;

    fn charged(nats: &[f32], pairs: &[[u32; 3]]) -> Vec<f32> {
        let mut components: Vec<_> = nats.iter().map(|&nats| Component { nats, ..Component::default() }).collect();
        charge(&mut components, &mut pairs.to_vec(), 0.5);
        components.iter().map(|own| own.nats).collect()
    }

    #[test]
    fn the_worse_founded_component_pays() {
        assert_eq!(charged(&[3.0, 9.0], &[[0, 1, 4], [1, 0, 2]]), [0.0, 9.0]);
    }

    #[test]
    fn a_component_that_falls_costs_the_others_nothing() {
        assert_eq!(charged(&[9.0, 3.0, 2.0], &[[0, 1, 10], [1, 2, 10]]), [9.0, -2.0, 2.0]);
    }
}

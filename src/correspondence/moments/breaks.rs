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

use super::verdict::Component;
use crate::correspondence::neighbourhood::MAX_STEP;
use crate::correspondence::view::View;

/// Scratch memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Breaks {
    /// Components, the best founded first, and the place of each among them.
    order: Vec<u32>,
    rank: Vec<u32>,
    /// Ranks of the worse and of the better founded component, and pixels of contact.
    found: Vec<[u32; 3]>,
}

impl Breaks {
    /// Lets components pay for breaks: pairs of components with the pixels of their contact.
    pub(super) fn charge(
        &mut self,
        components: &mut [Component],
        pairs: impl Iterator<Item = [u32; 3]>,
        price_nats: f32,
    ) {
        let Self { order, rank, found } = self;
        order.clear();
        order.extend(0..components.len() as u32);
        let nats = |own: u32| components[own as usize].nats;
        order.sort_unstable_by(|&a, &b| nats(b).total_cmp(&nats(a)).then(a.cmp(&b)));
        rank.clear();
        rank.resize(components.len(), 0);
        (0..).zip(&*order).for_each(|(place, &own)| rank[own as usize] = place);
        found.clear();
        found.extend(pairs.map(|[a, b, pixels]| {
            let [a, b] = [a, b].map(|component| rank[component as usize]);
            [a.max(b), a.min(b), pixels]
        }));
        // A component comes after all that are better founded, so what they pay is known.
        found.sort_unstable();
        for &[worse, better, pixels] in &*found {
            let [worse, better] = [worse, better].map(|place| order[place as usize] as usize);
            if components[better].nats >= 0.0 {
                components[worse].nats -= price_nats * pixels as f32;
            }
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
        Breaks::default().charge(&mut components, pairs.iter().copied(), 0.5);
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

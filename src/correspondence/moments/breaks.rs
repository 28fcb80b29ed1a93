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
use crate::correspondence::neighbourhood::{MAX_STEP, phase_step};
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
    let limit = (65536.0 * view.model.max_bend_turns) as i32;
    bends_less(&view.cam1.phase, view.cam1.width, [pixel, next], limit)
}

/// Whether the phase bends less than this, turns · 65536, on both sides of the step from a pixel to the one beside or
/// below it. Not at the border of the image, where one of the sides is missing.
fn bends_less(phase: &[u16], width: usize, [pixel, next]: [usize; 2], limit: i32) -> bool {
    let (by, column) = (next - pixel, pixel % width);
    let has_sides = if by == 1 { column > 0 && column + 2 < width } else { pixel >= by && next + by < phase.len() };
    let step = |pixel: usize| phase_step(phase[pixel], phase[pixel + by]);
    has_sides && {
        let [before, own, after] = [pixel - by, pixel, next].map(step);
        own.abs() <= MAX_STEP && (own - before).abs() < limit && (after - own).abs() < limit
    }
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
    fn a_phase_goes_on_where_neither_side_bends_and_never_at_the_border() {
        // Rows of a plane, whose phase rises by 0.1 turns a column and 0.05 a row, through the end of the turn.
        let plane: Vec<u16> = (0..25).map(|i| (i % 5 * 6554 + i / 5 * 3277) as u16).collect();
        let goes_on = |phase: &[u16], pair: [usize; 2]| bends_less(phase, 5, pair, 2000);
        for pixel in 0..24 {
            let (column, row) = (pixel % 5, pixel / 5);
            assert_eq!(goes_on(&plane, [pixel, pixel + 1]), (1..3).contains(&column), "{pixel}");
            if row < 4 {
                assert_eq!(goes_on(&plane, [pixel, pixel + 5]), (1..3).contains(&row), "{pixel}");
            }
        }
        // A jump of half a turn, and a bend one pixel further.
        let jumps: Vec<u16> =
            plane.iter().enumerate().map(|(i, &p)| p.wrapping_add(if i % 5 > 1 { 32768 } else { 0 })).collect();
        assert!(!goes_on(&jumps, [11, 12]) && !goes_on(&jumps, [12, 13]));
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

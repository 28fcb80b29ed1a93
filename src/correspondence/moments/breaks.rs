//! Breaks: where the phase of a surface goes on and its order changes.
//!
//! ```text
//! a gap:    open pixels beside each other, from one to the next of which step and slope of the wrapped phase go on
//! a joint:  a gap, or the contact of two components whose absolute phases differ
//! pixels of a component at a gap:  those from which the phase goes on into it
//! pixels of both at a contact:     those across which the phase goes on, less 1.5 × those across which it does not
//! a joint breaks the surface between two components there that have different orders on one surface
//! component by component, the best founded first:
//!     ratio −= price · Σ over joints that break the surface between it and better founded components that stand:
//!              its pixels or those of the others, whichever are fewer
//! ```
//!
//! Where two components break one surface, one of them is wrong at least, or the surface is two surfaces whose phases
//! happen to go on. The price is what the latter costs for each pixel of the shortest cut between them; no cut through a
//! gap is longer than its sides.

use super::verdict::Component;
use crate::correspondence::neighbourhood::{MAX_STEP, phase_step};
use crate::correspondence::view::View;

/// What a pixel across which the phase ends tells against one surface, in pixels across which it goes on: ln(0.85 / 0.05) /
/// ln(0.95 / 0.15), if it goes on across 95 % of them in a surface and across 15 % where two surfaces meet. These shares are
/// assumed; the second is what phases do that have nothing in common.
const ENDS: f32 = 1.5;

/// A component at a joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub(super) component: u32,
    pub(super) joint: u32,
    pub(super) order: SurfaceOrder,
    pub(super) pixels: f32,
}

/// The label of an order on a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SurfaceOrder {
    pub(super) surface: u32,
    pub(super) label: u8,
}

impl SurfaceOrder {
    /// Whether a surface would have to break to have both orders.
    fn breaks(self, other: Self) -> bool {
        self.surface == other.surface && self.label != other.label
    }
}

/// Where two components touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// The components, the lesser first, and the orders of their parts.
    pub(super) sides: [(u32, SurfaceOrder); 2],
    /// Pixels across which the phase goes on, and across which it does not.
    pub(super) pixels: [u32; 2],
}

/// The components at the joints; kept from image to image.
#[derive(Clone, Debug, Default)]
pub(super) struct Breaks {
    pub(super) sides: Vec<Side>,
    pub(super) contacts: Vec<Contact>,
    /// What the best founded components have at each joint: their order, and pixels.
    held: Vec<Option<(SurfaceOrder, f32)>>,
}

impl Breaks {
    /// Makes joints of the contacts, after as many gaps.
    fn join_contacts(&mut self, gaps: usize) {
        let Self { sides, contacts, .. } = self;
        contacts.sort_unstable_by_key(|contact| contact.sides);
        for (joint, parts) in (gaps as u32..).zip(contacts.chunk_by(|a, b| a.sides == b.sides)) {
            let [goes_on, ends] = [0, 1].map(|i| parts.iter().map(|contact| contact.pixels[i]).sum::<u32>() as f32);
            let pixels = goes_on - ENDS * ends;
            if pixels > 0.0 {
                sides.extend(parts[0].sides.map(|(component, order)| Side { component, joint, order, pixels }));
            }
        }
    }

    /// Lets components pay for breaks at so many gaps, of which the sides are known, and at contacts.
    pub(super) fn charge(&mut self, gaps: usize, components: &mut [Component], price_nats: f32) {
        self.join_contacts(gaps);
        let Self { sides, held, .. } = self;
        let founded = |side: &Side| components[side.component as usize].nats;
        let place = |side: &Side| (side.component, side.joint, side.order);
        // A component comes after all that are better founded, so what they pay is known.
        sides.sort_unstable_by(|a, b| founded(b).total_cmp(&founded(a)).then(place(a).cmp(&place(b))));
        sides.dedup_by(|next, own| {
            let is_same = place(next) == place(own);
            own.pixels += if is_same { next.pixels } else { 0.0 };
            is_same
        });
        held.clear();
        held.resize(sides.iter().map(|side| side.joint as usize + 1).max().unwrap_or_default(), None);
        for sides in sides.chunk_by(|a, b| a.component == b.component) {
            let cut_px = |side: &Side| match held[side.joint as usize] {
                Some((order, pixels)) if order.breaks(side.order) => pixels.min(side.pixels),
                _ => 0.0,
            };
            let cut_px: f32 = sides.iter().map(cut_px).sum();
            let component = &mut components[sides[0].component as usize];
            component.nats -= price_nats * cut_px;
            if component.nats < 0.0 {
                continue;
            }
            for side in sides {
                let (order, pixels) = held[side.joint as usize].get_or_insert((side.order, 0.0));
                *pixels += if *order == side.order { side.pixels } else { 0.0 };
            }
        }
    }
}

/// Whether step and slope of the wrapped phase of C1 go on from a pixel to the one beside or below it. Unknown if one of
/// them, or of the pixels before and after them, is missing.
pub(super) fn goes_on(view: View<'_>, pixel: usize, next: usize) -> Option<bool> {
    let limit = (65536.0 * view.model.max_bend_turns) as i32;
    bends_less((&view.cam1.phase, &view.cam1.valid), view.cam1.width, [pixel, next], limit)
}

/// Whether the phase bends less than this, turns · 65536, on both sides of the step from a pixel to the one beside or
/// below it.
fn bends_less((phase, valid): (&[u16], &[bool]), width: usize, [pixel, next]: [usize; 2], limit: i32) -> Option<bool> {
    let (by, column) = (next - pixel, pixel % width);
    let has_sides = if by == 1 { column > 0 && column + 2 < width } else { pixel >= by && next + by < phase.len() };
    if !has_sides || ![pixel - by, pixel, next, next + by].iter().all(|&pixel| valid[pixel]) {
        return None;
    }
    let step = |pixel: usize| phase_step(phase[pixel], phase[pixel + by]);
    let [before, own, after] = [pixel - by, pixel, next].map(step);
    Some(own.abs() <= MAX_STEP && (own - before).abs() < limit && (after - own).abs() < limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ratios after components with these ones paid. Sides: component, joint, label, pixels; all on one surface.
    fn charged(nats: &[f32], sides: &[(u32, u32, u8, f32)]) -> Vec<f32> {
        let mut components: Vec<_> = nats.iter().map(|&nats| Component { nats, ..Component::default() }).collect();
        let side = |&(component, joint, label, pixels): &_| {
            let order = SurfaceOrder { surface: 0, label };
            Side { component, joint, order, pixels }
        };
        let mut breaks = Breaks { sides: sides.iter().map(side).collect(), ..Breaks::default() };
        breaks.charge(0, &mut components, 0.5);
        components.iter().map(|own| own.nats).collect()
    }

    #[test]
    fn a_phase_goes_on_where_neither_side_bends_and_is_unknown_at_the_border() {
        // Rows of a plane, whose phase rises by 0.1 turns a column and 0.05 a row, through the end of the turn.
        let plane: Vec<u16> = (0..25).map(|i| (i % 5 * 6554 + i / 5 * 3277) as u16).collect();
        let goes_on = |phase: &[u16], pair: [usize; 2]| bends_less((phase, &[true; 25]), 5, pair, 2000);
        for pixel in 0..24 {
            let (column, row) = (pixel % 5, pixel / 5);
            assert_eq!(goes_on(&plane, [pixel, pixel + 1]), (1..3).contains(&column).then_some(true), "{pixel}");
            if row < 4 {
                assert_eq!(goes_on(&plane, [pixel, pixel + 5]), (1..3).contains(&row).then_some(true), "{pixel}");
            }
        }
        // A jump of half a turn, and a bend one pixel further.
        let jumps: Vec<u16> =
            plane.iter().enumerate().map(|(i, &p)| p.wrapping_add(if i % 5 > 1 { 32768 } else { 0 })).collect();
        assert_eq!([[11, 12], [12, 13]].map(|pair| goes_on(&jumps, pair)), [Some(false); 2]);
        let mut valid = [true; 25];
        valid[13] = false;
        assert_eq!(bends_less((&plane, &valid), 5, [11, 12], 2000), None);
    }

    #[test]
    fn a_contact_breaks_a_surface_if_the_phase_goes_on_across_most_of_it() {
        let contact = |[a, b]: [u32; 2], pixels| Contact {
            sides: [(a, SurfaceOrder { surface: 0, label: 1 }), (b, SurfaceOrder { surface: 0, label: 2 })],
            pixels,
        };
        let contacts = vec![contact([1, 2], [4, 0]), contact([0, 1], [3, 2]), contact([1, 2], [3, 2])];
        let mut breaks = Breaks { contacts, ..Breaks::default() };
        breaks.join_contacts(7);
        let sides: Vec<_> = breaks.sides.iter().map(|side| (side.component, side.joint, side.pixels)).collect();
        assert_eq!(sides, [(1, 8, 4.0), (2, 8, 4.0)]);
    }

    #[test]
    fn the_worse_founded_component_pays_for_the_shorter_side() {
        assert_eq!(charged(&[3.0, 9.0], &[(0, 0, 1, 4.0), (1, 0, 2, 2.0), (0, 0, 1, 1.0)]), [2.0, 9.0]);
        assert_eq!(charged(&[3.0, 9.0], &[(0, 0, 1, 2.0), (1, 0, 2, 3.0), (1, 0, 2, 1.0)]), [2.0, 9.0]);
    }

    #[test]
    fn components_of_one_order_hold_a_joint_together() {
        assert_eq!(charged(&[3.0, 9.0, 8.0], &[(0, 0, 1, 4.0), (1, 0, 2, 2.0), (2, 0, 2, 1.0)]), [1.5, 9.0, 8.0]);
    }

    #[test]
    fn nothing_breaks_where_joints_surfaces_or_orders_do_not_meet() {
        assert_eq!(charged(&[3.0, 9.0], &[(0, 0, 1, 4.0), (1, 1, 2, 2.0)]), [3.0, 9.0]);
        assert_eq!(charged(&[3.0, 9.0], &[(0, 0, 2, 4.0), (1, 0, 2, 2.0)]), [3.0, 9.0]);
        let [own, other] = [0, 1].map(|surface| SurfaceOrder { surface, label: surface as u8 });
        assert!(!own.breaks(other));
    }

    #[test]
    fn a_component_that_falls_costs_the_others_nothing() {
        let sides = [(0, 0, 1, 10.0), (1, 0, 2, 10.0), (1, 1, 2, 10.0), (2, 1, 1, 10.0)];
        assert_eq!(charged(&[9.0, 3.0, 2.0], &sides), [9.0, -2.0, 2.0]);
    }
}

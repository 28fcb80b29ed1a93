//! Monotony along the epipolar direction (paper, 2.2.1 and 2.2.3: "the monotony of the coordinates ... and of the
//! unwrapped phase values along the epipolar lines").
//!
//! On a surface that both cameras see, the unwrapped phase rises along the epipolar line of C1 in the same order in
//! which the corresponding points lie on the line of C2:
//!
//! ```text
//! orientation = the sign that (c(k) − c(p)) / (u_k − u_p) has for most decided pixels p and their neighbours k
//! for each decided pixel p:
//!     walk along the epipolar direction on both sides while the phase continues, for less than 2π
//!         for each decided k after a rise of the unwrapped phase: does c(k) lie on the side of c(p) that it tells?
//!     p violates the monotony if more than a third of the k contradict it: a point that lies too far along the line is
//!     in order with the neighbours on one of its sides
//! ```
//!
//! "Only one coordinate is monotone": here the column of the epipolar frame. A surface seen at a grazing angle hardly
//! moves in C2, so steps of less than a pixel against the order tell nothing.

use rayon::prelude::*;

use super::image::Image;
use super::votes::{Directions, FAR, Side, walk};
use crate::correspondence::neighbourhood::TURN;

/// Least rise of the unwrapped phase that tells an order.
const MIN_RISE: i32 = TURN / 32;
/// Least step against the order that is a contradiction, pixels of the epipolar frame.
const MIN_REVERSAL_PX: f32 = 1.0;

/// How the coordinate in C2 runs with the unwrapped phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Orientation {
    Same,
    Opposite,
}

/// Neighbours of a pixel that agree with the monotony, and those that contradict it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Order {
    agreeing: u32,
    contradicting: u32,
}

impl Image<'_> {
    /// The decided pixels whose coordinate in C2 runs against the unwrapped phase along the epipolar direction.
    pub(super) fn violate_monotony(&self) -> Vec<usize> {
        let sides = self.sides(Directions::Along);
        let orientation = self.orientation(sides);
        let violates = |&pixel: &usize| {
            let Order { agreeing, contradicting } = self.order_of(pixel, sides, orientation);
            2 * contradicting > agreeing
        };
        (0..self.absolute.len()).into_par_iter().filter(violates).collect()
    }

    /// The orientation of most pairs of neighbours.
    fn orientation(&self, sides: &[Side]) -> Orientation {
        let (mut same, mut opposite) = (0_u64, 0_u64);
        for pixel in 0..self.absolute.len() {
            self.visit_steps(
                pixel,
                sides,
                |rise, step_px| {
                    if (rise > 0) == (step_px > 0.0) { same += 1 } else { opposite += 1 }
                },
            );
        }
        if same >= opposite { Orientation::Same } else { Orientation::Opposite }
    }

    /// The order of a pixel among its decided neighbours.
    fn order_of(&self, pixel: usize, sides: &[Side], orientation: Orientation) -> Order {
        let mut order = Order::default();
        self.visit_steps(pixel, sides, |rise, step_px| {
            let expected = (rise > 0) == (orientation == Orientation::Same);
            if (step_px > 0.0) == expected {
                order.agreeing += 1;
            } else if step_px.abs() >= MIN_REVERSAL_PX {
                order.contradicting += 1;
            }
        });
        order
    }

    /// Visits the decided neighbours of a decided pixel along the epipolar direction: the rise of the unwrapped phase to
    /// each, and the step of its coordinate in C2.
    fn visit_steps(&self, pixel: usize, sides: &[Side], mut visit: impl FnMut(i32, f32)) {
        let Some(own) = self.candidate(pixel) else { return };
        for &side in sides {
            walk(self.scene.view.cam1, pixel, side, FAR, |met, rise| {
                if let Some(other) = self.candidate(met).filter(|_| rise.abs() >= MIN_RISE) {
                    visit(rise, other.column_px - own.column_px);
                }
            });
        }
    }
}

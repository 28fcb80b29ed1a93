//! A body with a table of its distances, so that rays cross the space around it without asking the body itself.
//!
//! In: a body. Out: the same body; away from the surface its distances come from the nearest node of a grid, less the
//! way to that node, which no field of slope 1 undercuts. At the surface it is asked as before, so hits stay where they
//! are. The table is filled once a body; a ray then costs a third.

use rayon::prelude::*;

use super::solid::{PointMm, Solid};

/// Distance between the nodes of the grid, millimetres, as long as the body is no larger than [`MAX_NODES`] of them.
const SPACING_MM: f64 = 0.75;
/// Most nodes along a side.
const MAX_NODES: f64 = 160.0;
/// Below this distance the body itself is asked, millimetres.
const NEAR_MM: f64 = 0.15;

/// A body and the table of its distances.
pub(super) struct Tabulated {
    solid: Box<dyn Solid>,
    least: PointMm,
    spacing_mm: f64,
    nodes: [usize; 3],
    /// What the distance is at least in the cell about each node, millimetres.
    free_mm: Vec<f32>,
}

impl Tabulated {
    pub(super) fn new(solid: Box<dyn Solid>) -> Self {
        let (least, most) = solid.bounds_mm();
        let extent = most - least;
        let spacing_mm = SPACING_MM.max(extent.max() / MAX_NODES);
        let nodes: [usize; 3] = std::array::from_fn(|i| (extent[i] / spacing_mm) as usize + 2);
        let half_diagonal_mm = spacing_mm * 0.75_f64.sqrt();
        let mut free_mm = vec![0.0; nodes.iter().product()];
        free_mm.par_chunks_mut(nodes[0]).enumerate().for_each(|(row, free)| {
            for (i, free) in free.iter_mut().enumerate() {
                let node = PointMm::new(i as f64, (row % nodes[1]) as f64, (row / nodes[1]) as f64);
                *free = (solid.distance_mm(&(least + node * spacing_mm)) - half_diagonal_mm) as f32;
            }
        });
        Self { solid, least, spacing_mm, nodes, free_mm }
    }

    /// Lower bound of the distance; zero outside the table.
    fn free_mm(&self, point: &PointMm) -> f64 {
        let place = (point - self.least) / self.spacing_mm;
        let mut index = 0;
        for axis in [2, 1, 0] {
            let node = place[axis].round();
            if !(node >= 0.0 && node < self.nodes[axis] as f64) {
                return 0.0;
            }
            index = index * self.nodes[axis] + node as usize;
        }
        f64::from(self.free_mm[index])
    }
}

impl Solid for Tabulated {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let free = self.free_mm(point);
        if free > NEAR_MM { free } else { self.solid.distance_mm(point) }
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        self.solid.bounds_mm()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Object;
    use super::*;

    #[test]
    fn the_table_never_promises_more_space_than_there_is() {
        for object in Object::ALL {
            let (plain, tabulated) = (object.solid(), Tabulated::new(object.solid()));
            let (least, most) = plain.bounds_mm();
            let mut tabled = 0;
            for i in 0..40_000 {
                let place =
                    [0.819_172_513_4, 0.671_043_606_7, 0.549_700_478_0].map(|a: f64| (a * f64::from(i)).fract());
                let point = least + (most - least).component_mul(&PointMm::from(place));
                let (exact, bound) = (plain.distance_mm(&point), tabulated.distance_mm(&point));
                assert!(bound <= exact + 1e-6, "{object:?} at {point}: {bound} mm promised, {exact} mm free");
                assert!(bound == exact || bound > NEAR_MM, "{object:?} at {point}");
                tabled += usize::from(bound != exact);
            }
            assert!(tabled > 2_000, "{object:?}: the table answered {tabled} times");
        }
    }
}

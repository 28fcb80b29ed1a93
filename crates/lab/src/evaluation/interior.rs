//! Finds the interior of a scene: reference correspondences away from edges, where only the method itself can fail.
//!
//! In: the truth of a rendered scene. Out: a mask of the pixels of C1. The cost is 25 lookups per reference.

use fringeflow_dataset::RenderedTruth;

/// All neighbours of a reference up to this distance must be references too, pixels.
const REACH_PX: usize = 2;
/// Largest depth difference among these neighbours, metres.
const MAX_JUMP_M: f64 = 1e-3;

/// Returns whether each pixel is in the interior, for images of C1 with `width` pixels per row and a truth in units of
/// `unit_m`.
pub(super) fn interior(truth: &RenderedTruth, width: usize, unit_m: f64) -> Vec<bool> {
    let height = truth.reference.len() / width.max(1);
    let is_interior = |i: usize| {
        let (u, v) = (i % width, i / width);
        let fits = |at: usize, size: usize| at >= REACH_PX && at + REACH_PX < size;
        if !truth.reference[i] || !fits(u, width) || !fits(v, height) {
            return false;
        }
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for row in v - REACH_PX..=v + REACH_PX {
            for n in row * width + u - REACH_PX..=row * width + u + REACH_PX {
                if !truth.reference[n] {
                    return false;
                }
                let depth_m = f64::from(truth.point[n][2]) * unit_m;
                (least, most) = (least.min(depth_m), most.max(depth_m));
            }
        }
        most - least < MAX_JUMP_M
    };
    (0..truth.reference.len()).map(is_interior).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 12;
    const HEIGHT: usize = 9;

    /// References everywhere except at `hole`, in two depths that meet between columns 7 and 8, millimetres.
    fn truth(jump_mm: f32, hole: usize) -> RenderedTruth {
        let count = WIDTH * HEIGHT;
        let depth = |i: usize| if i % WIDTH < 8 { 300.0 } else { 300.0 + jump_mm };
        let reference: Vec<bool> = (0..count).map(|i| i != hole).collect();
        RenderedTruth {
            cam2_px: vec![[0.0; 2]; count],
            point: (0..count).map(|i| [0.0, 0.0, depth(i)]).collect(),
            seen_by_cam2: vec![true; count],
            lit: vec![true; count],
            in_volume: vec![true; count],
            measurable: reference.clone(),
            reference,
            gray_cam2_px: None,
        }
    }

    fn columns_of_middle_row(truth: &RenderedTruth) -> Vec<usize> {
        let mask = interior(truth, WIDTH, 1e-3);
        (0..WIDTH).filter(|u| mask[HEIGHT / 2 * WIDTH + u]).collect()
    }

    #[test]
    fn borders_jumps_and_holes_are_not_in_the_interior() {
        let far_corner = WIDTH * HEIGHT - 1;
        assert_eq!(columns_of_middle_row(&truth(0.5, far_corner)), [2, 3, 4, 5, 6, 7, 8, 9]);
        assert_eq!(columns_of_middle_row(&truth(1.5, far_corner)), [2, 3, 4, 5]);
        assert_eq!(columns_of_middle_row(&truth(0.5, 2 * WIDTH + 4)), [7, 8, 9]);
    }
}

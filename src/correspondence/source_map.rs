//! Maps the pixels of the epipolar frame to places in the raw image of C2.

use crate::geometry::{Camera, EpipolarFrame, Pixel};

use super::patches::{Columns, FieldRow, Nodes, PATCH_PX, POWERS, Patches};

/// Bits after the point of a place: places are counted in 1/2048 of a pixel.
pub(super) const PLACE_BITS: u32 = 11;
/// Least offset added to a place, pixels. It exceeds every side of the image, so that the bits of the sum are a whole
/// number of steps and smaller bits are lost. With 4096 a step is 1/2048 pixel; larger images have coarser steps.
const LEAST_BIAS_PX: usize = 4096;
/// A place outside of every image, pixels.
const OUTSIDE_PX: f32 = -1.0;

/// The place of each pixel of the epipolar frame in the raw image of C2, as two smooth fields.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SourceMap {
    /// Column and row, pixels; [`OUTSIDE_PX`] where the distortion model has no answer.
    pub(super) places: Patches<2>,
    bias_px: usize,
}

impl SourceMap {
    /// The map of an epipolar frame.
    pub(super) fn new(frame: &EpipolarFrame, cam2: &Camera) -> Self {
        let nodes = Nodes::from_size_px([frame.width_px(), frame.height_px()]);
        let values = nodes.map(|column, row| frame.cam2_pixel(&Pixel::new(column, row)).map(|raw| [raw.x, raw.y]));
        let places = Patches::through(nodes, &values, [OUTSIDE_PX; 2]);
        Self::with_places(places, [cam2.width_px(), cam2.height_px()])
    }

    /// A map whose places are known.
    pub(super) fn with_places(places: Patches<2>, cam2_size_px: [usize; 2]) -> Self {
        let side_px = cam2_size_px[0].max(cam2_size_px[1]);
        Self { places, bias_px: side_px.next_power_of_two().max(LEAST_BIAS_PX) }
    }

    /// The places along a row of the frame.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> SourceRow<'_> {
        SourceRow { places: self.places.row(row), bias_px: self.bias_px as f32 }
    }
}

/// The places along a row of the frame.
#[derive(Clone, Copy)]
pub(super) struct SourceRow<'a> {
    places: FieldRow<'a, 2>,
    bias_px: f32,
}

impl SourceRow<'_> {
    /// Writes the coefficients of both fields along the row to `out`, patch by patch.
    #[inline(always)]
    pub(super) fn along_row(&self, out: &mut [[[f32; POWERS]; 2]]) {
        self.places.along_row(out);
    }

    /// Columns or rows of the places of a patch, 1/2048 pixel, from the coefficients of their field. They lie below
    /// zero or beyond the image where the frame shows nothing.
    #[inline(always)]
    pub(super) fn places(&self, columns: &Columns, coefficients: &[f32; POWERS]) -> [i32; PATCH_PX] {
        let bias = self.bias_px.to_bits();
        let shift = PLACE_BITS + (bias >> 23) - (127 + 23);
        let places_px = columns.values(coefficients);
        let mut parts = [0; PATCH_PX];
        for i in 0..PATCH_PX {
            // Written as a comparison so that NaN becomes outside too.
            let place_px = if places_px[i] > OUTSIDE_PX { places_px[i] } else { OUTSIDE_PX };
            parts[i] = ((place_px + self.bias_px).to_bits().wrapping_sub(bias) as i32).wrapping_shl(shift);
        }
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Distortion, Pose, Rig, Vector3};

    /// Cameras side by side or one above the other, toed in, with the distortion of a strong wide-angle lens.
    fn rigs() -> Vec<Rig> {
        let mut rigs = Vec::new();
        for (focal_px, size_px) in [(1850.0, [640, 512]), (420.0, [640, 480]), (5200.0, [4500, 3000])] {
            for (base, turn) in [
                (Vector3::new(-0.11, 0.003, 0.02), Vector3::new(0.01, 0.38, -0.02)),
                (Vector3::new(0.002, -0.1, 0.01), Vector3::new(-0.3, 0.0, 0.05)),
            ] {
                let lens = Distortion::from_opencv(&[-0.25, 0.12, -0.002, 0.0016, -0.02]);
                let principal_px = size_px.map(|side| 0.49 * side as f64);
                let camera = Camera::new([focal_px, 1.002 * focal_px], principal_px, lens, size_px);
                rigs.push(Rig {
                    cam1: camera,
                    cam2: camera,
                    projector: camera,
                    cam2_from_cam1: Pose::new(base, turn),
                    projector_from_cam1: Pose::identity(),
                });
            }
        }
        rigs
    }

    fn places_of(map: &SourceMap, row: usize, patch: usize) -> [[i32; PATCH_PX]; 2] {
        let mut along_row = vec![[[0.0; POWERS]; 2]; 400];
        map.row(row).along_row(&mut along_row);
        along_row[patch].map(|coefficients| map.row(row).places(&Columns::new(), &coefficients))
    }

    #[test]
    fn places_err_by_less_than_a_two_hundredth_of_a_pixel() {
        let mut inside = 0;
        for rig in rigs() {
            let frame = EpipolarFrame::new(&rig).unwrap();
            let map = SourceMap::new(&frame, &rig.cam2);
            for row in (0..frame.height_px()).step_by(7) {
                for column in (row % 7..frame.width_px()).step_by(7) {
                    let exact = frame.cam2_pixel(&Pixel::new(column as f64, row as f64));
                    let exact = exact.filter(|p| rig.cam2.sees(p) && p.x >= 0.01 && p.y >= 0.01);
                    let Some(exact) = exact else { continue };
                    let parts = places_of(&map, row, column / PATCH_PX).map(|parts| parts[column % PATCH_PX]);
                    let place = parts.map(|parts| f64::from(parts) / 2048.0);
                    let off_px = (exact - Pixel::new(place[0], place[1])).amax();
                    assert!(off_px < 0.005, "{off_px} px at {column}, {row}");
                    inside += 1;
                }
            }
        }
        assert!(inside > 100_000, "only {inside} places");
    }

    #[test]
    fn a_place_outside_is_outside_the_image() {
        for side_px in [640, 5000, 60_000] {
            for place_px in [OUTSIDE_PX, -0.01, 1e9, -1e9, side_px as f32] {
                let nodes = Nodes::from_size_px([16, 16]);
                let values = nodes.map(|_, _| Some([f64::from(place_px); 2]));
                let map = SourceMap::with_places(Patches::through(nodes, &values, [0.0; 2]), [side_px; 2]);
                let [columns, _] = places_of(&map, 3, 0);
                assert!(columns.iter().all(|parts| !(0..(side_px as i32) << PLACE_BITS).contains(parts)), "{place_px}");
            }
        }
    }
}

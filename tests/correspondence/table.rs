//! The segment table against exact values, over random rigs.

use fringeflow::correspondence::{Segment, SegmentRow, SegmentTable};
use fringeflow::geometry::{EpipolarFrame, FringePattern, Pixel, Point3, Rig, Vector3};

use crate::random::Random;

/// Largest errors of a table: row, pixels; ray, at z = 1; Φ, turns. The error of Φ is allowed on top of the error of
/// the linear-fractional form through the exact phases at both ends and in the middle of the volume.
const ROW_PX: f64 = 0.002;
const RAY: f64 = 2e-6;
const PHASE_TURNS: f64 = 2e-4;

/// A rig, for exact values.
struct ExactRig {
    rig: Rig,
    pattern: FringePattern,
    frame: EpipolarFrame,
}

impl ExactRig {
    fn phase_turns(&self, ray: &Vector3, depth_m: f64) -> f64 {
        self.pattern.phase_turns(self.rig.project_projector(&Point3::from(ray * depth_m)).unwrap().x)
    }

    /// Largest error of the linear-fractional function through three phases of a ray, turns.
    fn form_error(&self, ray: &Vector3, inverse_depths: [f64; 2]) -> f64 {
        let phase_at = |share: f64| {
            let inverse = inverse_depths[0] + (inverse_depths[1] - inverse_depths[0]) * share;
            self.phase_turns(ray, 1.0 / inverse)
        };
        let (first, middle, last) = (phase_at(0.0), phase_at(0.5), phase_at(1.0));
        // With the projector at C1, the phase is constant along each ray, so the denominator is undetermined.
        let d = if (last - middle).abs() > 1e-9 {
            (2.0 * (middle - first) - (last - first)) / (last - middle)
        } else {
            0.0
        };
        let form = |share: f64| (first + (last - first + last * d) * share) / (1.0 + d * share);
        (0..=20).map(|i| f64::from(i) / 20.0).map(|share| (form(share) - phase_at(share)).abs()).fold(0.0, f64::max)
    }

    /// Errors of one segment: row, ray, Φ, and the error of the form itself.
    fn errors(&self, pixel: [usize; 2], segment: &Segment, found: [f32; 2]) -> [f64; 4] {
        let ray = self.rig.cam1.ray(&Pixel::new(pixel[0] as f64, pixel[1] as f64)).unwrap();
        let line = self.frame.line(&ray).unwrap();
        let ray_error = (f64::from(found[0]) - ray.x).abs().max((f64::from(found[1]) - ray.y).abs());
        let (begin, end) = (f64::from(segment.begin_px), f64::from(segment.end_px));
        let phase_errors = (0..=10).map(|i| begin + (end - begin) * f64::from(i) / 10.0).map(|column| {
            let exact = self.phase_turns(&ray, line.depth_of_column(column));
            (f64::from(segment.phase_turns(column as f32)) - exact).abs()
        });
        let inverse = [begin, end].map(|column| 1.0 / line.depth_of_column(column));
        let row_error = (f64::from(segment.row_px) - line.row_px).abs();
        [row_error, ray_error, phase_errors.fold(0.0, f64::max), self.form_error(&ray, inverse)]
    }
}

#[test]
fn the_table_is_as_exact_as_documented() {
    let mut random = Random(29);
    let mut compared = 0;
    for case in 0..60 {
        let (rig, volume, pattern) = random.rig();
        let frame = EpipolarFrame::new(&rig).unwrap();
        let table = SegmentTable::build(&rig, &volume, &pattern).unwrap();
        let exact = ExactRig { rig, pattern, frame };
        for pixel in (0..96 * 80).step_by(7) {
            let segment = table.segment(pixel);
            if segment.is_none() {
                continue;
            }
            let [row, ray, phase, form] = exact.errors([pixel % 96, pixel / 96], &segment, table.ray(pixel));
            assert!(row < ROW_PX && ray < RAY, "case {case}, pixel {pixel}: row {row} px, ray {ray}");
            assert!(phase < PHASE_TURNS + form, "case {case}, pixel {pixel}: {phase} turns, {form} of the form");
            compared += 1;
        }
    }
    assert!(compared > 20_000, "only {compared} segments");
}

#[test]
fn a_row_equals_its_segments_bit_by_bit() {
    let mut random = Random(31);
    let mut row = SegmentRow::default();
    for _ in 0..10 {
        let (rig, volume, pattern) = random.rig();
        let table = SegmentTable::build(&rig, &volume, &pattern).unwrap();
        for v in 0..80 {
            table.row(v, &mut row);
            for u in 0..96 {
                assert_eq!(row.segment(u), table.segment(v * 96 + u));
                assert_eq!(row.row_px[u].to_bits(), table.row_px(v * 96 + u).to_bits());
            }
        }
    }
}

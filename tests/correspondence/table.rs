//! The segment table against exact values over random rigs.

use fringeflow::correspondence::{Segment, SegmentRow, SegmentTable};
use fringeflow::geometry::{EpipolarFrame, FringePattern, Pixel, Point3, Rig, Vector3};

use crate::random::Random;

/// What a table may err by: row, pixels; ray, at z = 1; Φ, turns, beyond the error of the linear-fractional form through
/// the exact phases at both ends and in the middle of the volume.
const ROW_PX: f64 = 0.002;
const RAY: f64 = 2e-6;
const PHASE_TURNS: f64 = 2e-4;

/// A rig, and what is exact of it.
struct Exact {
    rig: Rig,
    pattern: FringePattern,
    frame: EpipolarFrame,
}

impl Exact {
    fn phase_turns(&self, ray: &Vector3, depth_m: f64) -> f64 {
        self.pattern.phase_turns(self.rig.project_projector(&Point3::from(ray * depth_m)).unwrap().x)
    }

    /// Greatest error of the linear-fractional function through three phases of a ray, turns.
    fn error_of_form(&self, ray: &Vector3, inverse_depths: [f64; 2]) -> f64 {
        let at = |place: f64| {
            let inverse = inverse_depths[0] + (inverse_depths[1] - inverse_depths[0]) * place;
            self.phase_turns(ray, 1.0 / inverse)
        };
        let (first, middle, last) = (at(0.0), at(0.5), at(1.0));
        // A projector at C1 lights each of its rays with one phase: no denominator is needed or determined.
        let d = if (last - middle).abs() > 1e-9 {
            (2.0 * (middle - first) - (last - first)) / (last - middle)
        } else {
            0.0
        };
        let form = |place: f64| (first + (last - first + last * d) * place) / (1.0 + d * place);
        (0..=20).map(|i| f64::from(i) / 20.0).map(|place| (form(place) - at(place)).abs()).fold(0.0, f64::max)
    }

    /// Errors of one segment: row, ray, Φ, and what the form itself errs by.
    fn errors(&self, pixel: [usize; 2], segment: &Segment) -> [f64; 4] {
        let ray = self.rig.cam1.ray(&Pixel::new(pixel[0] as f64, pixel[1] as f64)).unwrap();
        let line = self.frame.line(&ray).unwrap();
        let off_ray = (f64::from(segment.ray[0]) - ray.x).abs().max((f64::from(segment.ray[1]) - ray.y).abs());
        let (begin, end) = (f64::from(segment.begin_px), f64::from(segment.end_px));
        let off_phase = (0..=10).map(|i| begin + (end - begin) * f64::from(i) / 10.0).map(|column| {
            let exact = self.phase_turns(&ray, line.depth_of_column(column));
            (f64::from(segment.phase_turns(column as f32)) - exact).abs()
        });
        let inverse = [begin, end].map(|column| 1.0 / line.depth_of_column(column));
        let off_row = (f64::from(segment.row_px) - line.row_px).abs();
        [off_row, off_ray, off_phase.fold(0.0, f64::max), self.error_of_form(&ray, inverse)]
    }
}

#[test]
fn the_table_is_as_exact_as_it_says() {
    let mut random = Random(29);
    let mut compared = 0;
    for case in 0..60 {
        let (rig, volume, pattern) = random.rig();
        let frame = EpipolarFrame::new(&rig).unwrap();
        let table = SegmentTable::build(&rig, &volume, &pattern).unwrap();
        let exact = Exact { rig, pattern, frame };
        for pixel in (0..96 * 80).step_by(7) {
            let segment = table.segment(pixel);
            if segment.is_none() {
                continue;
            }
            let [row, ray, phase, form] = exact.errors([pixel % 96, pixel / 96], &segment);
            assert!(row < ROW_PX && ray < RAY, "case {case}, pixel {pixel}: row {row} px, ray {ray}");
            assert!(phase < PHASE_TURNS + form, "case {case}, pixel {pixel}: {phase} turns, {form} by the form");
            compared += 1;
        }
    }
    assert!(compared > 20_000, "only {compared} segments");
}

#[test]
fn a_row_has_the_bits_of_its_segments() {
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

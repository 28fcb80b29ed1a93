//! Tests the steps on the candidates of a tilted plane.

use super::*;
use crate::correspondence::candidates::Candidate;
use crate::correspondence::delta_statistics::DeltaStatistics;
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::moments::Model;
use crate::correspondence::neighbourhood::neighbours;
use crate::correspondence::reference_methods::test_scene::{PATTERN, Scene as Plane};
use crate::correspondence::reference_methods::{ReferenceMatch, match_along_epipolar_lines};
use crate::correspondence::search::Candidates;
use crate::correspondence::segment_table::SegmentTable;
use crate::correspondence::settings::ResolutionSettings;
use crate::correspondence::view::View;
use crate::geometry::{MeasurementVolume, Point3, Pose};
use crate::phase::{AbsolutePhase, PhaseMap};

const WIDTH: usize = 200;

/// The plane, its phases, and the matches by Gray code.
struct Seen {
    cam1: PhaseMap,
    cam2: EpipolarImage,
    table: SegmentTable,
    truth: Vec<Option<ReferenceMatch>>,
    delta: DeltaStatistics,
    settings: ResolutionSettings,
}

impl Seen {
    fn new() -> Self {
        let plane = Plane::new();
        let (min, max) = (Point3::new(-1.0, -1.0, 0.27), Point3::new(1.0, 1.0, 0.33));
        let volume = MeasurementVolume::new(Pose::identity(), min, max).unwrap();
        let table = SegmentTable::build(&plane.rig, &volume, &PATTERN).unwrap();
        let (cam1, cam2) = (plane.cam1_columns(), plane.cam2_columns());
        let truth = match_along_epipolar_lines(&plane.rig, &cam1, &cam2, Some(&volume)).unwrap();
        let delta =
            DeltaStatistics { mean_rad: 0.0, sd_rad: 0.02, noise_sd_rad: 0.002, mean_periods: 5.0, references: 1000 };
        let cam2 = EpipolarImage::resample(&wrapped(&cam2), &table).unwrap();
        Self { cam1: wrapped(&cam1), cam2, table, truth, delta, settings: ResolutionSettings::default() }
    }

    fn scene(&self) -> Scene<'_> {
        let Self { cam1, cam2, table, delta, settings, .. } = self;
        Scene { view: View { cam1, cam2, table, model: &Model::USUAL }, delta, settings }
    }

    fn gates(&self) -> [DeltaGate; 2] {
        let gate = self.delta.gate();
        [gate, DeltaGate { threshold_turns: MIN_READMISSION_TURNS, ..gate }]
    }

    /// The true candidate of each pixel that has one.
    fn true_lists(&self) -> Vec<Vec<Candidate>> {
        let all = find_candidates(&self.cam1, &self.cam2, &self.table, &self.gates()[1]);
        let is_true = |c: &&Candidate, pixel: usize| self.truth[pixel].is_some_and(|truth| truth.order == c.order);
        (0..self.truth.len())
            .map(|pixel| all.for_pixel(pixel).iter().filter(|c| is_true(c, pixel)).copied().take(1).collect())
            .collect()
    }
}

fn wrapped(absolute: &AbsolutePhase) -> PhaseMap {
    let phase = absolute.turns.iter().map(|turns| ((turns - turns.floor()) * 65536.0) as u32 as u16).collect();
    let (width, height, valid) = (absolute.width, absolute.height, absolute.valid.clone());
    PhaseMap { width, height, phase, valid, ..PhaseMap::default() }
}

/// A pixel amid others that have a true candidate.
fn amid(lists: &[Vec<Candidate>]) -> usize {
    let is_amid = |&pixel: &usize| {
        let square = (0..21).flat_map(|v| (0..21).map(move |u| pixel + v * WIDTH + u));
        square.into_iter().all(|pixel| lists.get(pixel).is_some_and(|list| list.len() == 1))
    };
    (0..lists.len()).find(is_amid).unwrap() + 10 * WIDTH + 10
}

#[test]
fn a_plane_is_found_as_by_gray_code() {
    let mut seen = Seen::new();
    // Some wrong orders pass.
    seen.delta.sd_rad = 0.3;
    let decisions = resolve(seen.scene());
    let (mut found, mut wanted) = (0, 0);
    for (pixel, truth) in seen.truth.iter().enumerate() {
        let chosen = decisions.outcomes[pixel].is_found().then(|| decisions.chosen.order[pixel]);
        wanted += usize::from(truth.is_some());
        found += usize::from(chosen.is_some());
        assert!(chosen.is_none() || chosen == truth.map(|truth| truth.order), "{pixel}");
    }
    assert!(wanted > 10_000 && found * 100 > 98 * wanted, "{found} of {wanted}");
    let several = decisions.passing.iter().filter(|passing| **passing > 1).count();
    assert!(several > 1000, "{several} pixels had several candidates");
}

#[test]
fn a_reference_has_one_candidate_and_neighbours_that_agree() {
    let seen = Seen::new();
    let mut lists = seen.true_lists();
    let pixel = amid(&lists);
    let other = pixel + 10;
    let right = lists[other][0];
    lists[other].push(Candidate { order: right.order + 1, ..right });
    let alone = lists.len() - 1;
    lists.iter_mut().skip(alone - 20 * WIDTH).for_each(Vec::clear);
    lists[alone - 5 * WIDTH - 50] = vec![lists[pixel][0]];
    let candidates = Candidates::from_pixels(&lists);
    let mut image = Image::new(seen.scene(), seen.gates(), &candidates);
    image.select_reference_correspondences();
    assert_eq!(image.outcomes[pixel], Outcome::Reference);
    assert_eq!([image.outcomes[other], image.outcomes[alone - 5 * WIDTH - 50]], [Outcome::Ambiguous; 2]);
    assert!(!image.is_decided(other) && !image.is_decided(alone - 5 * WIDTH - 50));
}

#[test]
fn one_of_several_candidates_is_chosen_by_eq_2() {
    let seen = Seen::new();
    let mut lists = seen.true_lists();
    let pixel = amid(&lists);
    let right = lists[pixel][0];
    lists[pixel] = vec![Candidate { order: right.order - 1, ..right }, right];
    let candidates = Candidates::from_pixels(&lists);
    let mut image = Image::new(seen.scene(), seen.gates(), &candidates);
    image.select_reference_correspondences();
    assert!(!image.is_decided(pixel));
    assert!(image.decide_multiple_candidates(Directions::Along, VoteRule::strict(3)) > 0);
    assert_eq!(image.candidate(pixel), Some(&right));
    assert_eq!(image.outcomes[pixel], Outcome::AlongEpipolar);
}

#[test]
fn a_small_region_of_another_order_is_contradicted() {
    let seen = Seen::new();
    let mut lists = seen.true_lists();
    let first = amid(&lists);
    // A patch of five by five pixels that all have a wrong candidate alone.
    let patch: Vec<usize> = (0..25).map(|i| first + i / 5 * WIDTH + i % 5).collect();
    patch.iter().for_each(|&pixel| lists[pixel][0].order += 1);
    let candidates = Candidates::from_pixels(&lists);
    let mut image = Image::new(seen.scene(), seen.gates(), &candidates);
    image.resolve();
    assert!(patch.iter().all(|&pixel| !image.is_decided(pixel)));
    let beside = neighbours(first, WIDTH, lists.len()).into_iter().flatten().filter(|pixel| !patch.contains(pixel));
    assert!(beside.into_iter().all(|pixel| image.is_decided(pixel)));
}

#[test]
fn a_region_whose_delta_runs_is_not_level() {
    let seen = Seen::new();
    let mut lists = seen.true_lists();
    let candidates = Candidates::from_pixels(&lists);
    let mut image = Image::new(seen.scene(), seen.gates(), &candidates);
    image.select_reference_correspondences();
    let division = image.divide(image.tolerance);
    let largest = (0..division.regions.size_px.len()).max_by_key(|&region| division.regions.size_px[region]).unwrap();
    assert!(image.level(&division)[largest]);

    // From one end of the test to the other every 20 columns.
    for (pixel, list) in lists.iter_mut().enumerate() {
        list.iter_mut().for_each(|candidate| candidate.delta = ((pixel % WIDTH % 20) as i16 - 10) * 60);
    }
    let candidates = Candidates::from_pixels(&lists);
    let mut image = Image::new(seen.scene(), seen.gates(), &candidates);
    image.select_reference_correspondences();
    let division = image.divide(ANY_DELTA);
    let largest = (0..division.regions.size_px.len()).max_by_key(|&region| division.regions.size_px[region]).unwrap();
    assert!(division.regions.size_px[largest] > 1000 && !image.level(&division)[largest]);
}

#[test]
fn of_two_orders_in_one_place_of_c2_one_stays() {
    let seen = Seen::new();
    let mut lists = seen.true_lists();
    let first = amid(&lists);
    // Forty-nine pixels claim the places of others twenty columns beside, for another order and with a level δ.
    let patch: Vec<usize> = (0..49).map(|i| first + i / 7 * WIDTH + i % 7).collect();
    for &pixel in &patch {
        let column_px = lists[pixel - 20][0].column_px;
        lists[pixel][0] = Candidate { column_px, order: lists[pixel][0].order + 3, delta: 0, slope: 0 };
    }
    let candidates = Candidates::from_pixels(&lists);
    let mut image = Image::new(seen.scene(), seen.gates(), &candidates);
    // Monotony would reject the patch before.
    (0..lists.len()).filter(|&pixel| !lists[pixel].is_empty()).for_each(|p| image.decide(p, 0, Outcome::Reference));
    assert!(image.reject_by_contradictions(Precedence::Foundation) >= 30);
    assert!(patch.iter().all(|&pixel| !image.is_decided(pixel)));
    assert!(patch.iter().all(|&pixel| image.is_decided(pixel - 20)));
}

#[test]
fn a_coordinate_that_runs_against_the_unwrapped_phase_violates_the_monotony() {
    let seen = Seen::new();
    let mut lists = seen.true_lists();
    let candidates = Candidates::from_pixels(&lists);
    let mut image = Image::new(seen.scene(), seen.gates(), &candidates);
    image.select_reference_correspondences();
    assert!(image.decided_where(|_| true).len() > 1000);
    assert_eq!(image.violate_monotony(), []);

    // A pixel whose order and δ agree with those around it, but whose point of C2 lies beyond theirs.
    let pixel = amid(&lists);
    for beyond_px in [-12.0, 12.0] {
        let column_px = lists[pixel][0].column_px;
        lists[pixel][0].column_px += beyond_px;
        let candidates = Candidates::from_pixels(&lists);
        let mut image = Image::new(seen.scene(), seen.gates(), &candidates);
        image.select_reference_correspondences();
        assert!(!image.is_decided(pixel) && image.outcomes[pixel] == Outcome::Ambiguous);
        assert!([pixel - 1, pixel + 1].iter().all(|&beside| image.is_decided(beside)));
        lists[pixel][0].column_px = column_px;
    }
}

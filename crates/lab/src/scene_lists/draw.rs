//! Draws the scenes of a list.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::kind::SceneKind;
use super::layout::Layout;
use super::{SceneError, SceneList};
use crate::simulation::{
    Arrangement, Board, BoardApart, MotionOptions, NoiseLevel, Object, RigOptions, Simulation, SimulationOptions,
    Staging, VirtualRig,
};

/// A scene of a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ListedScene {
    /// The list.
    pub list: SceneList,
    /// Number in the list.
    pub number: usize,
    /// What makes it hard.
    pub kind: SceneKind,
    /// Where cameras and projector stand.
    pub layout: Layout,
    /// Wanted number of periods on a segment, the n of Eq. 1. Depth and period of the options are chosen for it.
    pub wanted_periods: f64,
    /// Object, rig, images.
    pub options: SimulationOptions,
    /// Position, surface, motion and obstacles.
    pub staging: Staging,
}

/// Width and height of the images, pixels, and of every [`LARGE_EVERY`]-th scene and of fine objects.
const SMALL_PX: [usize; 2] = [320, 256];
const LARGE_PX: [usize; 2] = [640, 512];
const LARGE_EVERY: usize = 5;
/// The calibration error of the paper, rad, and the largest multiple of it.
const USUAL_SD_RAD: f64 = 0.041;
const MAX_SD_FACTOR: f64 = 3.0;
/// Fewest and most periods on a segment, and fewest of ambiguous scenes.
const PERIODS: [f64; 2] = [3.0, 25.0];
const FEWEST_AMBIGUOUS: f64 = 12.0;
/// Shortest fringe in the images, camera pixels. Shorter ones are lost between the pixels.
const LEAST_FRINGE_PX: f64 = 4.5;
/// Longest fringe, projector pixels, and the longest one relative to the shortest before depth and period are fitted.
const MAX_PERIOD_PX: f64 = 128.0;
const PERIOD_SPREAD: f64 = 2.5;
/// Largest depth of the volume, relative to its distance from the sensor.
const MAX_DEPTH_SHARE: f64 = 0.8;
const MAX_DEPTH_M: f64 = 0.3;
/// Smallest distance of the sensor from the near face of the volume with a hand, which would fill the image otherwise,
/// metres.
const HAND_ROOM_M: f64 = 0.15;
/// Albedo of the brightest part for which the exposure is chosen, at least.
const LEAST_EXPOSED_ALBEDO: f64 = 0.15;

/// Draws scene `number` of a list.
pub(super) fn draw(list: SceneList, number: usize) -> ListedScene {
    let seed = list.seed(number);
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let kind = SceneKind::ALL[number % SceneKind::ALL.len()];
    let layout = Layout::ALL[number / SceneKind::ALL.len() % Layout::ALL.len()];
    let object = *pick(kind.objects(), rng);
    let arrangement = layout.draw(rng);
    let least = if kind == SceneKind::Ambiguous { FEWEST_AMBIGUOUS } else { PERIODS[0] };
    let wanted_periods = log_within([least, PERIODS[1]], rng);
    let is_fine = matches!(object, Object::Crumbs | Object::Ridges | Object::Crowd);
    let size_px = if is_fine || number % LARGE_EVERY == LARGE_EVERY - 1 { LARGE_PX } else { SMALL_PX };
    let rig = rig(object, arrangement, size_px, wanted_periods, rng);
    let rig = RigOptions { sd_rad: sd_rad(kind, rng), lens_error: *pick(&[0.0, 0.0, 1.0], rng), seed, ..rig };
    let steps = steps(kind, rng);
    let board = board(kind, object, rng);
    let staging = staging(kind, object, &rig, steps, seed, rng);
    let noise = noise(kind, rng);
    let options = SimulationOptions {
        board,
        rig,
        steps,
        gray: false,
        white_and_black: false,
        noise,
        exposure: exposure(board, &staging),
        seed,
        ..SimulationOptions::usual(object)
    };
    ListedScene { list, number, kind, layout, wanted_periods, options, staging }
}

impl ListedScene {
    /// Names of its kind, its layout and its object.
    #[must_use]
    pub fn names(&self) -> [&'static str; 3] {
        [self.kind.name(), self.layout.name(), self.options.object.name()]
    }

    /// Traces its rays.
    ///
    /// # Errors
    /// The scene is not possible.
    pub fn simulation(&self) -> Result<Simulation, SceneError> {
        Ok(Simulation::staged(self.options, self.staging)?)
    }
}

/// A number of a range.
pub(super) fn within([low, high]: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// A number of a range whose logarithm is evenly distributed.
fn log_within([low, high]: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    within([low.ln(), high.ln()], rng).exp()
}

/// One of several.
fn pick<'a, T>(all: &'a [T], rng: &mut ChaCha8Rng) -> &'a T {
    &all[(rng.random::<f64>() * all.len() as f64) as usize]
}

fn chance(probability: f64, rng: &mut ChaCha8Rng) -> bool {
    rng.random::<f64>() < probability
}

/// A rig with the wanted number of periods: first by the depth of the volume, then by the period.
fn rig(
    object: Object,
    arrangement: Arrangement,
    size_px: [usize; 2],
    wanted_periods: f64,
    rng: &mut ChaCha8Rng,
) -> RigOptions {
    let [least_m, most_m] = [object.usual_depth_m(), (MAX_DEPTH_SHARE * arrangement.distance_m).min(MAX_DEPTH_M)];
    // Focal lengths of the cameras are those of large images.
    let magnification = arrangement.projector_focal_px / arrangement.camera_focal_px;
    let least_px = LEAST_FRINGE_PX * magnification * LARGE_PX[0] as f64 / size_px[0] as f64;
    let period_px = log_within([least_px, PERIOD_SPREAD * least_px], rng);
    let first = RigOptions { arrangement, size_px, period_px, sd_rad: 0.0, ..RigOptions::usual(least_m) };
    let periods = |rig: &RigOptions| VirtualRig::new(rig).map_or(wanted_periods, |rig| rig.mean_periods());
    let depth_m = (least_m * wanted_periods / periods(&first)).clamp(least_m, most_m);
    let deep = RigOptions { depth_m, ..first };
    let period_px = (period_px * periods(&deep) / wanted_periods).clamp(least_px, MAX_PERIOD_PX);
    RigOptions { period_px, ..deep }
}

fn sd_rad(kind: SceneKind, rng: &mut ChaCha8Rng) -> f64 {
    let least = if kind == SceneKind::Ambiguous { 1.5 } else { 0.0 };
    USUAL_SD_RAD
        * if kind != SceneKind::Ambiguous && chance(0.1, rng) { 0.0 } else { within([least, MAX_SD_FACTOR], rng) }
}

fn steps(kind: SceneKind, rng: &mut ChaCha8Rng) -> usize {
    let all = [3, 4, 4, 4, 5, 6, 7, 8, 8, 10, 12, 16];
    // The rays of every image of a moving object are traced anew.
    let moving = [3, 4, 4, 5, 6, 8];
    *if kind == SceneKind::Moving { pick(&moving, rng) } else { pick(&all, rng) }
}

fn board(kind: SceneKind, object: Object, rng: &mut ChaCha8Rng) -> Board {
    let apart = |distance_mm: f64, albedo: f64, rng: &mut ChaCha8Rng| {
        Board::Apart(BoardApart { distance_mm, albedo, tilt_deg: within([-15.0, 15.0], rng) })
    };
    match kind {
        SceneKind::Isolated => Board::None,
        SceneKind::Behind => {
            let (distance_mm, albedo) = (log_within([30.0, 1000.0], rng), within([0.05, 0.8], rng));
            apart(distance_mm, albedo, rng)
        }
        SceneKind::Before => {
            let albedo = within([0.03, 0.15], rng);
            apart(-30.0, albedo, rng)
        }
        _ if object.usual_board() == Board::None => Board::None,
        _ => *pick(&[Board::Visible, Board::Visible, Board::Dark, Board::BEHIND], rng),
    }
}

fn noise(kind: SceneKind, rng: &mut ChaCha8Rng) -> NoiseLevel {
    let usual = [NoiseLevel::Low, NoiseLevel::Normal, NoiseLevel::Normal, NoiseLevel::High];
    let dim = [NoiseLevel::Normal, NoiseLevel::High];
    *if kind == SceneKind::Dim { pick(&dim, rng) } else { pick(&usual, rng) }
}

fn staging(
    kind: SceneKind,
    object: Object,
    rig: &RigOptions,
    steps: usize,
    seed: u64,
    rng: &mut ChaCha8Rng,
) -> Staging {
    // The object stays in the depth of the volume.
    let free_mm = 450.0 * (rig.depth_m - object.usual_depth_m());
    let shift_mm = [within([-8.0, 8.0], rng), within([-6.0, 6.0], rng), within([-free_mm, free_mm], rng)];
    let may_be_small = matches!(kind, SceneKind::Isolated | SceneKind::Behind)
        && matches!(object, Object::Tooth | Object::Machine | Object::Teeth | Object::Torus | Object::Hand);
    let share_percent = (may_be_small && chance(0.6, rng)).then(|| log_within([0.5, 10.0], rng));
    let albedo = match kind {
        SceneKind::Dim => within([0.05, 0.3], rng),
        _ => within([0.3, 0.9], rng),
    };
    let gloss = if kind == SceneKind::Glossy { within([0.2, 3.0], rng) } else { 0.0 };
    let room_m = rig.arrangement.distance_m - rig.depth_m / 2.0;
    let hand = kind == SceneKind::Before && chance(0.35, rng) && room_m > HAND_ROOM_M;
    let motion = (kind == SceneKind::Moving).then(|| motion(steps, seed, rng));
    Staging { shift_mm, covered: None, share_percent, albedo: Some(albedo), gloss, hand, motion }
}

fn motion(steps: usize, seed: u64, rng: &mut ChaCha8Rng) -> MotionOptions {
    let mm_per_image = log_within([0.03, 0.4], rng);
    MotionOptions {
        mm_per_image,
        deg_per_image: 0.2 * mm_per_image,
        cycles: if steps.is_multiple_of(2) || steps == 3 { 2 } else { 3 },
        blur: 0.0,
        tremor: if chance(0.5, rng) { 0.02 } else { 0.0 },
        seed,
    }
}

/// The exposure that someone would choose: the brightest surface nearly saturates.
fn exposure(board: Board, staging: &Staging) -> f64 {
    let board = match board {
        Board::Visible => 0.62,
        // A board far behind gets less light, one before gets a little more.
        Board::Apart(board) => board.albedo * (300.0 / (300.0 + board.distance_mm)).powi(2),
        Board::None | Board::Dark => 0.0,
    };
    let object = staging.albedo.unwrap_or(0.8);
    0.8 / object.max(board).max(LEAST_EXPOSED_ALBEDO)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::scene_lists::SCENES;

    #[test]
    fn the_lists_are_long_and_share_neither_seeds_nor_draws() {
        const { assert!(SCENES >= 400) };
        let scenes: Vec<ListedScene> =
            SceneList::ALL.iter().flat_map(|list| (0..SCENES).map(|number| list.scene(number))).collect();
        let seeds: HashSet<u64> = scenes.iter().map(|scene| scene.options.seed).collect();
        let draws = |scene: &ListedScene| (scene.wanted_periods.to_bits(), scene.staging.shift_mm.map(f64::to_bits));
        let drawn: HashSet<_> = scenes.iter().map(draws).collect();
        assert_eq!((seeds.len(), drawn.len()), (2 * SCENES, 2 * SCENES));
        assert_eq!(SceneList::Judge.scene(7), SceneList::Judge.scene(7));
    }

    #[test]
    fn every_kind_meets_every_layout_and_all_objects_occur() {
        for list in SceneList::ALL {
            let scenes: Vec<ListedScene> = (0..SCENES).map(|number| list.scene(number)).collect();
            for (kind, layout) in SceneKind::ALL.into_iter().flat_map(|kind| Layout::ALL.map(|layout| (kind, layout))) {
                let count = scenes.iter().filter(|scene| scene.kind == kind && scene.layout == layout).count();
                assert_eq!(count, 6, "{kind:?}, {layout:?}");
            }
            for object in Object::ALL.into_iter().filter(|object| !object.is_artefact()) {
                assert!(scenes.iter().any(|scene| scene.options.object == object), "{object:?}");
            }
            let steps = |wanted: usize| scenes.iter().filter(|scene| scene.options.steps == wanted).count();
            assert!(steps(3) > 5 && steps(16) > 5);
        }
    }

    #[test]
    fn the_rigs_can_be_built_and_have_about_the_wanted_periods() {
        let (mut off, mut fewest, mut most) = (0, f64::INFINITY, 0.0_f64);
        for number in (0..SCENES).step_by(3) {
            let scene = SceneList::Build.scene(number);
            let rig = VirtualRig::new(&scene.options.rig).unwrap_or_else(|e| panic!("{scene:?}: {e}"));
            let periods = rig.mean_periods();
            (fewest, most) = (fewest.min(periods), most.max(periods));
            off += usize::from((periods / scene.wanted_periods - 1.0).abs() > 0.05);
        }
        assert!(off < SCENES / 30, "{off} rigs have other numbers of periods");
        assert!(fewest < 4.0 && most > 22.0, "{fewest} to {most}");
    }
}

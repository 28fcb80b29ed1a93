//! The knobs of a sweep: the parameters that it varies, and their values.
//!
//! Three knobs change the expected false candidates (efc). Two do not: a board outside the volume, and the number of
//! steps.

use serde::Serialize;

use fringeflow_lab::simulation::{Board, BoardApart, Object, RigOptions, SimulationOptions};

/// Number of phase steps in the series of the other knobs.
const STEPS: usize = 4;

/// A parameter that a series varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Knob {
    /// Depth of the measurement volume.
    Depth,
    /// Standard deviation of δ that the calibration error causes.
    Sd,
    /// Fringe period.
    Period,
    /// Distance of a grey board from the measurement volume.
    Board,
    /// Number of phase shifts.
    Steps,
}

/// A point of a series: the parameters of its scenes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::commands::evaluate) struct SeriesPoint {
    pub(super) knob: Knob,
    /// Depth of the volume; `None` for the default depth of the object.
    depth_mm: Option<f64>,
    sd_rad: f64,
    period_px: f64,
    /// Distance of the board; `None` for the default board of the object.
    board_mm: Option<f64>,
    steps: usize,
    /// Whether the paper's way is told the standard deviation of δ, instead of measuring it in the images.
    pub(super) knows_sd: bool,
}

/// Depths with an efc of about 0.1, 0.2, 0.5, 1 and 2 at the period below, millimetres.
const DEPTHS_MM: [f64; 5] = [25.0, 40.0, 90.0, 168.0, 285.0];
const DEPTH_SERIES_PERIOD_PX: f64 = 24.0;
/// Calibration errors with the same efc at the depth (mm) and period (px) below, rad.
const SDS_RAD: [f64; 5] = [0.01, 0.02, 0.05, 0.1, 0.2];
const SD_SERIES: (f64, f64) = (50.0, 16.0);
/// Periods with the same efc at the depth below, projector pixels.
const PERIODS_PX: [f64; 5] = [128.0, 64.0, 32.0, 16.0, 8.0];
const PERIOD_SERIES_DEPTH_MM: f64 = 118.0;
/// Calibration errors with an efc of about 0.05, 0.1, 0.2, 0.35, 0.5, 1, 2 and 3 at the depth below, rad.
const CLAIMED_SDS_RAD: [f64; 8] = [0.005, 0.01, 0.02, 0.035, 0.05, 0.1, 0.2, 0.3];
const CLAIMED_SDS_DEPTH_MM: f64 = 50.0;
/// Depths with an efc of about 0.2, 0.5, 1, 2 and 3 at the paper's sd and period, millimetres.
const CLAIMED_DEPTHS_MM: [f64; 5] = [26.0, 60.0, 112.0, 195.0, 260.0];
/// Distances of the board, millimetres: above 0 behind the far face of the default volume, below 0 before its near
/// face.
const BOARDS_MM: [f64; 11] = [-30.0, -15.0, -5.0, 5.0, 15.0, 40.0, 85.0, 150.0, 400.0, 700.0, 1000.0];
/// The board of that series: grey cardboard, slightly tilted.
const BOARD: BoardApart = BoardApart { distance_mm: 0.0, albedo: 0.3, tilt_deg: 5.0 };
/// All supported numbers of steps.
const ALL_STEPS: [usize; 14] = [3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16];
/// Calibration error in the series of the other knobs.
const SD_RAD: f64 = RigOptions::usual(0.0).sd_rad;

/// All points of the series of a knob.
pub(super) fn series(knob: Knob) -> Vec<SeriesPoint> {
    let base = SeriesPoint {
        knob,
        depth_mm: None,
        sd_rad: SD_RAD,
        period_px: RigOptions::usual(0.0).period_px,
        board_mm: None,
        steps: STEPS,
        knows_sd: false,
    };
    match knob {
        Knob::Depth => {
            let base = SeriesPoint { period_px: DEPTH_SERIES_PERIOD_PX, ..base };
            DEPTHS_MM.map(|depth_mm| SeriesPoint { depth_mm: Some(depth_mm), ..base }).into()
        }
        Knob::Sd => {
            let (depth_mm, period_px) = SD_SERIES;
            SDS_RAD.map(|sd_rad| SeriesPoint { depth_mm: Some(depth_mm), period_px, sd_rad, ..base }).into()
        }
        Knob::Period => {
            PERIODS_PX.map(|period_px| SeriesPoint { depth_mm: Some(PERIOD_SERIES_DEPTH_MM), period_px, ..base }).into()
        }
        Knob::Board => BOARDS_MM.map(|distance_mm| SeriesPoint { board_mm: Some(distance_mm), ..base }).into(),
        Knob::Steps => ALL_STEPS.map(|steps| SeriesPoint { steps, ..base }).into(),
    }
}

/// The points at which the claims of the paper are measured: efc of about 0.05 to 3, by the calibration error and by the
/// depth of the volume. The depth cannot make efc less than that of the paper's own volume.
pub(in crate::commands::evaluate) fn claims(quick: bool) -> Vec<SeriesPoint> {
    let base = SeriesPoint {
        knob: Knob::Sd,
        depth_mm: Some(CLAIMED_SDS_DEPTH_MM),
        sd_rad: SD_RAD,
        period_px: RigOptions::usual(0.0).period_px,
        board_mm: None,
        steps: STEPS,
        knows_sd: true,
    };
    let sds = CLAIMED_SDS_RAD.map(|sd_rad| SeriesPoint { sd_rad, ..base });
    let depths = CLAIMED_DEPTHS_MM.map(|mm| SeriesPoint { knob: Knob::Depth, depth_mm: Some(mm), ..base });
    let every = if quick { 3 } else { 1 };
    sds.into_iter().step_by(every).chain(depths.into_iter().step_by(every)).collect()
}

impl Knob {
    pub(crate) const ALL: [Self; 5] = [Self::Depth, Self::Sd, Self::Period, Self::Board, Self::Steps];
    /// The knobs that change the expected false candidates.
    pub(super) const EFC_KNOBS: [Self; 3] = [Self::Depth, Self::Sd, Self::Period];

    /// Name in the table.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Sd => "sd",
            Self::Period => "period",
            Self::Board => "board",
            Self::Steps => "steps",
        }
    }

    /// Title, with the unit.
    pub(super) fn title(self) -> &'static str {
        match self {
            Self::Depth => "depth of the volume, mm",
            Self::Sd => "calibration error, rad",
            Self::Period => "fringe period, px",
            Self::Board => "distance of the board, mm",
            Self::Steps => "phase shifts",
        }
    }
}

impl SeriesPoint {
    /// Value of the knob.
    pub(super) fn value(&self) -> f64 {
        match self.knob {
            Knob::Depth => self.depth_mm.unwrap_or_default(),
            Knob::Sd => self.sd_rad,
            Knob::Period => self.period_px,
            Knob::Board => self.board_mm.unwrap_or_default(),
            Knob::Steps => self.steps as f64,
        }
    }

    /// Simulation options for an object and images of `size_px`; `None` if the volume is shallower than the object.
    pub(super) fn options(&self, object: Object, size_px: [usize; 2]) -> Option<SimulationOptions> {
        let base = SimulationOptions { steps: self.steps, ..SimulationOptions::usual(object) };
        let depth_m = self.depth_mm.map_or(object.usual_depth_m(), |mm| mm * 1e-3);
        let board = self.board_mm.map(|distance_mm| Board::Apart(BoardApart { distance_mm, ..BOARD }));
        let rig = RigOptions { size_px, depth_m, sd_rad: self.sd_rad, period_px: self.period_px, ..base.rig };
        (depth_m >= object.usual_depth_m()).then_some(SimulationOptions {
            rig,
            board: board.unwrap_or(base.board),
            ..base
        })
    }
}

#[cfg(test)]
mod tests {
    use fringeflow_base::false_candidates::expected_false_candidates;
    use fringeflow_lab::simulation::VirtualRig;

    use super::*;

    const SIZE_PX: [usize; 2] = [640, 512];

    fn efc(point: &SeriesPoint) -> f64 {
        let rig = VirtualRig::new(&point.options(Object::Elephant, SIZE_PX).unwrap().rig).unwrap();
        expected_false_candidates(rig.deviation.delta_rms, rig.mean_periods())
    }

    #[test]
    fn the_claims_are_measured_from_few_false_candidates_to_three_a_pixel() {
        let wanted = [0.05, 0.1, 0.2, 0.35, 0.5, 1.0, 2.0, 3.0, 0.2, 0.5, 1.0, 2.0, 3.0];
        let points = claims(false);
        assert_eq!(points.len(), wanted.len());
        for (point, wanted) in points.iter().zip(wanted) {
            assert!((efc(point) / wanted - 1.0).abs() < 0.15, "{point:?}: efc {}, wanted {wanted}", efc(point));
        }
        let quick: Vec<f64> = claims(true).iter().map(efc).collect();
        assert!(quick.iter().any(|&efc| efc < 0.1) && quick.iter().any(|&efc| efc > 1.5), "{quick:?}");
    }

    #[test]
    fn every_series_goes_from_few_false_candidates_to_two_a_pixel() {
        for knob in Knob::EFC_KNOBS {
            for (efc, wanted) in series(knob).iter().map(efc).zip([0.1, 0.2, 0.5, 1.0, 2.0]) {
                assert!((efc / wanted - 1.0).abs() < 0.25, "{knob:?}: efc {efc}, wanted {wanted}");
            }
        }
    }

    #[test]
    fn no_volume_is_shallower_than_its_object() {
        let measured =
            |knob| series(knob).into_iter().filter(|point| point.options(Object::Nose, SIZE_PX).is_some()).count();
        assert_eq!(Knob::ALL.map(measured), [3, 5, 5, BOARDS_MM.len(), ALL_STEPS.len()]);
    }

    #[test]
    fn boards_go_from_before_the_volume_to_far_behind_it_and_steps_from_three_to_sixteen() {
        let ends = |knob| series(knob).first().zip(series(knob).last()).map(|(a, b)| (a.value(), b.value()));
        assert_eq!(ends(Knob::Board), Some((-30.0, 1000.0)));
        assert_eq!(ends(Knob::Steps), Some((3.0, 16.0)));
        for point in series(Knob::Board) {
            let Some(Board::Apart(board)) = point.options(Object::Tooth, SIZE_PX).map(|options| options.board) else {
                panic!("{point:?}")
            };
            assert_eq!(board.distance_mm, point.value());
        }
    }
}

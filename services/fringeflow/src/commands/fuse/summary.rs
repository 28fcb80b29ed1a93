//! Summary of a fused scan, as text and JSON.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;

use serde::Serialize;

use fringeflow_lab::evaluation::TrajectoryScores;
use fringeflow_tracking::fusion::{Tracked, Tracker, Tracking};

use crate::failure::Failure;

use super::pair_use::PairUse;
use super::scan::{Scan, ScanWindow};

/// Summary of a scan. Lengths in millimetres, angles in degrees.
#[derive(Serialize)]
pub(crate) struct Summary<'a> {
    model: &'a Path,
    surfels: usize,
    pairs: PairUse,
    clouds: usize,
    merged: usize,
    relocalized: usize,
    /// Clouds that were not merged, by reason.
    lost: BTreeMap<&'static str, usize>,
    /// The first lost cloud.
    first_lost: Option<FirstLost>,
    /// Root mean square of the distances between clouds and model.
    rms_mm: Option<f64>,
    /// Median ratio of the residuals to the noise of their points.
    excess: Option<f64>,
    /// Length of the path of camera 1.
    path_mm: f64,
    /// Standard deviation of the pose at the centre of the model: of the second cloud, of the last, and the largest.
    pose_sd_mm: Option<[f64; 3]>,
    closure: Option<ClosureSummary>,
    /// Errors of the poses; `None` if the recording has no true poses.
    truth: Option<TruthSummary>,
    /// Mean duration of tracking and fusing a cloud.
    tracking_ms: f64,
}

#[derive(Serialize)]
struct FirstLost {
    /// Number of its first image pair.
    pair: usize,
    why: String,
}

/// Drift of the tracking: the tracked pose of the last cloud against its registration to the first cloud.
#[derive(Serialize)]
struct ClosureSummary {
    drift_mm: f64,
    drift_deg: f64,
    /// Standard deviation of that registration.
    sd_mm: f64,
    share: f64,
}

/// Errors of the poses against the true ones.
#[derive(Serialize)]
struct TruthSummary {
    poses: usize,
    rms_mm: f64,
    max_mm: f64,
    last_mm: f64,
    rms_deg: f64,
    /// Errors in units of the stated standard deviations: 1 if these are right.
    rms_sd: Option<f64>,
}

impl TruthSummary {
    fn from_scores(scores: &TrajectoryScores) -> Self {
        Self {
            poses: scores.poses,
            rms_mm: scores.rms_m * 1e3,
            max_mm: scores.max_m * 1e3,
            last_mm: scores.last_m * 1e3,
            rms_deg: scores.rms_rad.to_degrees(),
            rms_sd: scores.rms_sd,
        }
    }
}

impl<'a> Summary<'a> {
    pub(crate) fn new(
        model: &'a Path,
        scan: &Scan,
        tracker: &Tracker,
        surfels: usize,
        truth: Option<&TrajectoryScores>,
        pairs: PairUse,
    ) -> Self {
        let merged: Vec<_> = scan.windows.iter().filter_map(ScanWindow::merged).collect();
        let centre = tracker.model().centre();
        let registered: Vec<_> = merged.iter().filter_map(|tracked| tracked.tracking.registration()).collect();
        let mut excess: Vec<f64> = registered.iter().map(|found| found.excess).collect();
        excess.sort_unstable_by(f64::total_cmp);
        let squares = registered.iter().map(|found| found.rms_m * found.rms_m).sum::<f64>();
        let distance_m = |(a, b): (&&Tracked, &&Tracked)| {
            (a.model_from_cam1.translation.vector - b.model_from_cam1.translation.vector).norm()
        };
        let sd_mm: Vec<f64> = merged.iter().skip(1).map(|tracked| tracked.covariance.sd_at(&centre) * 1e3).collect();
        let largest = sd_mm.iter().copied().fold(0.0, f64::max);
        let mut lost = BTreeMap::new();
        for reason in scan.windows.iter().filter_map(ScanWindow::loss_name) {
            *lost.entry(reason).or_insert(0) += 1;
        }
        Self {
            model,
            surfels,
            pairs,
            clouds: scan.windows.len(),
            merged: merged.len(),
            relocalized: merged.iter().filter(|t| matches!(t.tracking, Tracking::Relocalized(_))).count(),
            lost,
            first_lost: scan.windows.iter().find_map(|w| Some(FirstLost { pair: w.first_pair, why: w.loss_text()? })),
            rms_mm: (!registered.is_empty()).then(|| (squares / registered.len() as f64).sqrt() * 1e3),
            excess: excess.get(excess.len() / 2).copied(),
            path_mm: merged.iter().zip(merged.iter().skip(1)).map(distance_m).fold(0.0, |sum, m| sum + m) * 1e3,
            pose_sd_mm: sd_mm.first().zip(sd_mm.last()).map(|(&first, &last)| [first, last, largest]),
            closure: tracker.closure().map(|closure| ClosureSummary {
                drift_mm: closure.drift_m * 1e3,
                drift_deg: closure.drift_rad.to_degrees(),
                sd_mm: closure.direct.covariance.sd_at(&centre) * 1e3,
                share: closure.direct.share,
            }),
            truth: truth.map(TruthSummary::from_scores),
            tracking_ms: scan.tracking_time.as_secs_f64() * 1e3 / scan.windows.len().max(1) as f64,
        }
    }

    pub(crate) fn print(&self) -> Result<(), Failure> {
        let mut out = std::io::stdout().lock();
        let Self { pairs, clouds, merged, relocalized, surfels, .. } = self;
        writeln!(out, "{}: {surfels} surfels from {merged} clouds", self.model.display())?;
        writeln!(out, "image pairs {pairs}")?;
        let not_used = clouds - merged;
        writeln!(out, "clouds      {clouds}: {merged} in the model, {not_used} not used")?;
        for (reason, count) in &self.lost {
            writeln!(out, "not used    {count}: {}", reason.replace('_', " "))?;
        }
        if *relocalized > 0 {
            writeln!(out, "relocalized {relocalized} clouds of the model, after a loss")?;
        }
        if let (Some(rms_mm), Some(excess)) = (self.rms_mm, self.excess) {
            writeln!(out, "residuals   {rms_mm:.4} mm rms, {excess:.1} times the noise")?;
        }
        writeln!(out, "path        {:.2} mm", self.path_mm)?;
        if let Some([first, last, largest]) = self.pose_sd_mm {
            writeln!(out, "pose sd     first {first:.4} mm, last {last:.4} mm, largest {largest:.4} mm")?;
        }
        match &self.closure {
            Some(ClosureSummary { drift_mm, drift_deg, sd_mm, share }) => writeln!(
                out,
                "closure     last cloud to first: {drift_mm:.4} mm (sd {sd_mm:.4}), {drift_deg:.4}°; overlap {:.0} %",
                share * 100.0
            )?,
            None => writeln!(out, "closure     unknown: the last cloud overlaps too little with the first")?,
        }
        if let Some(TruthSummary { rms_mm, max_mm, last_mm, rms_deg, rms_sd, .. }) = &self.truth {
            let in_sd = rms_sd.map_or_else(String::new, |sd| format!(", {sd:.1} times their sd"));
            writeln!(
                out,
                "truth       pose error {rms_mm:.4} mm and {rms_deg:.4}° rms{in_sd}; largest {max_mm:.4} mm, \
                 last {last_mm:.4} mm"
            )?;
        }
        Ok(writeln!(out, "tracking    {:.1} ms per cloud", self.tracking_ms)?)
    }

    /// Fails if clouds were lost.
    pub(crate) fn check_losses(&self) -> Result<(), Failure> {
        let Some(FirstLost { pair, why }) = &self.first_lost else { return Ok(()) };
        let (lost, clouds) = (self.clouds - self.merged, self.clouds);
        Err(Failure::Losses(format!(
            "{lost} of {clouds} clouds are not in the model; the first begins with image pair {pair}: {why}"
        )))
    }
}

//! `fringeflow replay --verify`: recomputes the clouds of a recording in this process and compares them byte by byte.

use std::io::Write as _;

use fringeflow_recording::{Recording, Topic};
use fringeflow_replay::{VerifiedCloud, VerifiedPoses, VerifyOutcome, verify, verify_poses};

use crate::failure::Failure;
use crate::{json, progress};

use super::{Args, no_clouds};

#[derive(serde::Serialize)]
struct Report<'a> {
    clouds: usize,
    same: usize,
    different: usize,
    images_missing: usize,
    prior_missing: usize,
    before_recording: usize,
    no_cloud: usize,
    /// Poses of a tracked scanner, recomputed from the recorded clouds; `None` if it was not tracked.
    #[serde(skip_serializing_if = "Option::is_none")]
    poses: Option<VerifiedPoses>,
    results: &'a [VerifiedCloud],
}

impl Args {
    /// Verifies the clouds of a recording.
    pub(super) fn verify(&self, recording: &Recording) -> Result<(), Failure> {
        let bar = progress::bar("clouds", recording.count(Topic::Cloud) as u64);
        let results = verify(recording, |_| bar.inc(1))?;
        bar.finish_and_clear();
        let poses = (recording.count(Topic::Pose) > 0).then(|| {
            let bar = progress::bar("poses", recording.count(Topic::Pose) as u64);
            let verified = verify_poses(recording, || bar.inc(1));
            bar.finish_and_clear();
            verified
        });
        let count = |has: fn(&VerifyOutcome) -> bool| results.iter().filter(|cloud| has(&cloud.outcome)).count();
        let report = Report {
            clouds: results.len(),
            same: count(|outcome| *outcome == VerifyOutcome::Same),
            different: count(|outcome| matches!(outcome, VerifyOutcome::Different { .. })),
            images_missing: count(|outcome| *outcome == VerifyOutcome::ImagesMissing),
            prior_missing: count(|outcome| *outcome == VerifyOutcome::PriorMissing),
            before_recording: count(|outcome| *outcome == VerifyOutcome::BeforeRecording),
            no_cloud: count(|outcome| matches!(outcome, VerifyOutcome::NoCloud(_))),
            poses: poses.transpose()?,
            results: &results,
        };
        if self.json {
            json::print(&report)?;
        } else {
            self.print_verified(&report)?;
        }
        self.check_verified(&report)
    }

    fn print_verified(&self, report: &Report<'_>) -> Result<(), Failure> {
        let mut out = std::io::stdout().lock();
        for cloud in report.results {
            match &cloud.outcome {
                VerifyOutcome::Different { points, first } => writeln!(
                    out,
                    "cloud {}: {} points recorded, {points} recomputed, first difference in point {first}",
                    cloud.published, cloud.points
                )?,
                VerifyOutcome::NoCloud(why) => writeln!(out, "cloud {}: {why}", cloud.published)?,
                VerifyOutcome::Same
                | VerifyOutcome::ImagesMissing
                | VerifyOutcome::PriorMissing
                | VerifyOutcome::BeforeRecording => {}
            }
        }
        writeln!(
            out,
            "{}: {} of {} clouds are identical byte by byte, {} differ, {} lack an image, {} lack their prior, \
             {} have a window that began before the recording",
            self.input.display(),
            report.same,
            report.clouds,
            report.different + report.no_cloud,
            report.images_missing,
            report.prior_missing,
            report.before_recording
        )?;
        if let Some(VerifiedPoses { poses, same, different, without_clouds, first_different }) = report.poses {
            let first = first_different.map_or_else(String::new, |cloud| format!(", the first at cloud {cloud}"));
            writeln!(
                out,
                "{}: {same} of {poses} poses are identical bit by bit, {different} differ{first}, {without_clouds} \
                 need clouds that were not recorded",
                self.input.display()
            )?;
        }
        Ok(())
    }

    fn check_verified(&self, report: &Report<'_>) -> Result<(), Failure> {
        let file = self.input.display();
        if report.clouds == 0 {
            return Err(no_clouds(&self.input));
        }
        if let Some(poses) = report.poses.filter(|poses| poses.different > 0) {
            return Err(Failure::Mismatch(format!("{file}: {} poses differ from the recorded ones", poses.different)));
        }
        match report.different + report.no_cloud {
            0 if report.images_missing + report.prior_missing == 0 => Ok(()),
            0 => Err(Failure::Losses(format!(
                "{file}: {} clouds lack an image, {} lack their prior",
                report.images_missing, report.prior_missing
            ))),
            wrong => Err(Failure::Mismatch(format!("{file}: {wrong} clouds differ from the recorded ones"))),
        }
    }
}

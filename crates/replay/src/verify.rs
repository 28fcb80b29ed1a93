//! Recomputes every recorded cloud from its images and compares byte by byte.
//!
//! In: a recording with images and clouds. Out: the outcome of each cloud. The window of a cloud lists its images; the
//! attachments contain calibration, pattern and settings. The result does not depend on the number of threads.

use serde::Serialize;

use fringeflow::cloud::{Cloud, RECORD_BYTES, write_records};
use fringeflow::reconstruction::Reconstructor;
use fringeflow_dataset::GreyImage;
use fringeflow_message::CloudHeader;
use fringeflow_recording::{Content, Priors, Recording, RecordingProblem, Topic, WindowPrior};

use crate::{ReplayError, reconstructor};

/// A recomputed cloud.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VerifiedCloud {
    /// Number of the cloud in its channel.
    pub published: u64,
    /// Time of the cloud, the midpoint of its exposures.
    pub centre_ns: u64,
    /// Points of the recorded cloud.
    pub points: u64,
    /// Comparison of both clouds.
    pub outcome: VerifyOutcome,
}

/// Comparison of a recorded cloud with the recomputed one.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum VerifyOutcome {
    /// The bytes are equal.
    Same,
    /// The bytes differ.
    Different {
        /// Points of the recomputed cloud.
        points: u64,
        /// First point that differs.
        first: u64,
    },
    /// An image of the window is not in the recording.
    ImagesMissing,
    /// The prior of the window is not in the recording.
    PriorMissing,
    /// The window started before the recording.
    BeforeRecording,
    /// No cloud could be computed from the images, for this reason.
    NoCloud(String),
}

/// Recomputes every recorded cloud and compares it with the recorded one. Calls `each` with every result.
///
/// # Errors
/// Those of [`reconstructor`], or the file cannot be read.
pub fn verify(recording: &Recording, mut each: impl FnMut(&VerifiedCloud)) -> Result<Vec<VerifiedCloud>, ReplayError> {
    let mut reconstructor = reconstructor(recording)?;
    let priors = recording.priors()?;
    let mut verified = Vec::new();
    for message in recording.messages_of(Topic::Cloud) {
        let Content::Cloud(header, records) = message?.content else { continue };
        let outcome = verify_cloud(recording, &mut reconstructor, &priors, &header, &records)?;
        let CloudHeader { published, window, points, .. } = *header;
        let cloud = VerifiedCloud { published, centre_ns: window.centre_ns, points, outcome };
        each(&cloud);
        verified.push(cloud);
    }
    Ok(verified)
}

fn verify_cloud(
    recording: &Recording,
    reconstructor: &mut Reconstructor,
    priors: &Priors,
    header: &CloudHeader,
    records: &[u8],
) -> Result<VerifyOutcome, ReplayError> {
    let [cam1, cam2] = match recording.images(&header.window) {
        Ok(images) => images,
        Err(error) if matches!(error.problem, RecordingProblem::NoImage { .. }) => {
            let is_early = recording.begins_after(&header.window);
            return Ok(if is_early { VerifyOutcome::BeforeRecording } else { VerifyOutcome::ImagesMissing });
        }
        Err(error) => return Err(error.into()),
    };
    let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
    let WindowPrior::Used(prior) = priors.used_by(&header.window) else { return Ok(VerifyOutcome::PriorMissing) };
    Ok(match reconstructor.reconstruct(header.window.first_step as usize, &cam1, &cam2, prior) {
        Ok(recomputed) => compare(records, &recomputed.cloud),
        Err(error) => VerifyOutcome::NoCloud(error.to_string()),
    })
}

fn compare(records: &[u8], cloud: &Cloud) -> VerifyOutcome {
    let mut recomputed = Vec::with_capacity(cloud.points.len() * RECORD_BYTES);
    // Writing to a vector cannot fail.
    let _ = write_records(&mut recomputed, &cloud.points);
    if recomputed == records {
        return VerifyOutcome::Same;
    }
    let first = recomputed.iter().zip(records).take_while(|(a, b)| a == b).count() / RECORD_BYTES;
    VerifyOutcome::Different { points: cloud.points.len() as u64, first: first as u64 }
}

//! Complete recordings: messages are read unchanged, losses are counted, and no file makes the reader panic.

mod content;
mod hostile;
mod plane;
mod recorder;
mod recovery;
mod rewritten;
mod round_trip;
mod schema;
mod wall_clock;

use std::path::{Path, PathBuf};

use tempfile::TempDir;

use fringeflow::correspondence::Outcome;
use fringeflow_dataset::Setup;
use fringeflow_message::{
    CloudHeader, CorrespondenceHeader, Counts, DriftReport, DropReason, Fit, FrameHeader, GaugeReport, HealthReport,
    Incident, MapsHeader, OUTCOMES, PatternEvent, PixelFormat, PoseReport, PriorHeader, Skew, Stage, StageReport,
    TrackingState, Window, WindowReport,
};
use fringeflow_telemetry::health::{HealthState, Quantity};

use super::*;

use plane::{SIZE_PX, dataset};

struct Folder {
    folder: TempDir,
}

impl Folder {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

fn setup() -> &'static Setup {
    &dataset().setup
}

fn opening(origin: &Origin) -> Opening<'_> {
    Opening { setup: setup(), configuration: "[phase]\nmin_modulation_grey = 4.0\n", origin, min_free_bytes: 0 }
}

fn start_recording(folder: &Folder, name: &str) -> Recorder {
    Recorder::create(&folder.path(name), &opening(&Origin::default()), DEFAULT_QUEUE_BYTES).unwrap()
}

/// Finishes a recording and opens it.
fn finished(recorder: Recorder) -> Recording {
    Recording::open(&recorder.finish().unwrap().file).unwrap()
}

fn import_options() -> ImportOptions<'static> {
    ImportOptions { period_ns: 20_000_000, configuration: "", min_free_bytes: 0 }
}

fn imported(folder: &Folder) -> PathBuf {
    let path = folder.path("plane.mcap");
    import(dataset(), &path, &import_options(), || ()).unwrap();
    path
}

fn problem(path: &Path) -> RecordingProblem {
    Recording::open(path).unwrap_err().problem
}

fn window() -> Window {
    let mut window = Window { cam1_session: 5, cam2_session: 6, images: 4, first_step: 1, ..Window::default() };
    window.cam1_sequence[..4].copy_from_slice(&[11, 12, 13, 14]);
    window.cam2_sequence[..4].copy_from_slice(&[21, 22, 23, 24]);
    Window { first_exposure_ns: 100, last_exposure_ns: 400, centre_ns: 250, received_ns: 450, ..window }
}

fn frame(camera: u32, sequence: u64) -> FrameHeader {
    let [width, height] = SIZE_PX.map(|n| n as u32);
    FrameHeader {
        session: 4 + u64::from(camera),
        sequence,
        published: sequence + 1,
        exposure_start_ns: 1000 * sequence,
        received_ns: 1000 * sequence + 900,
        exposure_ns: 300,
        width_px: width,
        height_px: height,
        stride_bytes: width + 8,
        pixel_format: PixelFormat::Grey.code(),
        flags: 2,
        camera,
    }
}

fn frame_bytes(header: &FrameHeader) -> Vec<u8> {
    let count = header.stride_bytes * header.height_px;
    (0..count).map(|i| (i % 251) as u8 ^ header.sequence as u8).collect()
}

fn pattern() -> PatternEvent {
    PatternEvent {
        session: 9,
        sequence: 31,
        exposure_start_ns: 5000,
        duration_ns: 900,
        period_px: 16.25,
        step: 3,
        steps: 4,
        kind: 1,
        reserved: 0,
    }
}

fn fit(valid_pixels: u64) -> Fit {
    Fit {
        valid_pixels,
        one_surface_pixels: 7,
        lost_pixels: 3,
        residual_share: 0.125,
        noise_grey: 1.5,
        noise_gain: 0.75,
        motion_rad: -0.25,
        fast_motion_rad: 0.5,
        brightness_share: 0.015_625,
        lit_pixels: valid_pixels + 9,
        saturated_pixels: 5,
        dim_pixels: 2,
        second_harmonic_share: 0.0625,
        third_harmonic_share: 0.031_25,
        unlit_share: 0.25,
        unused_range_share: 0.125,
    }
}

fn maps() -> MapsHeader {
    let [width_px, height_px] = SIZE_PX.map(|n| n as u32);
    let [cam1, cam2] = [77, 78].map(fit);
    MapsHeader {
        published: 3,
        window: window(),
        cam1,
        cam2,
        skew_ns: -40_000,
        width_px,
        height_px,
        ..MapsHeader::default()
    }
}

fn correspondences() -> CorrespondenceHeader {
    CorrespondenceHeader {
        published: 4,
        window: window(),
        delta_mean_rad: 0.5,
        delta_sd_rad: 0.25,
        delta_noise_sd_rad: 0.125,
        mean_periods: 6.5,
        references: 1234,
        chosen_delta_mean_rad: -0.5,
        chosen_delta_sd_rad: 0.0625,
        phase_noise_grey: [1.25, 1.75],
        delta_counts: std::array::from_fn(|part| part as u32),
        width_px: 64,
        height_px: 48,
        ..CorrespondenceHeader::default()
    }
}

fn cloud(points: u64) -> CloudHeader {
    CloudHeader {
        published: 2,
        window: window(),
        points,
        delta_mean_rad: 0.0078125,
        delta_sd_rad: 0.03125,
        published_ns: 600,
        ..CloudHeader::default()
    }
}

fn report() -> StageReport {
    let mut counts = Counts { taken: 100, passed: 90, ..Counts::default() };
    counts.drop_many(DropReason::Unpaired, 7);
    counts.drop_many(DropReason::Overrun, 2);
    counts.note(Incident::TimeOut, 3);
    StageReport {
        stage: Stage::Pairing as u32,
        pid: 4711,
        restarts: 1,
        of_item: 1,
        time_ns: 7000,
        exposure_start_ns: 6000,
        received_ns: 6400,
        taken_ns: 6500,
        passed_ns: 6800,
        counts,
        skew: Skew { pairs: 45, sum_ns: -90, least_ns: -7, greatest_ns: 5 },
        ..StageReport::default()
    }
}

fn window_report() -> WindowReport {
    let mut outcomes = [0; OUTCOMES];
    outcomes[Outcome::Reference as usize] = 2000;
    outcomes[Outcome::Contradicted as usize] = 3;
    WindowReport {
        slip_steps: [0, -1],
        published: 4,
        window: window(),
        cam1: fit(77),
        cam2: fit(78),
        delta_mean_rad: 0.5,
        delta_sd_rad: 0.25,
        delta_noise_sd_rad: 0.125,
        delta_threshold_rad: 0.75,
        delta_median_rad: -0.5,
        mean_periods: 6.5,
        expected_false_candidates: 0.2,
        drift: DriftReport { rms_rad: 0.11, error_px: 0.4, share: 0.9, residual_sd_rad: 0.007, is_measured: 1 },
        skew_ns: 40_000,
        health: health_report(),
        outcomes,
        delta_counts: std::array::from_fn(|part| part as u32),
    }
}

/// Different numbers for each quantity; the second quantity is unknown.
fn health_report() -> HealthReport {
    let mut report = HealthReport::default();
    for (gauge, n) in report.gauges.iter_mut().take(Quantity::ALL.len()).zip(1_u32..) {
        let (limit, state) = (f64::from(n), HealthState::ALL[n as usize % 4] as u32);
        *gauge =
            GaugeReport { level: 0.5 * limit, warn: limit, bad: 2.0 * limit, since_ns: n.into(), state, is_known: 1 };
    }
    report.gauges[1] = GaugeReport { level: 0.0, since_ns: 0, state: 0, is_known: 0, ..report.gauges[1] };
    report
}

/// Coarse depth of a prior for images of 40 × 20 pixels.
pub(super) const RELIEF: [u8; 12] = [1, 0, 0, 80, 2, 0, 0, 0, 0, 9, 9, 9];

pub(super) fn prior_header() -> PriorHeader {
    PriorHeader {
        published: 8,
        cloud: 12,
        centre_ns: 250,
        published_ns: 800,
        velocity_m_s: [0.01, -0.02, 0.03],
        rate_rad_s: [0.5, 0.25, -0.125],
        width_px: 40,
        height_px: 20,
        drift: std::array::from_fn(|i| 0.125 * (i as f32 + 1.0)),
    }
}

pub(super) fn pose_report() -> PoseReport {
    PoseReport {
        published: 8,
        cloud: 12,
        first_cloud: 3,
        window: window(),
        published_ns: 700,
        position_m: [0.25, -0.5, 0.125],
        rotation: [0.5, -0.5, 0.5, 0.5],
        covariance: std::array::from_fn(|row| std::array::from_fn(|column| (10 * row + column) as f64)),
        sd_m: 1e-6,
        sd_rad: 1e-5,
        rms_m: 3e-5,
        excess: 1.5,
        share: 0.75,
        inliers: 5000,
        model_points: 123_456,
        model_clouds: 5,
        state: TrackingState::Relocalized as u32,
        reason: 0,
    }
}

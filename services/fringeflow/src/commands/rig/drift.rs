//! `fringeflow rig --images`: measures from images how far a calibration has drifted.

use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;

use fringeflow::correspondence::{Drift, DriftMap, ResolutionMethod};
use fringeflow::geometry::MeasurementVolume;
use fringeflow::reconstruction::{Reconstruction, Reconstructor};
use fringeflow_base::atomic_file::check_writable;
use fringeflow_config::Configuration;
use fringeflow_lab::preview::drift_picture;
use fringeflow_telemetry::health::{Limits, Quantity, median};

use crate::failure::Failure;
use crate::images::Images;
use crate::input::Input;
use crate::proposed::{Geometry, read_configuration, reconstruct, reconstructor};
use crate::{json, output_folder, progress};

use super::{Args, CalibratedRig};

/// Number of windows that are measured in a recording by default.
const DEFAULT_WINDOWS: u16 = 30;
/// Name of the drift map in the folder of --output.
const PICTURE: &str = "drift.png";

/// The drift of a calibration in the windows of an input.
#[derive(Serialize)]
struct Report<'a> {
    calibration: &'a Path,
    images: &'a Path,
    /// Number of complete windows in the input.
    windows_available: usize,
    windows: Vec<Window>,
    /// Windows without correspondences.
    unmeasured: Vec<Unmeasured>,
    #[serde(flatten)]
    summary: Summary,
}

/// The drift in one window. It is a field of δ over the volume, given about its mean.
#[derive(Clone, Debug, Serialize)]
struct Window {
    /// Number of its first image pair.
    first_image: usize,
    /// Its first exposure, seconds after that of the first image pair; `None` for a folder.
    time_s: Option<f64>,
    /// Mean of δ over the volume.
    delta_mean_rad: f64,
    /// Root mean square of the drift over the volume.
    rms_rad: f64,
    /// Largest magnitude of the drift over the volume.
    greatest_rad: f64,
    /// Standard deviation of δ.
    delta_sd_rad: f64,
    /// Standard deviation of δ about the drift.
    residual_sd_rad: f64,
    /// Calibration errors that explain the drift.
    error_px: f64,
    /// Share of the pixels with a candidate that agrees with the drift.
    share: f64,
    /// Whether most pixels have one. Otherwise the window does not count in the summary.
    counts: bool,
}

#[derive(Serialize)]
struct Unmeasured {
    first_image: usize,
    why: String,
}

/// Drift over the windows that count, rad rms.
#[derive(Debug, PartialEq, Serialize)]
struct Summary {
    first_rms_rad: Option<f64>,
    last_rms_rad: Option<f64>,
    largest_rms_rad: Option<f64>,
    median_rms_rad: Option<f64>,
    limit_rad: f64,
    /// Whether the median exceeds the limit; `None` if no window counts.
    beyond_limit: Option<bool>,
}

/// Measures and prints the drift. Draws the map of the window with the median drift.
pub(super) fn run(args: &Args, images: &Path) -> Result<(), Failure> {
    let input = Input::open(images, args.units)?;
    let mut configuration = read_configuration(args.config.as_deref(), &input)?;
    // The paper's resolution measures no drift.
    configuration.settings.matching.method = ResolutionMethod::Moments;
    let chosen = Images::windows(&input, &configuration, window_count(&input, args)?, args.steps)?;
    let calibrated = args.calibrated_rig()?;
    check_sizes(args, &calibrated, &input)?;
    let volume = volume(args, &calibrated, &configuration, &input)?;
    let geometry = Geometry { rig: &calibrated.rig, volume: &volume, pattern: &input.setup().sequence.pattern };
    if let Some(folder) = &args.output {
        output_folder::prepare(folder)?;
        check_writable(&folder.join(PICTURE))?;
    }
    let mut reconstructor = reconstructor(&input, &chosen[0], &geometry, &configuration, None)?;
    let measured = measure(&input, &mut reconstructor, &chosen)?;
    if let Some(folder) = &args.output {
        draw_median(&measured, &reconstructor, &folder.join(PICTURE))?;
    }
    let windows: Vec<Window> = measured.windows.into_iter().map(|(window, _)| window).collect();
    let report = Report {
        calibration: &args.calibration,
        images,
        windows_available: input.cycles()?.len(),
        summary: Summary::from_windows(&windows, configuration.health.limits_of(Quantity::Drift)),
        windows,
        unmeasured: measured.unmeasured,
    };
    if args.json { json::print(&report) } else { Ok(write(&mut io::stdout().lock(), &report)?) }
}

/// Number of windows to measure.
///
/// # Errors
/// The option asks for windows of a dataset folder, which has one.
fn window_count(input: &Input, args: &Args) -> Result<usize, Failure> {
    match (args.windows, input) {
        (Some(windows), Input::Folder(_)) => Err(input.unusable(&format!(
            "--windows {windows} has no effect, because a dataset folder is one window; leave it out, or give a \
             recording"
        ))),
        (windows, _) => Ok(usize::from(windows.unwrap_or(DEFAULT_WINDOWS))),
    }
}

/// The volume over which the drift is measured: that of --volume, else that of the images, else that of the
/// calibration. Drifts can only be compared over the same volume.
fn volume(
    args: &Args,
    calibrated: &CalibratedRig,
    configuration: &Configuration,
    input: &Input,
) -> Result<MeasurementVolume, Failure> {
    let given = args.volume.as_ref().and(calibrated.volume.as_ref());
    let of_images = configuration.volume.as_ref().or(input.setup().volume.as_ref());
    match given.or(of_images) {
        Some(volume) => Ok(*volume),
        None => calibrated.required_volume(&args.calibration),
    }
}

/// Fails if the images have another size than the calibration states.
fn check_sizes(args: &Args, calibrated: &CalibratedRig, input: &Input) -> Result<(), Failure> {
    let [width, height] = input.setup().image_size_px;
    for (name, camera) in [("cam1", &calibrated.rig.cam1), ("cam2", &calibrated.rig.cam2)] {
        let [w, h] = [camera.width_px(), camera.height_px()];
        if [w, h] != [width, height] {
            let (calibration, images) = (args.calibration.display(), input.path().display());
            return Err(Failure::Usage(format!(
                "{calibration}: images of {name} have {w}×{h} pixels, but those of {images} have {width}×{height}; \
                 give the calibration of the cameras that took them"
            )));
        }
    }
    Ok(())
}

/// Windows with their drift, and windows without correspondences.
struct MeasuredWindows {
    windows: Vec<(Window, Drift)>,
    unmeasured: Vec<Unmeasured>,
}

/// Measures the drift of every window.
///
/// # Errors
/// The images cannot be read, or no window has correspondences.
fn measure(input: &Input, reconstructor: &mut Reconstructor, chosen: &[Images]) -> Result<MeasuredWindows, Failure> {
    let mut measured = MeasuredWindows { windows: Vec::new(), unmeasured: Vec::new() };
    let bar = progress::bar("windows", chosen.len() as u64);
    let mut first_failure = None;
    for images in chosen {
        let first_image = images.numbers[0];
        match reconstruct(input, reconstructor, images) {
            Ok(reconstruction) => {
                measured.windows.extend(drift_of_window(input, first_image, &reconstruction, reconstructor));
            }
            Err(why @ Failure::Usage(_)) => {
                measured.unmeasured.push(Unmeasured { first_image, why: why.to_string() });
                first_failure.get_or_insert(why);
            }
            Err(failure) => return Err(failure),
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    match first_failure {
        Some(why) if measured.windows.is_empty() => Err(why),
        _ => Ok(measured),
    }
}

fn drift_of_window(
    input: &Input,
    first_image: usize,
    reconstruction: &Reconstruction,
    reconstructor: &Reconstructor,
) -> Option<(Window, Drift)> {
    let drift = reconstruction.matches.drift.clone()?;
    let window = Window {
        first_image,
        time_s: input.exposure_s(first_image),
        delta_mean_rad: drift.mean_rad,
        rms_rad: drift.rms_rad,
        greatest_rad: f64::from(DriftMap::new(&drift, reconstructor.table()).greatest_rad),
        delta_sd_rad: reconstruction.matches.delta.sd_rad,
        residual_sd_rad: drift.residual_sd_rad,
        error_px: drift.error_px,
        share: drift.share,
        counts: drift.explains_most_pixels(),
    };
    Some((window, drift))
}

/// Draws the drift map of the window with the median drift: among the windows that count, or among all if none counts.
fn draw_median(measured: &MeasuredWindows, reconstructor: &Reconstructor, path: &Path) -> Result<(), Failure> {
    let any_counts = measured.windows.iter().any(|(window, _)| window.counts);
    let eligible = || measured.windows.iter().filter(|(window, _)| window.counts == any_counts);
    let median_rad = median(eligible().map(|(window, _)| window.rms_rad));
    let Some((_, drift)) = eligible().find(|(window, _)| Some(window.rms_rad) == median_rad) else { return Ok(()) };
    Ok(drift_picture(&DriftMap::new(drift, reconstructor.table())).write_png(path)?)
}

impl Summary {
    fn from_windows(windows: &[Window], limits: Limits) -> Self {
        let drifts: Vec<f64> = windows.iter().filter(|window| window.counts).map(|window| window.rms_rad).collect();
        let median_rms_rad = median(drifts.iter().copied());
        Self {
            first_rms_rad: drifts.first().copied(),
            last_rms_rad: drifts.last().copied(),
            largest_rms_rad: drifts.iter().copied().max_by(f64::total_cmp),
            median_rms_rad,
            limit_rad: limits.warn,
            beyond_limit: median_rms_rad.map(|median_rad| median_rad > limits.warn),
        }
    }
}

fn write(out: &mut impl Write, report: &Report<'_>) -> io::Result<()> {
    let (calibration, images) = (report.calibration.display(), report.images.display());
    writeln!(out, "Drift of {calibration} in {images} (rad, about the mean of δ)")?;
    writeln!(
        out,
        "  image   time, s   mean of δ      rms  greatest  sd of δ  sd about the drift  errors, px  pixels that agree"
    )?;
    for w in &report.windows {
        let time_s = w.time_s.map_or_else(|| "–".to_owned(), |time_s| format!("{time_s:.2}"));
        let remark = if w.counts { "" } else { "  (too few, does not count)" };
        writeln!(
            out,
            "  {:>5}  {time_s:>8}    {:+.4}   {:7.4}   {:7.4}  {:7.4}             {:7.4}     {:7.3}            {:5.1} \
             %{remark}",
            w.first_image,
            w.delta_mean_rad,
            w.rms_rad,
            w.greatest_rad,
            w.delta_sd_rad,
            w.residual_sd_rad,
            w.error_px,
            100.0 * w.share
        )?;
    }
    for Unmeasured { first_image, why } in &report.unmeasured {
        writeln!(out, "  {first_image:>5}  not measured: {why}")?;
    }
    if report.windows.len() + report.unmeasured.len() < report.windows_available {
        writeln!(out, "The input has {} windows; --windows N measures more of them", report.windows_available)?;
    }
    writeln!(out, "{}", verdict(&report.summary))
}

fn verdict(summary: &Summary) -> String {
    let &Summary { first_rms_rad, last_rms_rad, largest_rms_rad, median_rms_rad, limit_rad, beyond_limit } = summary;
    let numbers = [first_rms_rad, last_rms_rad, largest_rms_rad, median_rms_rad];
    let ([Some(first), Some(last), Some(largest), Some(median)], Some(beyond)) = (numbers, beyond_limit) else {
        return "no verdict: in no window do most pixels agree with a drift; show more of the object within the volume"
            .to_owned();
    };
    let judged = if beyond { "BEYOND" } else { "within" };
    let remedy = if beyond { "; calibrate again" } else { "" };
    format!(
        "drift rms: first {first:.4}, last {last:.4}, largest {largest:.4}, median {median:.4} rad: {judged} the \
         limit of {limit_rad} rad (health.drift_rad){remedy}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(rms_rad: f64, counts: bool) -> Window {
        Window {
            first_image: 0,
            time_s: None,
            delta_mean_rad: 0.0,
            rms_rad,
            greatest_rad: rms_rad,
            delta_sd_rad: 0.0,
            residual_sd_rad: 0.0,
            error_px: 0.0,
            share: 1.0,
            counts,
        }
    }

    #[test]
    fn the_verdict_follows_the_median_of_the_windows_that_count() {
        let limits = Limits { warn: 0.1, bad: 0.2 };
        let windows = [(0.04, true), (0.9, false), (0.3, true), (0.05, true)].map(|(rms, counts)| window(rms, counts));
        let summary = Summary::from_windows(&windows, limits);
        assert_eq!(
            [summary.first_rms_rad, summary.last_rms_rad, summary.largest_rms_rad, summary.median_rms_rad],
            [0.04, 0.05, 0.3, 0.05].map(Some)
        );
        assert_eq!(summary.beyond_limit, Some(false));
        assert!(verdict(&Summary::from_windows(&[window(0.11, true)], limits)).contains("BEYOND the limit of 0.1 rad"));
        let none = Summary::from_windows(&windows[1..2], limits);
        assert!(none.beyond_limit.is_none() && verdict(&none).starts_with("no verdict"));
    }
}

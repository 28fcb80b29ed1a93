//! `fringeflow calibrate --refine`: a better calibration from scans of anything, or a projector from one scene.

use std::collections::BTreeMap;
use std::path::Path;

use fringeflow::calibration::{Cameras, Unit, read_calibration, read_cameras};
use fringeflow::cloud::CloudPoint;
use fringeflow::geometry::{Camera, FringePattern, MeasurementVolume, Pixel, Point3, Rig, triangulate};
use fringeflow_calibrate::comparison::{Change, changes};
use fringeflow_calibrate::folder::Scene;
use fringeflow_calibrate::refinement::{
    Refined, ScanColumns, ScanPoint, common_points, is_refinable, new_projector_covariance, projector_from_columns,
    refine, usual_covariance,
};
use fringeflow_calibrate::{file_text, read_cameras_covariance};
use fringeflow_patterns::PATTERNS_FILE;

use crate::failure::Failure;
use crate::images::Images;
use crate::input::Input;
use crate::proposed::{Geometry, read_configuration, reconstruct, reconstructor};
use crate::{json, progress};

use super::Args;

/// Most windows of a recording that are used.
const WINDOWS: usize = 10;
/// Rounds: the second one has the correspondences of the rig of the first.
const ROUNDS: usize = 2;
/// Sides of the tiles of C1 of which one point is used, pixels.
const TILE_PX: u16 = 16;
/// Fewest points of a tile that has a point.
const FEWEST_IN_TILE: usize = 32;
/// How much smaller the deviation of the columns must become for a refinement to be worth a file.
const WORTHWHILE: f64 = 0.98;

#[derive(serde::Serialize)]
struct Report<'a> {
    input: &'a Path,
    points: usize,
    left_out: usize,
    /// Expected minus measured column before and after, projector pixels.
    before: fringeflow_calibrate::refinement::ColumnFit,
    after: fringeflow_calibrate::refinement::ColumnFit,
    /// Parameters that the scans do not determine.
    held: &'a [String],
    changes: Vec<Change>,
}

/// Refines, prints and writes a calibration.
pub(super) fn run(args: &Args, input: &Path) -> Result<(), Failure> {
    let is_scene = input.join(PATTERNS_FILE).exists();
    let (old, refined) = if is_scene { projector_of_scene(args, input)? } else { refine_scans(args, input)? };
    let [before, after] = refined.fits;
    let rms_px = |fit: fringeflow_calibrate::refinement::ColumnFit| fit.median_px.hypot(fit.sd_px);
    if !is_scene && rms_px(after) > WORTHWHILE * rms_px(before) {
        return Err(Failure::NotMeasurable(format!(
            "{}: the scans show nothing to refine: the columns deviate by {:.4} projector pixels, and no change of the \
             rig makes that smaller; no file is written",
            input.display(),
            rms_px(before)
        )));
    }
    let text = file_text(&refined.rig, &refined.covariance, &[]);
    args.write_text(&text)?;
    let [points, left_out] = refined.used;
    let changes = old.map_or_else(Vec::new, |old| changes(&old, &refined.rig, &refined.covariance));
    let report = Report { input, points, left_out, before, after, held: &refined.held, changes };
    if args.json { json::print(&report) } else { Ok(write(&mut std::io::stdout().lock(), &report, args)?) }
}

fn write(out: &mut impl std::io::Write, report: &Report<'_>, args: &Args) -> std::io::Result<()> {
    let Report { input, points, left_out, before, after, held, changes } = report;
    writeln!(out, "Refinement from {} ({points} points, {left_out} left out)", input.display())?;
    writeln!(
        out,
        "  expected minus measured column of the projector: median {:+.4}, sd {:.4} px before; median {:+.4}, sd {:.4} px after",
        before.median_px, before.sd_px, after.median_px, after.sd_px
    )?;
    for change in changes {
        writeln!(out, "  changed: {change}")?;
    }
    if !held.is_empty() {
        writeln!(out, "  not determined by these scans, and therefore as before: {}", held.join(" "))?;
    }
    writeln!(out, "\n{} is written", args.output.display())
}

/// Refines the rig of a recording or dataset, or the one of --from.
fn refine_scans(args: &Args, path: &Path) -> Result<(Option<Rig>, Refined), Failure> {
    let input = Input::open(path, None)?;
    let rig = match &args.from {
        Some(file) => read_calibration(file, Unit::Millimetre)?,
        None => input.setup().rig,
    };
    if !is_refinable(&rig) {
        return Err(input.unusable(
            &"its calibration has skew, or coefficients of distortion beyond k1 k2 p1 p2 k3; calibrate anew",
        ));
    }
    let configuration = read_configuration(None, &input)?;
    let volume = configuration.volume.or(input.setup().volume);
    let volume = volume.ok_or_else(|| input.unusable(&"states no measurement volume"))?;
    let chosen = Images::windows(&input, &configuration, WINDOWS, None)?;
    let pattern = input.setup().sequence.pattern;
    let bar = progress::bar("windows", (ROUNDS * chosen.len()) as u64);
    let mut refined: Option<Refined> = None;
    let mut before = None;
    for _ in 0..ROUNDS {
        let current = refined.as_ref().map_or(rig, |refined| refined.rig);
        let points = scan_points(&input, &chosen, &current, (&volume, &pattern), &configuration, &bar)?;
        let found = refine(&rig, &usual_covariance(&rig), &points).ok_or_else(|| {
            input.unusable(&format!(
                "its scans have {} usable points, which do not determine a rig; scan something larger within the volume",
                points.len()
            ))
        })?;
        before.get_or_insert(found.fits[0]);
        refined = Some(found);
    }
    bar.finish_and_clear();
    let missing = || input.unusable(&"it has no windows");
    let (mut refined, before) = (refined.ok_or_else(missing)?, before.ok_or_else(missing)?);
    refined.fits[0] = before;
    Ok((Some(rig), refined))
}

/// One point of each tile of each window: the one with the median δ.
fn scan_points(
    input: &Input,
    chosen: &[Images],
    rig: &Rig,
    (volume, pattern): (&MeasurementVolume, &FringePattern),
    configuration: &fringeflow_config::Configuration,
    bar: &indicatif::ProgressBar,
) -> Result<Vec<ScanPoint>, Failure> {
    let geometry = Geometry { rig, volume, pattern };
    let mut reconstructor = reconstructor(input, &chosen[0], &geometry, configuration, None)?;
    let mut points = Vec::new();
    let mut failure = None;
    for images in chosen {
        match reconstruct(input, &mut reconstructor, images) {
            Ok(reconstruction) => points.extend(of_tiles(&reconstruction.cloud.points, rig, pattern)),
            // Other windows may show more.
            Err(why @ Failure::Usage(_)) => failure = Some(why),
            Err(why) => return Err(why),
        }
        bar.inc(1);
    }
    match failure {
        Some(why) if points.is_empty() => Err(why),
        _ => Ok(points),
    }
}

fn of_tiles(cloud: &[CloudPoint], rig: &Rig, pattern: &FringePattern) -> Vec<ScanPoint> {
    let mut tiles: BTreeMap<[u16; 2], Vec<&CloudPoint>> = BTreeMap::new();
    for point in cloud {
        tiles.entry(point.cam1_px.map(|c| c / TILE_PX)).or_default().push(point);
    }
    let median = |mut points: Vec<&CloudPoint>| {
        points.sort_by(|a, b| a.delta_rad.total_cmp(&b.delta_rad));
        let point = points.get(points.len() / 2).filter(|_| points.len() >= FEWEST_IN_TILE)?;
        let [u, v] = point.cam1_px.map(f64::from);
        let [x, y] = point.cam2_px.map(f64::from);
        let (cam1_px, cam2_px) = (Pixel::new(u, v), Pixel::new(x, y));
        let position = Point3::from(point.position_m.map(f64::from));
        // δ is the phase at which the point should be lit minus the measured one.
        let turns = pattern.phase_turns(rig.project_projector(&position)?.x);
        let measured = turns - f64::from(point.delta_rad) / std::f64::consts::TAU;
        Some(ScanPoint { cam1_px, cam2_px, column_px: pattern.column_px(measured) })
    };
    tiles.into_values().filter_map(median).collect()
}

/// Finds the projector from the columns of a scene at rest that both cameras see.
fn projector_of_scene(args: &Args, folder: &Path) -> Result<(Option<Rig>, Refined), Failure> {
    let from = args.from.as_ref().ok_or_else(|| {
        Failure::Usage(format!("{}: give --from with the calibration of both cameras", folder.display()))
    })?;
    let Cameras { cam1, cam2, cam2_from_cam1 } = read_cameras(from, Unit::Millimetre)?;
    let scene = Scene::read(folder).map_err(Failure::unusable)?;
    let unusable = |what: String| Failure::Usage(format!("{}: {what}", folder.display()));
    let columns = ScanColumns::decode(&scene.images, &scene.order)
        .ok_or_else(|| unusable("its images have different sizes or depths".to_owned()))?;
    for (camera, (size_px, number)) in [&cam1, &cam2].into_iter().zip(columns.sizes_px().into_iter().zip(1..)) {
        check_size(camera, size_px, number, from).map_err(unusable)?;
    }
    let points = common_points(&cam1, &cam2, &cam2_from_cam1, &columns);
    let without = Rig { cam1, cam2, projector: cam1, cam2_from_cam1, projector_from_cam1: cam2_from_cam1 };
    let seen: Vec<_> = points
        .iter()
        .filter_map(|p| Some((triangulate(&without, &p.cam1_px, &p.cam2_px)?.point_cam1.coords, p.column_px)))
        .collect();
    let none = || {
        unusable(format!(
            "the {} points that both cameras see under one column do not determine a projector; take a scene with depth \
             that fills the image",
            seen.len()
        ))
    };
    let (projector, projector_from_cam1) = projector_from_columns(&seen, scene.order.projector_px).ok_or_else(none)?;
    let rig = Rig { projector, projector_from_cam1, ..without };
    let covariance = new_projector_covariance(&rig, read_cameras_covariance(from)?.as_ref());
    let refined = refine(&rig, &covariance, &points).ok_or_else(none)?;
    Ok((None, refined))
}

fn check_size(camera: &Camera, [width, height]: [usize; 2], number: usize, from: &Path) -> Result<(), String> {
    let (calibrated_width, calibrated_height) = (camera.width_px(), camera.height_px());
    if [calibrated_width, calibrated_height] == [width, height] {
        return Ok(());
    }
    Err(format!(
        "the images of camera {number} have {width} × {height} pixels, and {} is for {calibrated_width} × {calibrated_height}; \
         give the calibration of these cameras",
        from.display()
    ))
}

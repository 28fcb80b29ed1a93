//! Drawings of a calibration as SVG.

use std::fmt::Write as _;

use fringeflow::geometry::Point3;
use fringeflow_calibrate::adjustment::{Measured, PROJECTOR};
use fringeflow_calibrate::quality::coverage::CELLS;
use fringeflow_calibrate::{CalibratedRig, Quality};

/// Residuals are drawn this many times as long as they are.
const RESIDUAL_SCALE: f64 = 100.0;

/// Opens a drawing in pixels of an image.
fn opened([width, height]: [usize; 2]) -> String {
    format!("<svg viewBox=\"-0.5 -0.5 {width} {height}\" class=\"image\" role=\"img\">")
}

/// The covered cells of a device's image, and the residual of each point.
pub(super) fn coverage(calibrated: &CalibratedRig, quality: &Quality, device: usize) -> String {
    let size_px @ [width, height] = calibrated.problem.sizes_px[device];
    let mut out = opened(size_px);
    let counts = &quality.coverage[device].counts;
    let most = counts.iter().copied().max().unwrap_or_default().max(1) as f64;
    let (cell_width, cell_height) = (width as f64 / CELLS[0] as f64, height as f64 / CELLS[1] as f64);
    for (k, count) in counts.iter().enumerate() {
        let (x, y) = ((k % CELLS[0]) as f64 * cell_width - 0.5, (k / CELLS[0]) as f64 * cell_height - 0.5);
        let opacity = 0.06 + 0.5 * (*count as f64 / most).sqrt();
        let class = if *count == 0 { "empty" } else { "cell" };
        let _ = write!(
            out,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{cell_width:.1}\" height=\"{cell_height:.1}\" class=\"{class}\" \
             fill-opacity=\"{opacity:.2}\"><title>{count} points</title></rect>"
        );
    }
    let unit = width as f64 / 640.0;
    for ((measurement, residual), weight) in
        calibrated.problem.measurements.iter().zip(&calibrated.adjusted.residuals_px).zip(&calibrated.adjusted.weights)
    {
        let (at, is_of_device) = match &measurement.measured {
            Measured::Pixel(pixel, _) => (pixel.coords, measurement.device == device),
            Measured::Phase(patch) => (patch.at(&patch.centre).0, device == PROJECTOR),
        };
        let Some(residual) = residual.filter(|_| is_of_device) else { continue };
        let end = at + residual * RESIDUAL_SCALE;
        let class = if *weight < 1.0 { "outlier" } else { "residual" };
        let _ = write!(
            out,
            "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" class=\"{class}\" stroke-width=\"{unit:.2}\"/>",
            at.x, at.y, end.x, end.y
        );
    }
    out + "</svg>"
}

/// The proposed poses as camera 1 would see the board.
pub(super) fn proposed(calibrated: &CalibratedRig, quality: &Quality) -> String {
    let size_px = calibrated.problem.sizes_px[0];
    let camera = calibrated.adjusted.state.devices[0].lens.camera(size_px);
    let features = &calibrated.problem.features_m;
    let extreme = |axis: usize| features.iter().map(|feature| feature[axis].abs()).fold(0.0, f64::max);
    let (x, y) = (extreme(0), extreme(1));
    let corners = [(-x, -y), (x, -y), (x, y), (-x, y)];
    let mut out = opened(size_px);
    let [width, height] = size_px;
    let _ = write!(out, "<rect x=\"-0.5\" y=\"-0.5\" width=\"{width}\" height=\"{height}\" class=\"frame\"/>");
    for (number, pose) in quality.proposed.iter().enumerate() {
        let seen: Option<Vec<_>> =
            corners.iter().map(|(x, y)| camera.project(&(pose.cam1_from_board * Point3::new(*x, *y, 0.0)))).collect();
        let Some(seen) = seen else { continue };
        let points = seen.iter().map(|pixel| format!("{:.0},{:.0}", pixel.x, pixel.y)).collect::<Vec<_>>().join(" ");
        let [first, ..] = seen[..] else { continue };
        let (number, size) = (number + 1, width as f64 / 28.0);
        let _ = write!(
            out,
            "<polygon points=\"{points}\" class=\"board\"/><text x=\"{:.0}\" y=\"{:.0}\" font-size=\"{size:.0}\">{number}</text>",
            first.x + size / 2.0,
            first.y + size
        );
    }
    out + "</svg>"
}

/// The expected error of the depth over the volume, seen by camera 1, one drawing for each depth.
pub(super) fn depth_errors(calibrated: &CalibratedRig, quality: &Quality) -> Vec<(f64, String)> {
    let errors = quality.probes.errors(&calibrated.adjusted.covariance);
    let worst = errors.iter().map(|error| error.depth_mm).fold(f64::MIN_POSITIVE, f64::max);
    let size_px = calibrated.problem.sizes_px[0];
    let camera = calibrated.adjusted.state.devices[0].lens.camera(size_px);
    let mut depths: Vec<(f64, String)> = Vec::new();
    for (point, error) in quality.probes.points_m().zip(&errors) {
        let Some(pixel) = camera.project(&Point3::from(*point)) else { continue };
        let depth_mm = 1e3 * point.z;
        if depths.last().is_none_or(|(last, _)| (last - depth_mm).abs() > 0.5) {
            depths.push((depth_mm, opened(size_px)));
        }
        let radius = size_px[0] as f64 / 18.0;
        let opacity = 0.1 + 0.8 * error.depth_mm / worst;
        if let Some((_, out)) = depths.last_mut() {
            let _ = write!(
                out,
                "<circle cx=\"{:.0}\" cy=\"{:.0}\" r=\"{radius:.0}\" class=\"cell\" fill-opacity=\"{opacity:.2}\"><title>± \
                 {:.4} mm</title></circle><text x=\"{:.0}\" y=\"{:.0}\" font-size=\"{:.0}\" text-anchor=\"middle\">{:.0}</text>",
                pixel.x,
                pixel.y,
                error.depth_mm,
                pixel.x,
                pixel.y + radius / 3.0,
                radius * 0.8,
                1e3 * error.depth_mm
            );
        }
    }
    depths.into_iter().map(|(depth_mm, out)| (depth_mm, out + "</svg>")).collect()
}

//! The poses of a scan as CSV, one line per cloud.

use std::io::Write as _;
use std::path::Path;

use fringeflow::calibration::Unit;
use fringeflow_base::atomic_file::{WriteError, write_atomically};
use fringeflow_tracking::fusion::Model;

use super::scan::Scan;

/// Writes the poses `model_from_cam1`, with lengths in `unit`. The line of a lost cloud has no pose.
pub(crate) fn write(path: &Path, scan: &Scan, model: &Model, unit: Unit) -> Result<(), WriteError> {
    let (symbol, centre) = (unit.symbol(), model.centre());
    write_atomically(path, |out| {
        writeln!(
            out,
            "pair,time_s,state,x_{symbol},y_{symbol},z_{symbol},qw,qx,qy,qz,sd_{symbol},sd_rad,share,rms_{symbol}"
        )?;
        for window in &scan.windows {
            write!(out, "{},{:.6},", window.first_pair, window.time_s)?;
            let Some(tracked) = window.merged() else {
                writeln!(out, "{},,,,,,,,,,,", window.loss_name().unwrap_or_default())?;
                continue;
            };
            let pose = &tracked.model_from_cam1;
            let (position, rotation) = (pose.translation.vector / unit.in_metres(), pose.rotation);
            write!(out, "{},{:.6},{:.6},{:.6},", tracked.tracking.name(), position.x, position.y, position.z)?;
            write!(out, "{:.9},{:.9},{:.9},{:.9},", rotation.w, rotation.i, rotation.j, rotation.k)?;
            let sd = tracked.covariance.sd_at(&centre) / unit.in_metres();
            write!(out, "{sd:.3e},{:.3e},", tracked.covariance.rotation_sd_rad())?;
            match tracked.tracking.registration() {
                Some(found) => writeln!(out, "{:.4},{:.3e}", found.share, found.rms_m / unit.in_metres())?,
                None => writeln!(out, ",")?,
            }
        }
        Ok(())
    })
}

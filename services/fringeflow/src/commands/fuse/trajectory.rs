//! The poses of a scan as CSV: one line a cloud.

use std::io::Write as _;
use std::path::Path;

use fringeflow::calibration::Unit;
use fringeflow_base::atomic_file::{WriteError, write_atomically};
use fringeflow_tracking::fusion::Model;

use super::scan::Scan;

/// Writes the poses `model_from_cam1` in a unit. Lost clouds have a line without a pose.
pub(crate) fn write(path: &Path, scan: &Scan, model: &Model, unit: Unit) -> Result<(), WriteError> {
    let (symbol, centre) = (unit.symbol(), model.centre());
    write_atomically(path, |out| {
        writeln!(
            out,
            "pair,time_s,state,x_{symbol},y_{symbol},z_{symbol},qw,qx,qy,qz,sd_{symbol},sd_rad,share,rms_{symbol}"
        )?;
        for looked in &scan.looked {
            write!(out, "{},{:.6},", looked.first_pair, looked.time_s)?;
            let Some(tracked) = looked.merged() else {
                writeln!(out, "{},,,,,,,,,,,", looked.reason().unwrap_or_default())?;
                continue;
            };
            let pose = &tracked.model_from_cam1;
            let (at, turn) = (pose.translation.vector / unit.in_metres(), pose.rotation);
            write!(out, "{},{:.6},{:.6},{:.6},", tracked.tracking.name(), at.x, at.y, at.z)?;
            write!(out, "{:.9},{:.9},{:.9},{:.9},", turn.w, turn.i, turn.j, turn.k)?;
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

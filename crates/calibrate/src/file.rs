//! The calibration file with what is known of its accuracy.

use fringeflow::calibration::{Unit, calibration_text, push_matrix};

use crate::adjustment::Layout;
use crate::findings::Finding;
use crate::refinement::parameter_names;
use crate::rig::CalibratedRig;

/// Unit of the lengths in the file.
const UNIT: Unit = Unit::Millimetre;

/// Returns the text of the calibration file; `None` without a projector.
///
/// Beside the fields of every calibration it holds `covariance` of `parameters` (pixels, radians, metres), `noise` with the
/// root mean squares of the residuals, and `flaws` with the findings for which it would be refused. OpenCV reads them all.
#[must_use]
pub fn file_text(calibrated: &CalibratedRig, flaws: &[&Finding]) -> Option<String> {
    let mut out = calibration_text(&calibrated.rig()?, UNIT);
    let adjusted = &calibrated.adjusted;
    let count = Layout::of(&adjusted.state).rig();
    let strings = |strings: Vec<String>| {
        let quoted = strings.iter().map(|text| format!("   - \"{}\"\n", text.replace(['"', '\\'], "'")));
        quoted.collect::<String>()
    };
    let rms_px: Vec<f64> = adjusted.groups.iter().map(|group| group.rms_px).collect();
    push_matrix(&mut out, "noise", 1, rms_px.len(), &rms_px);
    out += "parameters:\n";
    out += &strings(parameter_names());
    let covariance = adjusted.covariance.view((0, 0), (count, count));
    push_matrix(&mut out, "covariance", count, count, covariance.transpose().as_slice());
    if !flaws.is_empty() {
        out += "flaws:\n";
        out += &strings(flaws.iter().map(|flaw| flaw.text.clone()).collect());
    }
    Some(out)
}

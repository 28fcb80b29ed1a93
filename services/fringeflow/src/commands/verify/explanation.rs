//! What the likely causes mean, in words.

use serde::Serialize;

use fringeflow_lab::artefact::Cause;

/// A likely cause.
#[derive(Serialize)]
pub(super) struct Explanation {
    pub(super) cause: &'static str,
    pub(super) text: String,
}

/// Says what a cause is, how large, and what to do.
pub(super) fn explain(cause: &Cause) -> Explanation {
    let (cause, text) = match *cause {
        Cause::Scale { share, u } => {
            let side = if share > 0.0 { "long" } else { "short" };
            let (percent, u2_percent) = (100.0 * share, 200.0 * u);
            let text = format!(
                "{percent:+.3} % (± {u2_percent:.3}, k = 2): all lengths are too {side}. The base of the cameras is \
                 calibrated too {side} by this share, or the calibration board has another size than stated; calibrate \
                 again"
            );
            ("scale", text)
        }
        Cause::BallSize { error_m, u_m } => {
            let (side, mm, u2_mm) = (if error_m > 0.0 { "large" } else { "small" }, error_m * 1e3, 2e3 * u_m);
            let text = format!(
                "{mm:+.4} mm (± {u2_mm:.4}, k = 2): balls appear too {side}, and no scale error is shown that would \
                 explain it. Surfaces that turn away are measured elsewhere: look at the picture, at focus and \
                 calibration"
            );
            ("ball size", text)
        }
        Cause::Bend(bend) => {
            let (um, percent) = (bend.range_m * 1e6, 100.0 * bend.share);
            let text = format!(
                "{um:.1} µm over the plate, {percent:.0} % of its form: it is bent smoothly. The distortion of a lens or \
                 the pose of a device is calibrated wrongly, or the plate is bent itself (turn it and measure again)"
            );
            ("bend", text)
        }
        Cause::Ripple(ripple) => {
            let (um, times) = (ripple.amplitude_m * 1e6, ripple.per_fringe);
            let why = match times {
                1 | 2 => "phase shifts are not as declared, or light or place change from image to image",
                times if times == ripple.steps => "the projector is not linear (gamma), or images are saturated",
                _ => "the phase has an error that repeats with the fringes",
            };
            ("ripple", format!("amplitude {um:.1} µm, {times} times in a fringe: {why}"))
        }
        Cause::Apart { share, offset_m } => {
            let (percent, mm) = (100.0 * share, offset_m * 1e3);
            let text = format!(
                "{percent:.2} % of the points stand apart from the surface, by {mm:+.2} mm in the mean: wrong fringe \
                 orders, or a part of the artefact is hidden. More than the standard lets be left out"
            );
            ("points apart", text)
        }
    };
    Explanation { cause, text }
}

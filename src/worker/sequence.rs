//! Faults in the pattern sequence of a window: lost, repeated or exchanged images. In: the fault of each camera. Out:
//! an error text.

use crate::phase::SequenceFault;

/// Faults that the images of a window show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SequenceFaults {
    /// Number of images per camera.
    pub images: usize,
    /// Fault of camera 1.
    pub cam1: Option<SequenceFault>,
    /// Fault of camera 2.
    pub cam2: Option<SequenceFault>,
}

impl SequenceFaults {
    /// The first fault: the reason why the window is refused.
    #[must_use]
    pub fn first(&self) -> Option<SequenceFault> {
        self.cam1.or(self.cam2)
    }

    fn write_fault(&self, f: &mut std::fmt::Formatter<'_>, device: &str, fault: &SequenceFault) -> std::fmt::Result {
        let percent = |share: f64| 100.0 * share;
        write!(
            f,
            "{device}: {} (of {}; {:.0} % of the modulation does not fit the declared steps, {:.0} % with the fault)",
            fault.kind,
            self.images,
            percent(fault.residual_share),
            percent(fault.explained_share)
        )
    }
}

impl std::error::Error for SequenceFaults {}

impl std::fmt::Display for SequenceFaults {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the images do not show the declared pattern steps: ")?;
        match (self.cam1, self.cam2) {
            (Some(one), Some(two)) if one.kind == two.kind => {
                self.write_fault(f, "both cameras (or the projector)", &one)?;
            }
            (one, two) => {
                let faults = [("camera 1", one), ("camera 2", two)];
                let faults = faults.into_iter().filter_map(|(device, fault)| Some((device, fault?)));
                for (number, (device, fault)) in faults.enumerate() {
                    f.write_str(if number > 0 { "; " } else { "" })?;
                    self.write_fault(f, device, &fault)?;
                }
            }
        }
        f.write_str("; nothing is measured from this window")
    }
}

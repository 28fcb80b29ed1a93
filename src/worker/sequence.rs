//! Faults in the sequence of a window, of one camera or of both.

use crate::phase::SequenceFault;

/// What is wrong with the sequence of a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SequenceFaults {
    /// Images of a camera.
    pub images: usize,
    /// Fault of camera 1.
    pub cam1: Option<SequenceFault>,
    /// Fault of camera 2.
    pub cam2: Option<SequenceFault>,
}

impl SequenceFaults {
    /// The fault that the window is refused for.
    #[must_use]
    pub fn first(&self) -> Option<SequenceFault> {
        self.cam1.or(self.cam2)
    }
}

impl std::error::Error for SequenceFaults {}

impl std::fmt::Display for SequenceFaults {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the images do not show the declared pattern steps: ")?;
        match (self.cam1, self.cam2) {
            (Some(one), Some(two)) if one.kind == two.kind => {
                self.tell(f, "both cameras (or the projector)", &one)?;
            }
            (one, two) => {
                let faults = [("camera 1", one), ("camera 2", two)].into_iter().filter_map(|(who, f)| Some((who, f?)));
                for (number, (who, fault)) in faults.enumerate() {
                    f.write_str(if number > 0 { "; " } else { "" })?;
                    self.tell(f, who, &fault)?;
                }
            }
        }
        f.write_str("; nothing is measured from this window")
    }
}

impl SequenceFaults {
    fn tell(&self, f: &mut std::fmt::Formatter<'_>, who: &str, fault: &SequenceFault) -> std::fmt::Result {
        let percent = |share: f64| 100.0 * share;
        write!(
            f,
            "{who}: {} (of {}; {:.0} % of the modulation does not fit what is said, {:.0} % that)",
            fault.kind,
            self.images,
            percent(fault.residual_share),
            percent(fault.explained_share)
        )
    }
}

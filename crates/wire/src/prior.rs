//! Priors as messages, and the choice of the prior for a window.

use std::collections::VecDeque;

use fringeflow::geometry::Vector3;
use fringeflow::prior::{Moment, Prior, Relief, RigidMotion, WindowTimes};
use fringeflow_message::{PoseReport, PriorHeader, Window};

use crate::drift;

/// Priors in the order of their arrival.
#[derive(Clone, Debug, Default)]
pub struct Priors {
    kept: VecDeque<(PriorHeader, Option<Prior>)>,
}

/// Why a message was not accepted as a prior.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PriorError {
    /// The payload does not have the size that the header states, or a number is not finite.
    #[error("the prior contradicts itself and is ignored")]
    Contradiction,
    /// An earlier prior has the same number.
    #[error("two priors have the same number; the second is ignored")]
    Repeated,
}

/// The prior that was used to decode a window.
#[derive(Clone, Debug, PartialEq)]
pub enum WindowPrior<'a> {
    /// This prior and its age; `None` if the window was decoded without one.
    Used(Option<(&'a Prior, Moment)>),
    /// The prior is not available.
    Missing,
}

impl Priors {
    /// Adds the prior of a message. If two priors have the same number, the first one counts.
    ///
    /// # Errors
    /// [`PriorError`]; the message is then ignored.
    pub fn push(&mut self, header: &PriorHeader, payload: &[u8]) -> Result<(), PriorError> {
        if !is_consistent(header, payload) {
            return Err(PriorError::Contradiction);
        }
        if self.with_number(header.published).is_some() {
            return Err(PriorError::Repeated);
        }
        self.kept.push_back((*header, decode(header, payload)));
        Ok(())
    }

    /// Removes all but the last `count` priors.
    pub fn keep_last(&mut self, count: usize) {
        self.kept.drain(..self.kept.len().saturating_sub(count));
    }

    /// Whether there are no priors.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }

    /// Returns the prior that was used to decode a window.
    #[must_use]
    pub fn used_by(&self, window: &Window) -> WindowPrior<'_> {
        let Some(number) = window.prior_number() else { return WindowPrior::Used(None) };
        match self.with_number(number) {
            Some((header, prior)) => WindowPrior::Used(aged(header, prior.as_ref(), &window_times(window))),
            None => WindowPrior::Missing,
        }
    }

    /// Returns the number of the last prior that a window may use if its last image arrived at `received_ns`, and that
    /// prior with its age, if the message contains one. Priors that arrived later do not matter, so a replay chooses
    /// the same one.
    #[must_use]
    pub fn last_settled(&self, received_ns: u64, times: &WindowTimes) -> Option<(u64, Option<(&Prior, Moment)>)> {
        let (header, prior) = self.kept.iter().rev().find(|(header, _)| header.is_settled_at(received_ns))?;
        Some((header.published, aged(header, prior.as_ref(), times)))
    }

    fn with_number(&self, number: u64) -> Option<&(PriorHeader, Option<Prior>)> {
        self.kept.iter().find(|(header, _)| header.published == number)
    }
}

/// Adds the age of a prior in a window.
fn aged<'a>(header: &PriorHeader, prior: Option<&'a Prior>, times: &WindowTimes) -> Option<(&'a Prior, Moment)> {
    prior.map(|prior| (prior, times.moment_after(header.centre_ns)))
}

/// Returns the times of the images of a window.
#[must_use]
pub fn window_times(window: &Window) -> WindowTimes {
    let exposures_ns = [window.first_exposure_ns, window.last_exposure_ns];
    WindowTimes { exposures_ns, images: window.images as usize }
}

/// Creates the message with the prior after the cloud of a report: returns the header and writes the coarse depth to
/// `out` as the payload. If there is no prior, the payload is empty.
#[must_use]
pub fn encode(prior: Option<Prior>, report: &PoseReport, out: &mut Vec<u8>) -> PriorHeader {
    out.clear();
    let header = PriorHeader {
        published: report.published,
        cloud: report.cloud,
        centre_ns: report.window.centre_ns,
        published_ns: report.published_ns,
        ..PriorHeader::default()
    };
    let Some(Prior { motion, relief, drift }) = prior else { return header };
    relief.cells().iter().for_each(|cell| out.extend_from_slice(&cell.to_le_bytes()));
    let [width_px, height_px] = relief.size_px().map(|length| length as u32);
    let RigidMotion { velocity_m_s, rate_rad_s } = motion;
    PriorHeader {
        velocity_m_s: velocity_m_s.into(),
        rate_rad_s: rate_rad_s.into(),
        width_px,
        height_px,
        drift: drift::numbers(drift.as_ref()),
        ..header
    }
}

/// Returns the prior of a message; `None` if the message contains none or contradicts itself.
#[must_use]
pub fn decode(header: &PriorHeader, payload: &[u8]) -> Option<Prior> {
    if !is_consistent(header, payload) || payload.is_empty() {
        return None;
    }
    let size_px = [header.width_px, header.height_px].map(|length| length as usize);
    let cells = payload.as_chunks().0.iter().map(|cell| u16::from_le_bytes(*cell)).collect();
    let [velocity_m_s, rate_rad_s] = [header.velocity_m_s, header.rate_rad_s].map(Vector3::from);
    let (motion, relief) = (RigidMotion { velocity_m_s, rate_rad_s }, Relief::from_cells(size_px, cells)?);
    Some(Prior { motion, relief, drift: drift::read(&header.drift) })
}

/// Whether the payload has the size that the header states, and all numbers are finite.
#[must_use]
pub fn is_consistent(header: &PriorHeader, payload: &[u8]) -> bool {
    let is_finite = header.velocity_m_s.iter().chain(&header.rate_rad_s).all(|value| value.is_finite());
    is_finite && payload.len() == payload_bytes([header.width_px, header.height_px].map(|length| length as usize))
}

/// Size of the payload for images of a size, bytes.
#[must_use]
pub fn payload_bytes(size_px: [usize; 2]) -> usize {
    let [columns, rows] = Relief::cell_counts(size_px);
    columns.saturating_mul(rows).saturating_mul(size_of::<u16>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(published: u64, published_ns: u64) -> PriorHeader {
        PriorHeader { published, published_ns, ..PriorHeader::default() }
    }

    #[test]
    fn a_window_uses_the_last_prior_settled_before_its_last_image() {
        let mut priors = Priors::default();
        (0..3).for_each(|number| priors.push(&header(number, 10_000_000 * number), &[]).unwrap());
        let times = window_times(&Window::default());
        let number = |received_ns| priors.last_settled(received_ns, &times).map(|(number, _)| number);
        assert_eq!([999_999, 1_000_000, 20_999_999, 21_000_000].map(number), [None, Some(0), Some(1), Some(2)]);
    }

    #[test]
    fn if_two_priors_have_the_same_number_the_first_counts() {
        let mut priors = Priors::default();
        priors.push(&header(4, 0), &[]).unwrap();
        assert_eq!(priors.push(&header(4, 9), &[]), Err(PriorError::Repeated));
        assert_eq!(priors.push(&header(5, 9), &[0]), Err(PriorError::Contradiction));
        let used =
            |priors: &Priors, prior| priors.used_by(&Window { prior, ..Window::default() }) != WindowPrior::Missing;
        assert_eq!([0, 4, 5, 6].map(|prior| used(&priors, prior)), [true, false, true, false]);
        priors.keep_last(0);
        assert!(priors.is_empty() && !used(&priors, 5));
    }
}

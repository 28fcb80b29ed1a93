//! What is known of the next windows as a message.

use fringeflow::geometry::Vector3;
use fringeflow::prior::{Prior, Relief, RigidMotion, WindowTimes};
use fringeflow_message::{PoseReport, PriorHeader, Window};

use super::drift;

/// The message of what is known after the cloud of a report, with the cells of the relief as its payload in `out`. It tells
/// nothing where `prior` is `None`.
#[must_use]
pub fn message(prior: Option<Prior>, report: &PoseReport, out: &mut Vec<u8>) -> PriorHeader {
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

/// When the images of a window were taken.
#[must_use]
pub fn times(window: &Window) -> WindowTimes {
    let exposures_ns = [window.first_exposure_ns, window.last_exposure_ns];
    WindowTimes { exposures_ns, images: window.images as usize }
}

/// The prior of a message; `None` where it tells nothing, or contradicts itself.
#[must_use]
pub fn read(header: &PriorHeader, payload: &[u8]) -> Option<Prior> {
    if !is_whole(header, payload) || payload.is_empty() {
        return None;
    }
    let size_px = [header.width_px, header.height_px].map(|length| length as usize);
    let cells = payload.as_chunks().0.iter().map(|cell| u16::from_le_bytes(*cell)).collect();
    let [velocity_m_s, rate_rad_s] = [header.velocity_m_s, header.rate_rad_s].map(Vector3::from);
    let (motion, relief) = (RigidMotion { velocity_m_s, rate_rad_s }, Relief::from_cells(size_px, cells)?);
    Some(Prior { motion, relief, drift: drift::read(&header.drift) })
}

/// Whether a payload has as many bytes as its header says, and all numbers are finite.
#[must_use]
pub fn is_whole(header: &PriorHeader, payload: &[u8]) -> bool {
    let is_finite = header.velocity_m_s.iter().chain(&header.rate_rad_s).all(|value| value.is_finite());
    is_finite && payload.len() == payload_bytes([header.width_px, header.height_px].map(|length| length as usize))
}

/// Bytes of the payload for images of a size.
#[must_use]
pub fn payload_bytes(size_px: [usize; 2]) -> usize {
    let [columns, rows] = Relief::cell_counts(size_px);
    columns.saturating_mul(rows).saturating_mul(size_of::<u16>())
}

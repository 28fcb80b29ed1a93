//! An instance seen from outside: its reports, gathered for a while.

use std::time::Duration;

use fringeflow::transport::{ChannelSizes, Instance, Node, REPORT_STAGE, Subscriber, TransportError, Wake};
use fringeflow_runtime::clock;

use crate::Tally;

/// Gathers the reports of a running instance for `span_ns`: half a second brings a sign of life of every stage.
///
/// # Errors
/// The instance cannot be joined.
pub fn observe(instance: &Instance, span_ns: u64) -> Result<Tally, TransportError> {
    let node = Node::open(instance, "observer")?;
    // Reports have one size, whatever that of the images.
    let mut reports = Subscriber::open(&node, REPORT_STAGE, &ChannelSizes::default())?;
    let wake = Wake::new()?;
    let mut tally = Tally::default();
    let end_ns = clock::now_ns() + span_ns;
    loop {
        while let Some(report) = reports.receive()? {
            tally.add(&report);
        }
        let rest_ns = end_ns.saturating_sub(clock::now_ns());
        if rest_ns == 0 {
            return Ok(tally);
        }
        wake.wait(&[&reports], Duration::from_nanos(rest_ns))?;
    }
}

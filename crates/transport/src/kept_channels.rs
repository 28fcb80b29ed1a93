//! Keeps all channels of an instance open.

use std::fmt::Debug;

use super::attached::{Attached, Files, ensure_open};
use super::node::Member;
use super::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, CORRESPONDENCE_MAP, Channel, ChannelSizes, Header, Node, PHASE_MAPS,
    PROJECTOR_PATTERN, Payload, REPORT_STAGE, REPORT_WINDOW, SCAN_STATE, TRACKING_MODEL, TRACKING_POSE, TRACKING_PRIOR,
    TransportError,
};

/// Keeps every channel open while no port uses it. Drivers in other languages then find the channels with the limits of
/// the instance, whichever process starts first.
#[derive(Debug)]
pub struct KeptChannels {
    node: Node,
    sizes: ChannelSizes,
    open: Option<Attached<Services>>,
}

type Services = Vec<Box<dyn OpenService>>;

/// An open service of any type. It exists as long as this value.
trait OpenService: Debug + Send {}

impl<T: Debug + Send> OpenService for T {}

impl KeptChannels {
    /// Opens all channels, or creates them.
    ///
    /// # Errors
    /// A channel exists with other settings.
    pub fn open(node: &Node, sizes: &ChannelSizes) -> Result<Self, TransportError> {
        Ok(Self { node: node.clone(), sizes: *sizes, open: Some(open(node, sizes)?) })
    }

    /// Opens the channels again if their files were removed. Returns whether it did. Call it about once a second.
    ///
    /// # Errors
    /// As [`Self::open`]; the next call tries again.
    pub fn ensure_connected(&mut self) -> Result<bool, TransportError> {
        ensure_open(&mut self.open, || open(&self.node, &self.sizes))
    }
}

fn open(node: &Node, sizes: &ChannelSizes) -> Result<Attached<Services>, TransportError> {
    let member = node.member()?;
    let mut kept = (Services::new(), Files::default());
    keep(&mut kept, &member, CAM1_FRAME, sizes)?;
    keep(&mut kept, &member, CAM2_FRAME, sizes)?;
    keep(&mut kept, &member, PROJECTOR_PATTERN, sizes)?;
    keep(&mut kept, &member, PHASE_MAPS, sizes)?;
    keep(&mut kept, &member, CORRESPONDENCE_MAP, sizes)?;
    keep(&mut kept, &member, CLOUD, sizes)?;
    keep(&mut kept, &member, REPORT_STAGE, sizes)?;
    keep(&mut kept, &member, REPORT_WINDOW, sizes)?;
    keep(&mut kept, &member, TRACKING_POSE, sizes)?;
    keep(&mut kept, &member, TRACKING_MODEL, sizes)?;
    keep(&mut kept, &member, TRACKING_PRIOR, sizes)?;
    keep(&mut kept, &member, SCAN_STATE, sizes)?;
    Ok(Attached::new(kept.0, kept.1))
}

fn keep<H: Header, P: Payload + ?Sized>(
    (services, files): &mut (Services, Files),
    member: &Member,
    channel: Channel<H, P>,
    sizes: &ChannelSizes,
) -> Result<(), TransportError> {
    let opened = member.channel(channel, &channel.id().limits(sizes))?;
    files.extend(opened.files);
    services.push(Box::new((opened.service, opened.event)));
    Ok(())
}

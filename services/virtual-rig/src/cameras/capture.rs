//! Publishes the images of a virtual camera, and keeps its account.

use fringeflow_dataset::CameraId;
use fringeflow_lab::simulation::{Faults, ImageLoop};
use fringeflow_message::{DropReason, FrameHeader, Stage};
use fringeflow_pixels::ImageReader;
use fringeflow_runtime::{Account, AccountError, Host, ItemTimes, ServiceError, clock};
use fringeflow_transport::{CAM1_FRAME, CAM2_FRAME, Publisher, TransportError};

use crate::cameras::camera::{Shot, Timing, VirtualCamera};
use crate::cameras::trigger::Trigger;

/// A virtual camera with its channel and its account.
pub(crate) struct Capture {
    id: CameraId,
    stage: Stage,
    camera: VirtualCamera,
    account: Account,
    output: Publisher<FrameHeader, [u8]>,
    reader: ImageReader,
}

impl Capture {
    pub(crate) fn open(host: &Host, id: CameraId, session: u64, faults: Faults) -> Result<Self, ServiceError> {
        let (stage, channel) = match id {
            CameraId::Cam1 => (Stage::Camera1, CAM1_FRAME),
            CameraId::Cam2 => (Stage::Camera2, CAM2_FRAME),
        };
        let timing = Timing::usual(id, host.configuration.frame_period_ns());
        let reader = ImageReader::new(host.configuration.device_images, host.setup.readout)
            .map_err(|e| ServiceError::Unusable(e.to_string()))?;
        let (size_px, format) = (reader.image_size_px().map(|side| side as u32), reader.pixel_format());
        Ok(Self {
            id,
            stage,
            camera: VirtualCamera::new(id, session, size_px, format, timing, faults),
            account: host.open_account(stage)?,
            output: Publisher::open(&host.node, channel, &host.sizes)?,
            reader,
        })
    }

    /// Exposes an image on a trigger.
    pub(crate) fn expose(&mut self, trigger: &Trigger) -> Result<(), AccountError> {
        let exposed = self.camera.expose(trigger);
        self.account.count_taken(exposed.images + exposed.lost + exposed.injected)?;
        self.account.drop_many(DropReason::CameraLost, exposed.lost)?;
        self.account.drop_many(DropReason::Injected, exposed.injected)
    }

    /// Counts exposures that yield no image.
    pub(crate) fn count_lost(&mut self, exposures: u64, reason: DropReason) -> Result<(), AccountError> {
        self.account.count_taken(exposures)?;
        self.account.drop_many(reason, exposures)
    }

    /// Publishes the images that have arrived.
    pub(crate) fn publish_arrived(&mut self, host: &mut Host, images: &ImageLoop) -> Result<(), AccountError> {
        while let Some(shot) = self.camera.take_arrived(clock::now_ns()) {
            let taken_ns = clock::now_ns();
            let header = self.camera.header(&shot, taken_ns, self.account.count_passed()?);
            // An image that cannot be sent leaves a gap in the channel, and subscribers count it as lost.
            if let Err(error) = self.send(&header, &shot, images) {
                tracing::warn!("{error}");
            }
            let exposure_start_ns = shot.exposure_start_ns;
            let passed_ns = clock::now_ns();
            let times = ItemTimes { exposure_start_ns, received_ns: taken_ns, taken_ns, passed_ns, waited_ns: 0 };
            host.report(self.stage, self.account.counts(), Some(times));
        }
        Ok(())
    }

    /// Sends the image of a shot; a black image if it shows a pattern that is not simulated.
    fn send(&mut self, header: &FrameHeader, shot: &Shot, images: &ImageLoop) -> Result<(), TransportError> {
        let Self { reader, output, .. } = self;
        let (len, row_bytes) = (reader.image_bytes(), reader.whole_row_bytes());
        match shot.step.and_then(|step| images.image(self.id, shot.number, step)) {
            Some(image) if reader.is_passthrough(row_bytes) => output.send(header, image.bytes),
            Some(image) => output.send_filled(header, len, |pixels| {
                if let Err(error) = reader.read(0, image.bytes, row_bytes, pixels) {
                    tracing::warn!("{error}");
                    pixels.fill(0);
                }
            }),
            None => output.send_filled(header, len, |pixels| pixels.fill(0)),
        }
    }

    /// Returns the arrival time of the next image.
    pub(crate) fn next_ns(&self) -> Option<u64> {
        self.camera.next_ns()
    }

    pub(crate) fn report(&self, host: &mut Host) {
        host.report(self.stage, self.account.counts(), None);
    }

    pub(crate) fn ensure_connected(&mut self) -> Result<(), TransportError> {
        self.output.ensure_connected().map(|_| ())
    }

    /// Counts the images that are still on their way at the end of the run as dropped.
    pub(crate) fn drop_in_transit(&mut self) -> Result<(), AccountError> {
        let in_work = self.account.counts().in_work().unwrap_or(0);
        self.account.drop_many(DropReason::Stopped, in_work)
    }
}

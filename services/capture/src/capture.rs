//! Publishes the images of a camera.
//!
//! In: images in the driver's buffers. Out: images in shared memory, each copied once, and the counts of the account.

use fringeflow_config::{CameraSource, V4l2Camera};
use fringeflow_dataset::CameraId;
use fringeflow_message::{DropReason, FrameHeader, ScanState, Stage, flags};
use fringeflow_pixels::{ImageReader, UnpackError};
use fringeflow_runtime::{Account, AccountError, Host, ItemTimes, MAX_WAIT, ServiceError, clock, receive};
use fringeflow_transport::{CAM1_FRAME, CAM2_FRAME, Publisher, SCAN_STATE, Subscriber, TransportError, wait_for};

use crate::camera::{Camera, Image};
use crate::device::Wanted;
use crate::time_stamps::Stamped;

/// A camera with its channel and its account.
pub(crate) struct Capture {
    id: CameraId,
    stage: Stage,
    camera: Camera,
    reader: ImageReader,
    account: Account,
    output: Publisher<FrameHeader, [u8]>,
    states: Subscriber<(), ScanState>,
    scanning: bool,
    /// Last logged fault of an image; repetitions are not logged.
    last_logged: Option<String>,
}

impl Capture {
    pub(crate) fn open(host: &Host, id: CameraId) -> Result<Self, ServiceError> {
        let settings = camera_settings(host, id)?;
        let (stage, channel) = match id {
            CameraId::Cam1 => (Stage::Camera1, CAM1_FRAME),
            CameraId::Cam2 => (Stage::Camera2, CAM2_FRAME),
        };
        let wanted = Wanted {
            format: host.configuration.device_images.format(),
            size_px: host.setup.readout.sensor_px(),
            rate_hz: host.configuration.rate_hz,
        };
        Ok(Self {
            id,
            stage,
            camera: Camera::new(settings, wanted),
            reader: ImageReader::new(host.configuration.device_images, host.setup.readout)
                .map_err(|e| ServiceError::Unusable(e.to_string()))?,
            account: host.open_account(stage)?,
            output: Publisher::open(&host.node, channel, &host.sizes)?,
            states: Subscriber::open(&host.node, SCAN_STATE, &host.sizes)?,
            scanning: false,
            last_logged: None,
        })
    }

    /// Waits for images for at most [`MAX_WAIT`] and publishes those that arrive. Buffers that are filled when the scan
    /// stops are still published.
    pub(crate) fn run_once(&mut self, host: &mut Host, is_last: bool) -> Result<(), ServiceError> {
        let was_scanning = self.scanning;
        while let Some(state) = receive(&mut self.states) {
            self.scanning = state.scanning != 0;
        }
        self.scanning &= !is_last;
        if self.scanning {
            self.camera.ensure_streaming().map_err(|e| ServiceError::Unusable(e.to_string()))?;
            if !self.camera.wait(MAX_WAIT) {
                wait_for(&[&self.states], MAX_WAIT)?;
            }
        }
        self.publish_all(host)?;
        self.camera.incidents.write(&mut self.account)?;
        if !self.scanning {
            if was_scanning {
                self.camera.close();
            }
            if !is_last {
                wait_for(&[&self.states], MAX_WAIT)?;
            }
        }
        Ok(())
    }

    /// Reports the counts.
    pub(crate) fn report(&self, host: &mut Host) {
        host.report(self.stage, self.account.counts(), None);
    }

    pub(crate) fn ensure_connected(&mut self, now_ns: u64) -> Result<(), TransportError> {
        self.output.ensure_connected()?;
        self.states.ensure_connected(now_ns).map(|_| ())
    }

    fn publish_all(&mut self, host: &mut Host) -> Result<(), AccountError> {
        while let Some(image) = self.camera.next_image() {
            if image.missing > 0 {
                self.count_lost(image.missing, DropReason::CameraLost)?;
            }
            match image.stamped {
                Ok(stamped) => self.publish(&image, &stamped, host)?,
                Err(reason) => self.count_lost(1, reason)?,
            }
            self.camera.give_back(image);
        }
        Ok(())
    }

    fn publish(&mut self, image: &Image, stamped: &Stamped, host: &mut Host) -> Result<(), AccountError> {
        let header = self.header(image, stamped);
        let bytes = self.camera.bytes(image);
        let stride_bytes = self.camera.prepared().map_or(0, |prepared| prepared.stride_bytes);
        let passed = self.account.counts().passed;
        match send(&mut self.output, &mut self.account, &header, &mut self.reader, (bytes, stride_bytes)) {
            Ok(()) => self.last_logged = None,
            Err(SendError::Transport(error)) => {
                tracing::warn!("{error}");
                // An unsent image that has its number leaves a gap in the channel, and subscribers count it as lost.
                // Without a number it is counted here.
                if self.account.counts().passed == passed {
                    return self.count_lost(1, DropReason::NoSample);
                }
            }
            Err(SendError::Account(error)) => return Err(error),
            Err(SendError::Image(error)) => return self.drop_damaged(&error),
        }
        let exposure_start_ns = stamped.exposure_start_ns;
        let received_ns = image.received_ns;
        let times = ItemTimes { exposure_start_ns, received_ns, taken_ns: received_ns, passed_ns: clock::now_ns() };
        host.report(self.stage, self.account.counts(), Some(times));
        Ok(())
    }

    /// Returns the header of an image. Its number in the channel is set when it is sent.
    fn header(&self, image: &Image, stamped: &Stamped) -> FrameHeader {
        let format = self.reader.pixel_format();
        let [width_px, height_px] = self.reader.image_size_px().map(|side| side as u32);
        let prepared = self.camera.prepared();
        FrameHeader {
            session: image.session,
            sequence: image.number,
            published: 0,
            exposure_start_ns: stamped.exposure_start_ns,
            received_ns: image.received_ns,
            exposure_ns: prepared.and_then(|prepared| prepared.exposure_ns).unwrap_or(0),
            width_px,
            height_px,
            stride_bytes: width_px * format.bytes() as u32,
            pixel_format: format.code(),
            flags: if stamped.is_estimated { flags::START_RECKONED } else { 0 },
            camera: self.id as u32 + 1,
        }
    }

    fn drop_damaged(&mut self, error: &UnpackError) -> Result<(), AccountError> {
        let text = error.to_string();
        if self.last_logged.as_ref() != Some(&text) {
            tracing::warn!("damaged image: {text}");
            self.last_logged = Some(text);
        }
        self.count_lost(1, DropReason::BadImage)
    }

    /// Counts images that are not published.
    fn count_lost(&mut self, images: u64, reason: DropReason) -> Result<(), AccountError> {
        self.account.count_taken(images)?;
        self.account.drop_many(reason, images)
    }
}

/// Why an image was not sent.
#[derive(Debug)]
enum SendError {
    Image(UnpackError),
    Account(AccountError),
    Transport(TransportError),
}

/// Copies the used region of an image into shared memory, in rows without gaps, and sends it.
fn send(
    output: &mut Publisher<FrameHeader, [u8]>,
    account: &mut Account,
    header: &FrameHeader,
    reader: &mut ImageReader,
    (bytes, stride_bytes): (&[u8], usize),
) -> Result<(), SendError> {
    let len = reader.image_bytes();
    let number_header = |account: &mut Account| {
        let published = account.count_taken_and_passed().map_err(SendError::Account)?;
        Ok(FrameHeader { published, ..*header })
    };
    // An image that needs no conversion is copied as a whole, into memory that was not cleared before.
    if let Some(pixels) = bytes.get(..len).filter(|_| reader.is_passthrough(stride_bytes)) {
        let header = number_header(account)?;
        return output.send(&header, pixels).map_err(SendError::Transport);
    }
    let sent = output.try_send_filled(len, |pixels| {
        reader.read(0, bytes, stride_bytes, pixels).map_err(SendError::Image)?;
        number_header(account)
    });
    sent.map_err(SendError::Transport)?
}

/// Returns the settings of a V4L2 camera.
///
/// # Errors
/// The configuration has another source of images.
fn camera_settings(host: &Host, id: CameraId) -> Result<V4l2Camera, ServiceError> {
    match &host.configuration.cameras {
        CameraSource::V4l2(cameras) => Ok(cameras[id as usize].clone()),
        CameraSource::Virtual | CameraSource::External => {
            let why = "the configuration has no V4L2 cameras; set cameras.source = \"v4l2\"";
            Err(ServiceError::Unusable(why.to_owned()))
        }
    }
}

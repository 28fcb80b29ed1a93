//! A camera with its channel and its account: images out of the driver's buffers into shared memory, each copied once.

use fringeflow_config::{CameraSource, V4l2Camera};
use fringeflow_dataset::CameraId;
use fringeflow_message::{DropReason, FrameHeader, ScanState, Stage, flags};
use fringeflow_pixels::{ImageReader, UnpackError};
use fringeflow_runtime::{Account, AccountError, BEAT, Host, ItemTimes, ServiceError, clock, receive};
use fringeflow_transport::{CAM1_FRAME, CAM2_FRAME, Publisher, SCAN_STATE, Subscriber, TransportError, wait_for};

use crate::camera::{Camera, Image};
use crate::device::Wanted;
use crate::stamp::Stamped;

/// The service around a camera.
pub(crate) struct Capture {
    id: CameraId,
    stage: Stage,
    camera: Camera,
    reader: ImageReader,
    account: Account,
    output: Publisher<FrameHeader, [u8]>,
    states: Subscriber<(), ScanState>,
    scanning: bool,
    /// The last fault of an image that was logged: what repeats itself is said once.
    logged: Option<String>,
}

impl Capture {
    pub(crate) fn open(host: &Host, id: CameraId) -> Result<Self, ServiceError> {
        let settings = settings(host, id)?;
        let (stage, channel) = match id {
            CameraId::Cam1 => (Stage::Camera1, CAM1_FRAME),
            CameraId::Cam2 => (Stage::Camera2, CAM2_FRAME),
        };
        let wanted = Wanted {
            format: host.configuration.source_format,
            size_px: host.setup.readout.sensor_px(),
            rate_hz: host.configuration.rate_hz,
        };
        Ok(Self {
            id,
            stage,
            camera: Camera::new(settings, wanted),
            reader: ImageReader::new(wanted.format, host.setup.readout),
            account: host.account(stage)?,
            output: Publisher::open(&host.node, channel, &host.sizes)?,
            states: Subscriber::open(&host.node, SCAN_STATE, &host.sizes)?,
            scanning: false,
            logged: None,
        })
    }

    /// Waits for images for a while and puts out what comes; what the driver has filled when the scan stops still counts.
    pub(crate) fn turn(&mut self, host: &mut Host, is_last: bool) -> Result<(), ServiceError> {
        let was_scanning = self.scanning;
        while let Some(state) = receive(&mut self.states) {
            self.scanning = state.scanning != 0;
        }
        self.scanning &= !is_last;
        if self.scanning {
            self.camera.ensure_streaming().map_err(|e| ServiceError::Unusable(e.to_string()))?;
            if !self.camera.wait(BEAT) {
                wait_for(&[&self.states], BEAT)?;
            }
        }
        self.put_out_all(host)?;
        self.camera.notes.write(&mut self.account)?;
        if !self.scanning {
            if was_scanning {
                self.camera.close();
            }
            if !is_last {
                wait_for(&[&self.states], BEAT)?;
            }
        }
        Ok(())
    }

    /// A sign of life.
    pub(crate) fn report(&self, host: &mut Host) {
        host.report(self.stage, self.account.counts(), None);
    }

    pub(crate) fn ensure_connected(&mut self, now_ns: u64) -> Result<(), TransportError> {
        self.output.ensure_connected()?;
        self.states.ensure_connected(now_ns).map(|_| ())
    }

    fn put_out_all(&mut self, host: &mut Host) -> Result<(), AccountError> {
        while let Some(image) = self.camera.take() {
            if image.missing > 0 {
                self.lose(image.missing, DropReason::CameraLost)?;
            }
            match image.stamped {
                Ok(stamped) => self.put_out(&image, &stamped, host)?,
                Err(reason) => self.lose(1, reason)?,
            }
            self.camera.give_back(image);
        }
        Ok(())
    }

    fn put_out(&mut self, image: &Image, stamped: &Stamped, host: &mut Host) -> Result<(), AccountError> {
        let header = self.header(image, stamped);
        let bytes = self.camera.bytes(image);
        let stride_bytes = self.camera.prepared().map_or(0, |prepared| prepared.stride_bytes);
        let passed = self.account.counts().passed;
        match send(&mut self.output, &mut self.account, &header, &mut self.reader, (bytes, stride_bytes)) {
            Ok(()) => self.logged = None,
            Err(Unsent::Transport(error)) => {
                tracing::warn!("{error}");
                // What has its number and could not be sent is missing in the channel, and counted there.
                if self.account.counts().passed == passed {
                    return self.lose(1, DropReason::NoSample);
                }
            }
            Err(Unsent::Account(error)) => return Err(error),
            Err(Unsent::Image(error)) => return self.refuse(&error),
        }
        let exposure_start_ns = stamped.exposure_start_ns;
        let received_ns = image.received_ns;
        let times = ItemTimes { exposure_start_ns, received_ns, taken_ns: received_ns, passed_ns: clock::now_ns() };
        host.report(self.stage, self.account.counts(), Some(times));
        Ok(())
    }

    /// The header of an image.
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
            flags: if stamped.is_reckoned { flags::START_RECKONED } else { 0 },
            camera: self.id as u32 + 1,
        }
    }

    fn refuse(&mut self, error: &UnpackError) -> Result<(), AccountError> {
        let words = error.to_string();
        if self.logged.as_ref() != Some(&words) {
            tracing::warn!("a damaged image: {words}");
            self.logged = Some(words);
        }
        self.lose(1, DropReason::BadImage)
    }

    /// Counts images that are not put out.
    fn lose(&mut self, images: u64, reason: DropReason) -> Result<(), AccountError> {
        self.account.take(images)?;
        self.account.drop_many(reason, images)
    }
}

/// Why an image was not sent.
#[derive(Debug)]
enum Unsent {
    Image(UnpackError),
    Account(AccountError),
    Transport(TransportError),
}

/// Copies what is used of an image into shared memory, in rows without gaps, and sends it.
fn send(
    output: &mut Publisher<FrameHeader, [u8]>,
    account: &mut Account,
    header: &FrameHeader,
    reader: &mut ImageReader,
    (bytes, stride_bytes): (&[u8], usize),
) -> Result<(), Unsent> {
    let len = reader.image_bytes();
    let numbered = |account: &mut Account| {
        let published = account.take_and_pass().map_err(Unsent::Account)?;
        Ok(FrameHeader { published, ..*header })
    };
    // Rows that go out as they came are copied as one, into memory that nobody has cleared before.
    if let Some(pixels) = bytes.get(..len).filter(|_| reader.is_passthrough(stride_bytes)) {
        let header = numbered(account)?;
        return output.send(&header, pixels).map_err(Unsent::Transport);
    }
    let made = output.try_send_filled(len, |pixels| {
        reader.read(bytes, stride_bytes, pixels).map_err(Unsent::Image)?;
        numbered(account)
    });
    made.map_err(Unsent::Transport)?
}

fn settings(host: &Host, id: CameraId) -> Result<V4l2Camera, ServiceError> {
    match &host.configuration.cameras {
        CameraSource::V4l2(cameras) => Ok(cameras[id as usize].clone()),
        CameraSource::Virtual | CameraSource::External => {
            let why = "the configuration has no V4L2 cameras; set cameras.source = \"v4l2\"";
            Err(ServiceError::Unusable(why.to_owned()))
        }
    }
}

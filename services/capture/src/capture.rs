//! Publishes the images of a device: those of one camera, or both views of a device that gives the images of both.
//!
//! In: images in the driver's buffers. Out: images in shared memory, each copied once, and the counts of the accounts.
//! Both views of an image have the same session, number and times, so they are a pair.

use fringeflow_config::{CameraSource, V4l2Camera};
use fringeflow_message::{DropReason, FrameHeader, ScanState, flags};
use fringeflow_pixels::{ImageReader, UnpackError};
use fringeflow_runtime::{AccountError, Host, ItemTimes, MAX_WAIT, ServiceError, clock, receive};
use fringeflow_transport::{SCAN_STATE, Subscriber, TransportError, wait_for};

use crate::camera::{Camera, Image};
use crate::camera_channel::{CameraChannel, SendError, send_both};
use crate::captured_cameras::CapturedCameras;
use crate::device::Wanted;
use crate::time_stamps::Stamped;

/// A device with the channels and accounts of its cameras.
pub(crate) struct Capture {
    camera: Camera,
    reader: ImageReader,
    /// That of the only camera, or of camera 1. The incidents of the device are in its account.
    channel: CameraChannel,
    /// That of camera 2, if the device gives the images of both.
    second: Option<CameraChannel>,
    states: Subscriber<(), ScanState>,
    scanning: bool,
    /// Last logged fault of an image; repetitions are not logged.
    last_logged: Option<String>,
}

impl Capture {
    pub(crate) fn open(host: &Host, cameras: CapturedCameras) -> Result<Self, ServiceError> {
        let settings = device_settings(host, cameras)?;
        let wanted = Wanted {
            images: host.configuration.device_images,
            view_px: host.setup.readout.sensor_px(),
            rate_hz: host.configuration.rate_hz,
        };
        let reader = ImageReader::new(wanted.images, host.setup.readout);
        Ok(Self {
            camera: Camera::new(settings, wanted),
            reader: reader.map_err(|e| ServiceError::Unusable(e.to_string()))?,
            channel: CameraChannel::open(host, cameras.first())?,
            second: cameras.second().map(|id| CameraChannel::open(host, id)).transpose()?,
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
        self.camera.incidents.write(&mut self.channel.account)?;
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
        self.report_item(host, None);
    }

    pub(crate) fn ensure_connected(&mut self, now_ns: u64) -> Result<(), TransportError> {
        self.channels_mut().try_for_each(CameraChannel::ensure_connected)?;
        self.states.ensure_connected(now_ns).map(|_| ())
    }

    fn channels(&self) -> impl Iterator<Item = &CameraChannel> {
        [&self.channel].into_iter().chain(&self.second)
    }

    fn channels_mut(&mut self) -> impl Iterator<Item = &mut CameraChannel> {
        [&mut self.channel].into_iter().chain(&mut self.second)
    }

    fn report_item(&self, host: &mut Host, times: Option<ItemTimes>) {
        self.channels().for_each(|channel| host.report(channel.stage, channel.account.counts(), times));
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
        let passed = self.channel.account.counts().passed;
        let source = (bytes, stride_bytes);
        let sent = match &mut self.second {
            None => self.channel.send(&header, &mut self.reader, source),
            Some(second) => send_both([&mut self.channel, second], &header, &mut self.reader, source),
        };
        match sent {
            Ok(()) => self.last_logged = None,
            Err(SendError::Transport(error)) => {
                tracing::warn!("{error}");
                // An unsent image that has its number leaves a gap in the channel, and subscribers count it as lost.
                // Without a number it is counted here.
                if self.channel.account.counts().passed == passed {
                    return self.count_lost(1, DropReason::NoSample);
                }
            }
            Err(SendError::Account(error)) => return Err(error),
            Err(SendError::Image(error)) => return self.drop_damaged(&error),
        }
        let exposure_start_ns = stamped.exposure_start_ns;
        let received_ns = image.received_ns;
        let passed_ns = clock::now_ns();
        let times = ItemTimes { exposure_start_ns, received_ns, taken_ns: received_ns, passed_ns, waited_ns: 0 };
        self.report_item(host, Some(times));
        Ok(())
    }

    /// Returns the header of an image. Its camera, and its number in the channel, are set when it is sent.
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
            camera: 0,
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

    /// Counts images of the device that are not published, for each of its cameras.
    fn count_lost(&mut self, images: u64, reason: DropReason) -> Result<(), AccountError> {
        self.channels_mut().try_for_each(|channel| channel.count_lost(images, reason))
    }
}

/// Returns the settings of a V4L2 device.
///
/// # Errors
/// The configuration has another source of images.
fn device_settings(host: &Host, cameras: CapturedCameras) -> Result<V4l2Camera, ServiceError> {
    match (&host.configuration.cameras, cameras) {
        (CameraSource::V4l2(devices), CapturedCameras::One(id)) => Ok(devices[id as usize].clone()),
        (CameraSource::V4l2Stereo(device), CapturedCameras::Both) => Ok((**device).clone()),
        _ => {
            let why = "the configuration has no V4L2 device for this service; set cameras.source = \"v4l2\", and \
                       [cameras.cam1] and [cameras.cam2] for two devices or [cameras.both] for one";
            Err(ServiceError::Unusable(why.to_owned()))
        }
    }
}

//! The channel and the account of one camera, and how images get there.

use fringeflow_dataset::CameraId;
use fringeflow_message::{DropReason, FrameHeader, Stage};
use fringeflow_pixels::{ImageReader, UnpackError};
use fringeflow_runtime::{Account, AccountError, Host, ServiceError};
use fringeflow_transport::{CAM1_FRAME, CAM2_FRAME, Publisher, TransportError};

/// The channel and the account of one camera.
pub(crate) struct CameraChannel {
    id: CameraId,
    pub(crate) stage: Stage,
    pub(crate) account: Account,
    output: Publisher<FrameHeader, [u8]>,
}

/// Why an image was not sent.
#[derive(Debug)]
pub(crate) enum SendError {
    /// The image is damaged.
    Image(UnpackError),
    /// An account cannot be written.
    Account(AccountError),
    /// A channel takes no image.
    Transport(TransportError),
}

impl CameraChannel {
    pub(crate) fn open(host: &Host, id: CameraId) -> Result<Self, ServiceError> {
        let (stage, channel) = match id {
            CameraId::Cam1 => (Stage::Camera1, CAM1_FRAME),
            CameraId::Cam2 => (Stage::Camera2, CAM2_FRAME),
        };
        let account = host.open_account(stage)?;
        Ok(Self { id, stage, account, output: Publisher::open(&host.node, channel, &host.sizes)? })
    }

    pub(crate) fn ensure_connected(&mut self) -> Result<(), TransportError> {
        self.output.ensure_connected().map(|_| ())
    }

    /// Counts images that are not published.
    pub(crate) fn count_lost(&mut self, images: u64, reason: DropReason) -> Result<(), AccountError> {
        self.account.count_taken(images)?;
        self.account.drop_many(reason, images)
    }

    /// Copies the used region of an image into shared memory, in rows without gaps, and sends it.
    ///
    /// # Errors
    /// [`SendError`]. After an error of the channel the image may have its number, which is then a gap in the channel.
    pub(crate) fn send(
        &mut self,
        header: &FrameHeader,
        reader: &mut ImageReader,
        (bytes, stride_bytes): (&[u8], usize),
    ) -> Result<(), SendError> {
        let Self { id, account, output, .. } = self;
        let len = reader.image_bytes();
        // An image that needs no conversion is copied as a whole, into memory that was not cleared before.
        if let Some(pixels) = bytes.get(..len).filter(|_| reader.is_passthrough(stride_bytes)) {
            let header = numbered(*id, account, header)?;
            return output.send(&header, pixels).map_err(SendError::Transport);
        }
        let sent = output.try_send_filled(len, |pixels| {
            reader.read(0, bytes, stride_bytes, pixels).map_err(SendError::Image)?;
            numbered(*id, account, header)
        });
        sent.map_err(SendError::Transport)?
    }
}

/// Sends the views of an image to both cameras' channels, as [`CameraChannel::send`] does. Either both get a number or
/// none.
///
/// # Errors
/// [`SendError`], the first one.
pub(crate) fn send_both(
    [first, second]: [&mut CameraChannel; 2],
    header: &FrameHeader,
    reader: &mut ImageReader,
    (bytes, stride_bytes): (&[u8], usize),
) -> Result<(), SendError> {
    let len = reader.image_bytes();
    let published = first.account.counts().passed;
    let first_header = FrameHeader { published, camera: first.id as u32 + 1, ..*header };
    let mut sent_second = Ok(());
    let sent_first = first.output.try_send_filled(len, |first_pixels| {
        let sent = second.output.try_send_filled(len, |second_pixels| {
            reader.read_both(bytes, stride_bytes, [first_pixels, second_pixels]).map_err(SendError::Image)?;
            first.account.count_taken_and_passed().map_err(SendError::Account)?;
            numbered(second.id, &mut second.account, header)
        });
        match sent.map_err(SendError::Transport).and_then(|filled| filled) {
            Err(error) if first.account.counts().passed == published => Err(error),
            // With its number, the image of camera 1 is sent even if that of camera 2 was not.
            sent => {
                sent_second = sent;
                Ok(first_header)
            }
        }
    });
    sent_first.map_err(SendError::Transport)??;
    sent_second
}

/// Counts an image as taken and published, and returns its header with its number in the channel.
fn numbered(id: CameraId, account: &mut Account, header: &FrameHeader) -> Result<FrameHeader, SendError> {
    let published = account.count_taken_and_passed().map_err(SendError::Account)?;
    Ok(FrameHeader { published, camera: id as u32 + 1, ..*header })
}

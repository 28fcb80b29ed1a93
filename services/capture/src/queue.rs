//! The queue of buffers that a driver fills: mapped memory that is queued and dequeued in turn.
//!
//! In: an open device whose format is set. Out: buffers filled with images. Every buffer belongs either to the driver
//! or to this program. A buffer that the driver refuses stays here, and is queued again later.

use std::os::fd::AsFd;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use v4l::v4l_sys::{v4l2_memory_V4L2_MEMORY_MMAP as MEMORY_MMAP, v4l2_requestbuffers};

use crate::ioctl::{
    BufferKind, BufferMetadata, BufferToken, CallError, Device, Mapping, REQBUFS, STREAMOFF, STREAMON, zeroed,
};

/// A running stream of buffers. Dropping it stops the stream.
#[derive(Debug)]
pub(crate) struct Queue {
    device: Rc<Device>,
    kind: BufferKind,
    /// Identifies the buffers of this stream among those of others.
    stream: u64,
    /// Memory of each buffer, by index and plane.
    buffers: Vec<Vec<Mapping>>,
    /// Buffers that the driver refused.
    refused: Vec<BufferToken>,
}

/// A buffer with an image. It must be queued again.
#[derive(Debug)]
pub(crate) struct FilledBuffer {
    token: BufferToken,
    pub(crate) metadata: BufferMetadata,
}

/// How a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Waited {
    /// The driver has an image or an error.
    Ready,
    /// The time-out has passed.
    TimedOut,
    /// A signal interrupted the wait.
    Interrupted,
}

/// Number of streams started in this process.
static STREAMS: AtomicU64 = AtomicU64::new(0);

impl Queue {
    /// Starts a stream of `count` buffers, or as many as the driver allocates.
    ///
    /// # Errors
    /// The driver refuses a call; the buffers are freed again.
    pub(crate) fn start(device: Rc<Device>, kind: BufferKind, count: u32) -> Result<Self, CallError> {
        let stream = STREAMS.fetch_add(1, Ordering::Relaxed);
        let mut queue = Self { device, kind, stream, buffers: Vec::new(), refused: Vec::new() };
        let granted = queue.request_buffers(count)?;
        for index in 0..granted {
            let (mappings, token) = queue.device.map_buffer(kind, stream, index)?;
            queue.buffers.push(mappings);
            queue.device.queue_buffer(kind, token).map_err(|(error, _)| error)?;
        }
        queue.device.call(&STREAMON, &mut kind.code.cast_signed())?;
        Ok(queue)
    }

    /// Waits until the driver has an image or an error.
    ///
    /// # Errors
    /// `poll` fails.
    pub(crate) fn wait(&self, timeout: Duration) -> Result<Waited, CallError> {
        let fd = self.device.as_fd();
        let timeout = Timespec { tv_sec: timeout.as_secs() as i64, tv_nsec: timeout.subsec_nanos().into() };
        match poll(&mut [PollFd::new(&fd, PollFlags::IN)], Some(&timeout)) {
            // An error condition counts as ready: the next call returns the error.
            Ok(1..) => Ok(Waited::Ready),
            Ok(0) => Ok(Waited::TimedOut),
            Err(Errno::INTR) => {
                self.device.count_interruption();
                Ok(Waited::Interrupted)
            }
            Err(errno) => Err(CallError { call: "poll", source: errno.into() }),
        }
    }

    /// Dequeues the next filled buffer. Returns `None` if there is none yet.
    ///
    /// # Errors
    /// The driver refuses the call.
    pub(crate) fn dequeue(&mut self) -> Result<Option<FilledBuffer>, CallError> {
        match self.device.dequeue_buffer(self.kind, self.stream) {
            Ok((token, metadata)) => Ok(Some(FilledBuffer { token, metadata })),
            Err(error) if error.errno() == Some(Errno::AGAIN) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Returns the bytes of an image.
    pub(crate) fn bytes<'a>(&'a self, buffer: &'a FilledBuffer) -> &'a [u8] {
        let plane = self.buffers.get(buffer.token.index as usize).and_then(|planes| planes.first());
        plane.map_or(&[], |plane| plane.bytes(&buffer.token, buffer.metadata.bytes))
    }

    /// Queues a buffer again, and those that were refused before.
    ///
    /// # Errors
    /// The driver refuses a buffer. The next call queues it again.
    pub(crate) fn requeue(&mut self, buffer: FilledBuffer) -> Result<(), CallError> {
        self.refused.push(buffer.token);
        self.retry_refused()
    }

    /// Queues the refused buffers again.
    ///
    /// # Errors
    /// The driver refuses a buffer again.
    pub(crate) fn retry_refused(&mut self) -> Result<(), CallError> {
        while let Some(token) = self.refused.pop() {
            if let Err((error, token)) = self.device.queue_buffer(self.kind, token) {
                self.refused.push(token);
                return Err(error);
            }
        }
        Ok(())
    }

    fn request_buffers(&self, count: u32) -> Result<u32, CallError> {
        let mut request = v4l2_requestbuffers { count, type_: self.kind.code, memory: MEMORY_MMAP, ..zeroed() };
        self.device.call(&REQBUFS, &mut request)?;
        Ok(request.count)
    }
}

impl Drop for Queue {
    /// Stops the stream and frees its buffers. Errors are ignored: the device may be gone.
    fn drop(&mut self) {
        let _ = self.device.call(&STREAMOFF, &mut self.kind.code.cast_signed());
        self.buffers.clear();
        let _ = self.request_buffers(0);
    }
}

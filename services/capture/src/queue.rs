//! The queue of buffers that a driver fills: mapped memory, given to the driver and taken back in turn.
//!
//! In: an open device whose format is set. Out: buffers filled with images. Every buffer is either with the driver or held
//! here; one that the driver refuses stays held, and is offered again.

use std::os::fd::AsFd;
use std::rc::Rc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use v4l::v4l_sys::{v4l2_memory_V4L2_MEMORY_MMAP as MEMORY_MMAP, v4l2_requestbuffers};

use crate::ioctl::{BufferKind, CallError, Device, Filled, Held, Mapping, REQBUFS, STREAMOFF, STREAMON, zeroed};

/// A stream of buffers that runs until this is dropped.
#[derive(Debug)]
pub(crate) struct Queue {
    device: Rc<Device>,
    kind: BufferKind,
    /// Tells the buffers of this stream from those of others.
    stream: u64,
    /// Memory of each buffer, by its number and plane.
    buffers: Vec<Vec<Mapping>>,
    /// Buffers that the driver refused to take.
    refused: Vec<Held>,
}

/// A buffer with an image; to be given back.
#[derive(Debug)]
pub(crate) struct FilledBuffer {
    held: Held,
    pub(crate) filled: Filled,
}

/// What a wait ended with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Waited {
    /// The driver has something to say: an image, or an error.
    Ready,
    /// The time is up.
    TimedOut,
    /// A signal came.
    Interrupted,
}

/// Streams so far in this process.
static STREAMS: AtomicU64 = AtomicU64::new(0);

impl Queue {
    /// Starts a stream of `count` buffers, or as many as the driver gives.
    ///
    /// # Errors
    /// The driver refuses a call; nothing is left behind.
    pub(crate) fn start(device: Rc<Device>, kind: BufferKind, count: u32) -> Result<Self, CallError> {
        let stream = STREAMS.fetch_add(1, Ordering::Relaxed);
        let mut queue = Self { device, kind, stream, buffers: Vec::new(), refused: Vec::new() };
        let granted = queue.request_buffers(count)?;
        for index in 0..granted {
            let (mappings, held) = queue.device.map_buffer(kind, stream, index)?;
            queue.buffers.push(mappings);
            queue.device.queue_buffer(kind, held).map_err(|(error, _)| error)?;
        }
        queue.device.call(&STREAMON, &mut kind.code.cast_signed())?;
        Ok(queue)
    }

    /// Waits until the driver has something to say.
    ///
    /// # Errors
    /// The wait itself fails.
    pub(crate) fn wait(&self, rest: Duration) -> Result<Waited, CallError> {
        let fd = self.device.as_fd();
        let rest = Timespec { tv_sec: rest.as_secs() as i64, tv_nsec: rest.subsec_nanos().into() };
        match poll(&mut [PollFd::new(&fd, PollFlags::IN)], Some(&rest)) {
            // An error condition counts as ready: the next call tells what it is.
            Ok(1..) => Ok(Waited::Ready),
            Ok(0) => Ok(Waited::TimedOut),
            Err(Errno::INTR) => {
                self.device.count_interruption();
                Ok(Waited::Interrupted)
            }
            Err(errno) => Err(CallError { call: "poll", source: errno.into() }),
        }
    }

    /// The next buffer that the driver has filled; `None` where there is none yet.
    ///
    /// # Errors
    /// The driver refuses.
    pub(crate) fn take(&mut self) -> Result<Option<FilledBuffer>, CallError> {
        match self.device.dequeue_buffer(self.kind, self.stream) {
            Ok((held, filled)) => Ok(Some(FilledBuffer { held, filled })),
            Err(error) if error.errno() == Some(Errno::AGAIN) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The bytes of an image.
    pub(crate) fn bytes<'a>(&'a self, buffer: &'a FilledBuffer) -> &'a [u8] {
        let plane = self.buffers.get(buffer.held.index as usize).and_then(|planes| planes.first());
        plane.map_or(&[], |plane| plane.bytes(&buffer.held, buffer.filled.bytes))
    }

    /// Gives a buffer back, and those that were refused before.
    ///
    /// # Errors
    /// The driver refuses; what it refused is offered again with the next one.
    pub(crate) fn give_back(&mut self, buffer: FilledBuffer) -> Result<(), CallError> {
        self.refused.push(buffer.held);
        self.offer_again()
    }

    /// Offers the buffers that were refused.
    ///
    /// # Errors
    /// The driver refuses one again.
    pub(crate) fn offer_again(&mut self) -> Result<(), CallError> {
        while let Some(held) = self.refused.pop() {
            if let Err((error, held)) = self.device.queue_buffer(self.kind, held) {
                self.refused.push(held);
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
    /// Stops the stream and frees its buffers, as far as the driver lets it: the device may be gone.
    fn drop(&mut self) {
        let _ = self.device.call(&STREAMOFF, &mut self.kind.code.cast_signed());
        self.buffers.clear();
        let _ = self.request_buffers(0);
    }
}

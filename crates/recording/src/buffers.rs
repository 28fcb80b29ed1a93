//! A pool of buffers for the messages that wait for the disk. The total size is limited; buffers are reused.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::Topic;
use crate::recordable::{Encoded, Times};

/// A message in the queue to the disk.
#[derive(Debug)]
pub(super) struct Item {
    pub(super) topic: Topic,
    pub(super) times: Times,
    pub(super) encoded: Encoded,
}

/// The buffers of all waiting messages.
#[derive(Debug)]
pub(super) struct BufferPool {
    limit_bytes: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Buffers that can be reused.
    free: Vec<Encoded>,
    /// Total size of all buffers, used or free, bytes.
    bytes: usize,
}

impl BufferPool {
    pub(super) fn new(limit_bytes: usize) -> Self {
        Self { limit_bytes, state: Mutex::default() }
    }

    /// Returns a buffer with room for `bytes`; `None` if the limit would be exceeded.
    pub(super) fn take(&self, bytes: usize) -> Option<Encoded> {
        let mut state = self.lock();
        // The smallest that is large enough, so that a short message leaves the buffer of a cloud to the next cloud.
        let fitting = state.free.iter().enumerate().filter(|(_, buffer)| buffer.bytes.capacity() >= bytes);
        if let Some((i, _)) = fitting.min_by_key(|(_, buffer)| buffer.bytes.capacity()) {
            return Some(state.free.swap_remove(i));
        }
        // If the free buffers are too small, some are dropped so that a larger one fits within the limit.
        while state.bytes.saturating_add(bytes) > self.limit_bytes {
            let freed = state.free.pop()?;
            state.bytes = state.bytes.saturating_sub(freed.bytes.capacity());
        }
        let encoded = Encoded { bytes: Vec::with_capacity(bytes), ..Encoded::default() };
        state.bytes += encoded.bytes.capacity();
        Some(encoded)
    }

    /// Counts the growth of a buffer from `old_bytes` to `new_bytes`.
    pub(super) fn count_growth(&self, old_bytes: usize, new_bytes: usize) {
        let mut state = self.lock();
        state.bytes = (state.bytes + new_bytes).saturating_sub(old_bytes);
    }

    /// Returns a buffer to the pool, and drops its held content.
    pub(super) fn give_back(&self, buffer: Encoded) {
        let buffer = Encoded { held: None, ..buffer };
        self.lock().free.push(buffer);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No code panics while it changes the state, so the state is valid even if the lock is poisoned.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_total_size_is_limited_and_a_returned_buffer_is_reused() {
        let buffers = BufferPool::new(1000);
        let first = buffers.take(600).unwrap();
        assert!(buffers.take(600).is_none());
        let address = first.bytes.as_ptr();
        buffers.give_back(first);
        assert_eq!(buffers.take(600).unwrap().bytes.as_ptr(), address);
    }

    #[test]
    fn a_short_message_leaves_a_large_buffer_to_others() {
        let buffers = BufferPool::new(1000);
        let [large, small] = [600, 300].map(|bytes| buffers.take(bytes).unwrap());
        buffers.give_back(small);
        buffers.give_back(large);
        assert!(buffers.take(200).unwrap().bytes.capacity() < 600);
        assert!(buffers.take(600).is_some());
    }

    #[test]
    fn free_buffers_that_are_too_small_are_dropped_for_a_larger_one() {
        let buffers = BufferPool::new(1000);
        let small = buffers.take(600).unwrap();
        buffers.give_back(small);
        assert!(buffers.take(900).is_some());
        assert!(buffers.take(200).is_none());
    }

    #[test]
    fn a_buffer_that_grew_leaves_less_for_others() {
        let buffers = BufferPool::new(1000);
        let small = buffers.take(100).unwrap();
        buffers.count_growth(small.bytes.capacity(), 800);
        assert!(buffers.take(300).is_none());
    }
}

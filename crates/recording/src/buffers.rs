//! What waits for the disk: messages in buffers that are bounded in bytes together, and are used again.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::Topic;
use super::recordable::{Encoded, Times};

/// A message on its way to the disk.
#[derive(Debug)]
pub(super) struct Item {
    pub(super) topic: Topic,
    pub(super) times: Times,
    pub(super) encoded: Encoded,
}

/// The buffers of all messages that wait.
#[derive(Debug)]
pub(super) struct Buffers {
    limit_bytes: usize,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Buffers that wait to be used again.
    free: Vec<Encoded>,
    /// Bytes of buffers, in use or free.
    bytes: usize,
}

impl Buffers {
    pub(super) fn new(limit_bytes: usize) -> Self {
        Self { limit_bytes, state: Mutex::default() }
    }

    /// A buffer for a message of so many bytes; `None` if all together have no room for it.
    pub(super) fn take(&self, bytes: usize) -> Option<Encoded> {
        let mut state = self.lock();
        if let Some(i) = state.free.iter().rposition(|buffer| buffer.bytes.capacity() >= bytes) {
            return Some(state.free.swap_remove(i));
        }
        while state.bytes.saturating_add(bytes) > self.limit_bytes {
            let freed = state.free.pop()?;
            state.bytes = state.bytes.saturating_sub(freed.bytes.capacity());
        }
        let encoded = Encoded { bytes: Vec::with_capacity(bytes), ..Encoded::default() };
        state.bytes += encoded.bytes.capacity();
        Some(encoded)
    }

    /// Counts what a buffer that had to grow takes more than was reckoned.
    pub(super) fn count_growth(&self, had_bytes: usize, has_bytes: usize) {
        let mut state = self.lock();
        state.bytes = (state.bytes + has_bytes).saturating_sub(had_bytes);
    }

    /// Takes a buffer back.
    pub(super) fn give_back(&self, buffer: Encoded) {
        self.lock().free.push(buffer);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No code that holds the lock can panic half-way through a change.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_than_all_may_take_are_given_and_a_buffer_given_back_is_used_again() {
        let buffers = Buffers::new(1000);
        let first = buffers.take(600).unwrap();
        assert!(buffers.take(600).is_none());
        let at = first.bytes.as_ptr();
        buffers.give_back(first);
        assert_eq!(buffers.take(600).unwrap().bytes.as_ptr(), at);
    }

    #[test]
    fn free_buffers_that_are_too_small_make_scratch() {
        let buffers = Buffers::new(1000);
        let small = buffers.take(600).unwrap();
        buffers.give_back(small);
        assert!(buffers.take(900).is_some());
        assert!(buffers.take(200).is_none());
    }

    #[test]
    fn a_buffer_that_grew_leaves_less_for_others() {
        let buffers = Buffers::new(1000);
        let small = buffers.take(100).unwrap();
        buffers.count_growth(small.bytes.capacity(), 800);
        assert!(buffers.take(300).is_none());
    }
}

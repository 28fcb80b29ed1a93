//! The queue between the channels and the disk: bounded in bytes, its buffers used again.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::Topic;
use super::recordable::{Encoded, Times};

/// A message on its way to the disk.
#[derive(Debug)]
pub(super) struct Item {
    pub(super) topic: Topic,
    pub(super) times: Times,
    pub(super) encoded: Encoded,
}

/// What the writer finds when it asks.
#[derive(Debug)]
pub(super) enum Next {
    Item(Item),
    /// Nothing came in time.
    Nothing,
    /// Nothing is left, and nothing will come.
    Ended,
}

/// The queue.
#[derive(Debug)]
pub(super) struct Queue {
    limit_bytes: usize,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    items: VecDeque<Item>,
    /// Buffers that wait to be used again.
    free: Vec<Encoded>,
    /// Bytes of buffers, in use or free.
    bytes: usize,
    ended: bool,
}

impl Queue {
    pub(super) fn new(limit_bytes: usize) -> Self {
        Self { limit_bytes, state: Mutex::default(), changed: Condvar::new() }
    }

    /// A buffer for a message of so many bytes; `None` if the queue is full.
    pub(super) fn buffer(&self, bytes: usize) -> Option<Encoded> {
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

    /// Adds a message; `had` is the capacity its buffer came with.
    pub(super) fn push(&self, item: Item, had: usize) {
        let mut state = self.lock();
        // A buffer that had to grow takes more than was reckoned.
        state.bytes = (state.bytes + item.encoded.bytes.capacity()).saturating_sub(had);
        state.items.push_back(item);
        self.changed.notify_one();
    }

    /// Takes the oldest message, or waits for one.
    pub(super) fn next(&self, wait: Duration) -> Next {
        let state = self.lock();
        let waited = self.changed.wait_timeout_while(state, wait, |state| state.items.is_empty() && !state.ended);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match state.items.pop_front() {
            Some(item) => Next::Item(item),
            None if state.ended => Next::Ended,
            None => Next::Nothing,
        }
    }

    /// Messages that wait.
    pub(super) fn waiting(&self) -> usize {
        self.lock().items.len()
    }

    /// Gives a buffer back.
    pub(super) fn give_back(&self, buffer: Encoded) {
        self.lock().free.push(buffer);
    }

    /// Says that nothing more will come.
    pub(super) fn end(&self) {
        self.lock().ended = true;
        self.changed.notify_one();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // No code that holds the lock can panic half-way through a change.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(encoded: Encoded) -> Item {
        Item { topic: Topic::Log, times: Times { log_ns: 0, publish_ns: 0 }, encoded }
    }

    #[test]
    fn a_full_queue_refuses_and_a_buffer_given_back_is_used_again() {
        let queue = Queue::new(1000);
        let first = queue.buffer(600).unwrap();
        assert!(queue.buffer(600).is_none());
        queue.push(item(first), 600);
        assert!(queue.buffer(600).is_none());
        let Next::Item(taken) = queue.next(Duration::ZERO) else { panic!("the item is there") };
        let at = taken.encoded.bytes.as_ptr();
        queue.give_back(taken.encoded);
        assert_eq!(queue.buffer(600).unwrap().bytes.as_ptr(), at);
    }

    #[test]
    fn free_buffers_that_are_too_small_make_room() {
        let queue = Queue::new(1000);
        let small = queue.buffer(600).unwrap();
        queue.give_back(small);
        assert!(queue.buffer(900).is_some());
        assert!(queue.buffer(200).is_none());
    }

    #[test]
    fn an_ended_queue_is_emptied_first() {
        let queue = Queue::new(1000);
        let buffer = queue.buffer(10).unwrap();
        queue.push(item(buffer), 10);
        queue.end();
        assert!(matches!(queue.next(Duration::ZERO), Next::Item(_)));
        assert!(matches!(queue.next(Duration::ZERO), Next::Ended));
    }
}

//! Content that is recorded without a copy, such as an image in shared memory. It is released once it is in the file.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Content of a message, held until it is written.
pub(super) struct HeldContent {
    content: Box<dyn AsRef<[u8]> + Send>,
    // Fields are dropped in the order of declaration: the slot must become free only after the content is dropped.
    _slot: HeldSlot,
}

/// A limited number of slots. Each held content occupies one.
#[derive(Debug)]
pub(super) struct HeldSlots {
    taken: Arc<AtomicUsize>,
    limit: usize,
}

/// A slot. It becomes free when dropped.
#[derive(Debug)]
pub(super) struct HeldSlot(Arc<AtomicUsize>);

impl HeldContent {
    pub(super) fn new(content: impl AsRef<[u8]> + Send + 'static, slot: HeldSlot) -> Self {
        Self { content: Box::new(content), _slot: slot }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        (*self.content).as_ref()
    }
}

impl fmt::Debug for HeldContent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HeldContent").field("bytes", &self.bytes().len()).finish()
    }
}

impl HeldSlots {
    pub(super) fn new(limit: usize) -> Self {
        Self { taken: Arc::default(), limit }
    }

    /// Takes a slot, if one is free.
    pub(super) fn take(&self) -> Option<HeldSlot> {
        let slot = HeldSlot(Arc::clone(&self.taken));
        // If no slot was free, the slot is dropped here, which restores the count.
        (self.taken.fetch_add(1, Ordering::Relaxed) < self.limit).then_some(slot)
    }
}

impl Drop for HeldSlot {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_slots_is_limited() {
        let slots = HeldSlots::new(2);
        let held: Vec<HeldContent> = (0..2).map(|_| HeldContent::new(vec![1, 2, 3], slots.take().unwrap())).collect();
        assert!(slots.take().is_none() && slots.take().is_none());
        assert_eq!(held[0].bytes(), [1, 2, 3]);
        drop(held);
        assert!(slots.take().is_some());
    }
}

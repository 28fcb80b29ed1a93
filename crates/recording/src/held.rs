//! Content that is recorded from where it lies, as an image in shared memory: it is let go when it is in the file.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is held of a message.
pub(super) struct Held {
    content: Box<dyn AsRef<[u8]> + Send>,
    // Behind the content: only when that is let go another may be held.
    _place: Place,
}

/// How many may be held at once.
#[derive(Debug)]
pub(super) struct Places {
    taken: Arc<AtomicUsize>,
    most: usize,
}

/// One of them.
#[derive(Debug)]
pub(super) struct Place(Arc<AtomicUsize>);

impl Held {
    pub(super) fn new(content: impl AsRef<[u8]> + Send + 'static, place: Place) -> Self {
        Self { content: Box::new(content), _place: place }
    }

    pub(super) fn bytes(&self) -> &[u8] {
        (*self.content).as_ref()
    }
}

impl fmt::Debug for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Held").field("bytes", &self.bytes().len()).finish()
    }
}

impl Places {
    pub(super) fn new(most: usize) -> Self {
        Self { taken: Arc::default(), most }
    }

    /// A place, if one is left.
    pub(super) fn take(&self) -> Option<Place> {
        let place = Place(Arc::clone(&self.taken));
        // Given back by the drop where it was one too many.
        (self.taken.fetch_add(1, Ordering::Relaxed) < self.most).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_are_held_than_may_be() {
        let places = Places::new(2);
        let held: Vec<Held> = (0..2).map(|_| Held::new(vec![1, 2, 3], places.take().unwrap())).collect();
        assert!(places.take().is_none() && places.take().is_none());
        assert_eq!(held[0].bytes(), [1, 2, 3]);
        drop(held);
        assert!(places.take().is_some());
    }
}

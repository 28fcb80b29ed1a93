//! Rooms that are taken by whoever works, and given back: as many as work at once, not one for each piece of work.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// Rooms that nobody has taken. What they hold has no meaning.
#[derive(Debug, Default)]
pub(super) struct Pool<T>(Mutex<Vec<T>>);

/// A room, until it is dropped.
pub(super) struct Taken<'a, T: Default> {
    pool: &'a Pool<T>,
    room: T,
}

impl<T: Default> Pool<T> {
    /// A room that was given back, or a new one.
    pub(super) fn take(&self) -> Taken<'_, T> {
        let room = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        Taken { pool: self, room }
    }

    /// All rooms that were given back.
    pub(super) fn rooms(&mut self) -> &mut [T] {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Clone for Pool<T> {
    /// An empty one: rooms hold nothing of meaning.
    fn clone(&self) -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T: Default> Deref for Taken<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.room
    }
}

impl<T: Default> DerefMut for Taken<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.room
    }
}

impl<T: Default> Drop for Taken<'_, T> {
    fn drop(&mut self) {
        let room = std::mem::take(&mut self.room);
        self.pool.0.lock().unwrap_or_else(PoisonError::into_inner).push(room);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_are_given_back() {
        let pool = Pool::<Vec<u8>>::default();
        let (mut one, other) = (pool.take(), pool.take());
        one.reserve(1000);
        drop(one);
        drop(other);
        assert_eq!(pool.0.lock().unwrap().len(), 2);
        drop(pool.take());
        assert_eq!(pool.0.lock().unwrap().len(), 2);
        assert!(pool.0.lock().unwrap().iter().any(|room| room.capacity() >= 1000));
    }
}

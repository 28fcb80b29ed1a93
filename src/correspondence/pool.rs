//! Pool of scratch buffers: as many as threads work at once, not one per task.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// The free scratch buffers. Their content is undefined.
#[derive(Debug, Default)]
pub(super) struct Pool<T>(Mutex<Vec<T>>);

/// A scratch buffer on loan; dropping it gives it back.
pub(super) struct Loan<'a, T: Default> {
    pool: &'a Pool<T>,
    scratch: T,
}

impl<T: Default> Pool<T> {
    /// A scratch buffer that was given back, or a new one.
    pub(super) fn take(&self) -> Loan<'_, T> {
        let scratch = self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
        Loan { pool: self, scratch }
    }

    /// All free scratch buffers.
    pub(super) fn scratches(&mut self) -> &mut [T] {
        self.0.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Clone for Pool<T> {
    /// An empty pool: scratch buffers hold no result.
    fn clone(&self) -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T: Default> Deref for Loan<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.scratch
    }
}

impl<T: Default> DerefMut for Loan<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.scratch
    }
}

impl<T: Default> Drop for Loan<'_, T> {
    fn drop(&mut self) {
        let scratch = std::mem::take(&mut self.scratch);
        self.pool.0.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scratch_buffers_are_given_back() {
        let pool = Pool::<Vec<u8>>::default();
        let (mut one, other) = (pool.take(), pool.take());
        one.reserve(1000);
        drop(one);
        drop(other);
        assert_eq!(pool.0.lock().unwrap().len(), 2);
        drop(pool.take());
        assert_eq!(pool.0.lock().unwrap().len(), 2);
        assert!(pool.0.lock().unwrap().iter().any(|scratch| scratch.capacity() >= 1000));
    }
}

//! Asks the processor to load memory that will be read soon.

/// Starts to load an element of a slice into the cache. Nothing happens if there is no such element, or on processors
/// other than x86-64.
///
/// Worth it in loops over elements that lie apart in memory, a dozen iterations ahead.
#[inline(always)]
pub fn prefetch<T>(values: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(value) = values.get(index) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        #[allow(unsafe_code, reason = "takes a pointer, but only reads ahead: no address makes it fail")]
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(value).cast());
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (values, index);
}

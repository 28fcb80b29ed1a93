//! Runs a kernel with the vector instructions that the machine has.
//!
//! A kernel is a loop over fixed-size arrays in plain Rust; compiled once for each level of instructions, its bits are the
//! same on all of them, for none of these levels fuses a multiplication with an addition on its own.

// Calls of functions that need instructions which not every machine has: each is argued below.
#![allow(unsafe_code)]

/// A loop worth vectorizing. `run` must be `#[inline(always)]`, and so must all that it calls: only what is inlined is compiled
/// for each level.
pub(crate) trait Kernel {
    /// Runs the loop.
    fn run(self);
}

/// Runs a kernel.
#[inline]
pub(crate) fn run(kernel: impl Kernel) {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
        {
            // SAFETY: the machine has these instructions, and `avx512f` with each of them.
            return unsafe { with_avx512(kernel) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has these instructions.
            return unsafe { with_avx2(kernel) };
        }
    }
    kernel.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512bw,avx512dq,avx512vl")]
fn with_avx512(kernel: impl Kernel) {
    kernel.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2(kernel: impl Kernel) {
    kernel.run();
}

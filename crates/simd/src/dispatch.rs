//! Kernels, and the choice of the level at which one runs. Only here is code called that needs instructions which a
//! processor may lack, after checking that it has them.

#[cfg(target_arch = "x86_64")]
use super::avx512::Avx512;
use super::level::Level;
use super::{Arrays, Lanes};

/// Code that is compiled for every level. `run` and all functions that it calls with lanes must be `#[inline(always)]`;
/// only then are they compiled for the level.
pub trait Kernel {
    /// The result.
    type Output;

    /// Runs the code with the vectors of a level.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// A kernel compiled for each level. Methods with the kernel as their own type are compiled beside the kernel, in the
/// module where it stands, and so in parallel; generic functions of this crate would all be compiled as one piece.
#[allow(unsafe_code, reason = "functions for some processors only")]
trait CompiledKernel: Kernel {
    fn run_portable(self) -> Self::Output;

    /// # Safety
    /// The processor has the instructions of [`Level::Avx2`].
    #[cfg(target_arch = "x86_64")]
    unsafe fn run_avx2(self) -> Self::Output;

    /// # Safety
    /// The processor has the instructions of [`Level::Avx512`].
    #[cfg(target_arch = "x86_64")]
    unsafe fn run_avx512(self, lanes: Avx512) -> Self::Output;
}

#[allow(unsafe_code, reason = "functions for some processors only")]
impl<K: Kernel> CompiledKernel for K {
    fn run_portable(self) -> Self::Output {
        self.run(Arrays)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    unsafe fn run_avx2(self) -> Self::Output {
        self.run(Arrays)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(
        enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512bw,avx512dq,avx512vl,avx512cd,avx512vbmi,avx512vnni"
    )]
    unsafe fn run_avx512(self, lanes: Avx512) -> Self::Output {
        self.run(lanes)
    }
}

/// Runs a kernel at a level, or at the level of the processor if that is lower.
#[inline]
#[allow(unsafe_code, reason = "calls code of a level after checking that the processor has it")]
pub fn run<K: Kernel>(level: Level, kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if level >= Level::Avx512
            && let Some(lanes) = Avx512::new()
        {
            // SAFETY: the lanes exist only if the processor has these instructions.
            return unsafe { kernel.run_avx512(lanes) };
        }
        if level >= Level::Avx2 && Level::Avx2.is_available() {
            // SAFETY: the processor was checked for these instructions.
            return unsafe { kernel.run_avx2() };
        }
    }
    kernel.run_portable()
}

//! Levels: what the processor offers, and how much of it kernels may use.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

/// Instruction sets for which kernels are compiled, the lowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// The baseline of the architecture.
    Portable,
    /// AVX2, BMI and LZCNT.
    Avx2,
    /// AVX-512 with bytes and words (F, BW, DQ, VL, CD, VBMI, VNNI).
    Avx512,
}

/// Highest permitted level, as index into [`Level::ALL`]. Kernels never use more than the processor supports.
static LIMIT: AtomicU8 = AtomicU8::new(u8::MAX);

impl Level {
    /// All levels, the lowest first.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// Whether the processor has the level.
    #[must_use]
    pub fn is_available(self) -> bool {
        self <= Self::highest()
    }

    /// Returns the level in use: the highest level of the processor within the limit.
    #[must_use]
    pub fn in_use() -> Self {
        let limit = usize::from(LIMIT.load(Ordering::Relaxed)).min(Self::ALL.len() - 1);
        Self::ALL[limit].min(Self::highest())
    }

    /// Returns the highest level of the processor. It is determined once, because short kernels run a million times per
    /// second.
    fn highest() -> Self {
        static HIGHEST: OnceLock<Level> = OnceLock::new();
        *HIGHEST.get_or_init(|| {
            #[cfg(target_arch = "x86_64")]
            match (has_avx2(), has_avx512()) {
                (_, true) => return Self::Avx512,
                (true, _) => return Self::Avx2,
                _ => {}
            }
            Self::Portable
        })
    }

    /// Limits the level of all kernels of the process from now on. The results stay the same, but take longer.
    pub fn limit_to(self) {
        LIMIT.store(self as u8, Ordering::Relaxed);
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi2") && is_x86_feature_detected!("lzcnt")
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512cd")
        && is_x86_feature_detected!("avx512vbmi")
        && is_x86_feature_detected!("avx512vnni")
}

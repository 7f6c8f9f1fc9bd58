//! Instruction sets, and work that is compiled for each of them.

use super::lanes::Lanes;
use super::portable::{Portable, TARGET_FUSES};

/// An instruction set kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// Whatever the target always has (SSE2, NEON).
    Portable,
    /// 256-bit vectors with fused multiply-add.
    Avx2,
    /// 512-bit vectors.
    Avx512,
}

impl InstructionSet {
    /// The name used in paths.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The one of a name.
    pub fn named(name: &str) -> Option<Self> {
        let mut all = [Self::Portable, Self::Avx2, Self::Avx512].into_iter();
        all.find(|set| set.name() == name)
    }

    /// True when this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// True when it rounds a product and sum once.
    pub fn fuses(self) -> bool {
        self != Self::Portable || TARGET_FUSES
    }

    /// The fastest that this processor has.
    pub fn best() -> Self {
        [Self::Avx512, Self::Avx2]
            .into_iter()
            .find(|set| set.is_available())
            .unwrap_or(Self::Portable)
    }
}

/// Work that is written over any [`Lanes`].
pub trait Kernel {
    /// Does it. Implementations are `#[inline(always)]`, so that they are compiled within
    /// the function that enables the instruction set.
    fn run<L: Lanes>(self);
}

/// Runs a kernel on an instruction set, or on the portable one where that is not there.
pub fn dispatch<K: Kernel>(set: InstructionSet, kernel: K) {
    #[cfg(target_arch = "x86_64")]
    {
        use super::x86::{F64x4, F64x8};

        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
        fn avx512<K: Kernel>(kernel: K) {
            kernel.run::<F64x8>();
        }

        #[target_feature(enable = "avx2,fma")]
        fn avx2<K: Kernel>(kernel: K) {
            kernel.run::<F64x4>();
        }

        // SAFETY: the processor has what the called function enables.
        match set {
            InstructionSet::Avx512 if set.is_available() => return unsafe { avx512(kernel) },
            InstructionSet::Avx2 if set.is_available() => return unsafe { avx2(kernel) },
            _ => {}
        }
    }
    let _ = set;
    // aarch64 always has NEON: there it is the portable set.
    #[cfg(target_arch = "aarch64")]
    kernel.run::<super::neon::F64x4>();
    #[cfg(not(target_arch = "aarch64"))]
    kernel.run::<Portable<4, TARGET_FUSES>>();
}

/// Runs a kernel on one lane, with the roundings of an instruction set: what is computed
/// lane by lane comes out as [`dispatch`] has it, to the last bit.
fn dispatch_one<K: Kernel>(set: InstructionSet, kernel: K) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "fma")]
        fn fused<K: Kernel>(kernel: K) {
            kernel.run::<Portable<1, true>>();
        }

        if set.is_available() && set.fuses() {
            // SAFETY: the processor has it.
            return unsafe { fused(kernel) };
        }
    }
    let _ = set;
    kernel.run::<Portable<1, TARGET_FUSES>>();
}

/// [`dispatch`], or `dispatch_one` of a single sample, which needs no vector.
pub fn dispatch_any<K: Kernel>(set: InstructionSet, samples: usize, kernel: K) {
    if samples == 1 {
        dispatch_one(set, kernel);
    } else {
        dispatch(set, kernel);
    }
}

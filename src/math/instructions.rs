//! Loops over lanes, compiled more than once: for every x86-64 processor, and for those with
//! AVX2 or AVX-512.
//!
//! One program runs everywhere and takes the wider instructions where there are any. The bits are the same: all
//! versions come from the same code, IEEE 754 fixes what each operation gives, and the compiler never fuses a
//! multiplication and an addition by itself.

use pulp::{Arch, NullaryFnOnce};

/// Does that work in the widest instructions that the processor has and relt is compiled for.
///
/// Only what is inlined into [`call`](NullaryFnOnce::call) is compiled for them, so `call` and all that it leads to are to
/// be `#[inline(always)]`.
#[inline(always)]
pub fn widest<W: NullaryFnOnce>(work: W) -> W::Output {
    Arch::new().dispatch(work)
}

/// Which instructions those are.
pub fn in_use() -> &'static str {
    match Arch::new() {
        Arch::Scalar => "those of every processor of the kind",
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Arch::V3(_) => "AVX2",
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        Arch::V4(_) => "AVX-512",
        _ => "wider ones",
    }
}

//! How wide the processor's vectors are: hot loops are compiled for each width, and the processor decides at run time.
//!
//! Only the width differs: the operations and their order are the same and none is fused, so every width gives the
//! same bits.

/// Which instructions the processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Width {
    /// Whatever the target guarantees.
    Baseline,
    /// 256 bits; only made by [`Width::detect`] after asking the processor.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// 512 bits and masks at every width, and all of the above; only made by [`Width::detect`].
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Width {
    /// Asks the processor.
    pub(crate) fn detect() -> Self {
        Self::all().last().copied().unwrap_or(Self::Baseline)
    }

    /// Every width that this processor has, the narrowest first.
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self::Baseline];
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            all.push(Self::Avx2);
            if std::arch::is_x86_feature_detected!("avx512f") && std::arch::is_x86_feature_detected!("avx512vl") {
                all.push(Self::Avx512);
            }
        }
        all
    }
}

/// Defines a function by a body compiled for 128 and for 256 bits; wider registers did not pay in these loops.
macro_rules! widened {
    ($(#[$doc:meta])* $vis:vis fn $name:ident $(<$(const $g:ident: usize),*>)? ($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block) => {
        $(#[$doc])*
        $vis fn $name $(<$(const $g: usize),*>)? (width: $crate::width::Width, $($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn body $(<$(const $g: usize),*>)? ($($arg: $ty),*) $(-> $ret)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            fn avx2 $(<$(const $g: usize),*>)? ($($arg: $ty),*) $(-> $ret)? {
                body $(::<$($g),*>)? ($($arg),*)
            }
            match width {
                $crate::width::Width::Baseline => body $(::<$($g),*>)? ($($arg),*),
                #[cfg(target_arch = "x86_64")]
                $crate::width::Width::Avx2 | $crate::width::Width::Avx512 => {
                    debug_assert!(std::arch::is_x86_feature_detected!("avx2"));
                    // SAFETY: these variants exist only where the processor said that it has AVX2.
                    unsafe { avx2 $(::<$($g),*>)? ($($arg),*) }
                }
            }
        }
    };
}
pub(crate) use widened;

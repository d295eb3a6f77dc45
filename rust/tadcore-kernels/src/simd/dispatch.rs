//! Functions compiled for each width: what calls them is safe, since a [`Width`](super::Width) exists only where the
//! processor has its instructions.

/// Defines a function by a body that is generic in the instructions [`Simd`](super::Simd), compiled for every width.
///
/// The function takes the width as its first argument.
#[macro_export]
macro_rules! dispatch {
    ($(#[$doc:meta])* $vis:vis fn $name:ident<$v:ident $(, const $g:ident: usize)*>($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block) => {
        $(#[$doc])*
        $vis fn $name<$(const $g: usize),*>(width: $crate::simd::Width, $($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn body<$v: $crate::simd::Simd $(, const $g: usize)*>($($arg: $ty),*) $(-> $ret)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            fn avx2<$(const $g: usize),*>($($arg: $ty),*) $(-> $ret)? {
                body::<$crate::simd::Avx2 $(, $g)*>($($arg),*)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512vl,avx2,fma")]
            fn avx512<$(const $g: usize),*>($($arg: $ty),*) $(-> $ret)? {
                body::<$crate::simd::Avx512 $(, $g)*>($($arg),*)
            }
            match width {
                $crate::simd::Width::Baseline => body::<$crate::simd::Baseline $(, $g)*>($($arg),*),
                #[cfg(target_arch = "x86_64")]
                $crate::simd::Width::Avx2 => {
                    debug_assert!(width.is_there());
                    // SAFETY: this variant exists only where the processor said that it has AVX2 and FMA.
                    unsafe { avx2::<$($g),*>($($arg),*) }
                }
                #[cfg(target_arch = "x86_64")]
                $crate::simd::Width::Avx512 => {
                    debug_assert!(width.is_there());
                    // SAFETY: this variant exists only where the processor said that it has AVX-512F, VL, AVX2 and FMA.
                    unsafe { avx512::<$($g),*>($($arg),*) }
                }
            }
        }
    };
}

/// The same, compiled for registers of 256 bits at most, which wider processors have, too: where wider ones do not pay.
#[macro_export]
macro_rules! widened {
    ($(#[$doc:meta])* $vis:vis fn $name:ident<$v:ident $(, const $g:ident: usize)*>($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block) => {
        $(#[$doc])*
        $vis fn $name<$(const $g: usize),*>(width: $crate::simd::Width, $($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn body<$v: $crate::simd::Simd $(, const $g: usize)*>($($arg: $ty),*) $(-> $ret)? $body
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            fn avx2<$(const $g: usize),*>($($arg: $ty),*) $(-> $ret)? {
                body::<$crate::simd::Avx2 $(, $g)*>($($arg),*)
            }
            match width {
                $crate::simd::Width::Baseline => body::<$crate::simd::Baseline $(, $g)*>($($arg),*),
                #[cfg(target_arch = "x86_64")]
                $crate::simd::Width::Avx2 | $crate::simd::Width::Avx512 => {
                    debug_assert!(width.is_there());
                    // SAFETY: these variants exist only where the processor said that it has AVX2 and FMA.
                    unsafe { avx2::<$($g),*>($($arg),*) }
                }
            }
        }
    };
}
pub use {dispatch, widened};

//! Memory whose size an input decides: asked for here and nowhere else, so that what cannot be had is an error with its
//! size in bytes and the name of what asked, where a plain allocation would end the process.
//!
//! Systems that overcommit promise memory they do not have and end the process later, so what is large is measured
//! against [`MOST_BYTES`] before anything is asked for.

use bytemuck::Zeroable;

use crate::error::NoMemory;

/// The most bytes that one purpose may take: P on the grid, a record, the synthesis of one network.
pub const MOST_BYTES: u64 = 16 << 30;

/// Refuses more than `limit` bytes for `what`.
pub fn within(what: &'static str, bytes: u128, limit: u64) -> Result<(), NoMemory> {
    let asked = u64::try_from(bytes).unwrap_or(u64::MAX);
    if asked > limit { Err(NoMemory { what, bytes: asked, limit: Some(limit) }) } else { Ok(()) }
}

/// Bytes that must be left before what is small is allocated.
const SPARE: usize = 8 << 20;

fn refused<T>(what: &'static str, len: usize) -> NoMemory {
    NoMemory { what, bytes: (len as u64).saturating_mul(size_of::<T>() as u64), limit: None }
}

/// `len` zeros for `what`, as the system hands them out.
pub fn zeros<T: Zeroable>(what: &'static str, len: usize) -> Result<Vec<T>, NoMemory> {
    bytemuck::try_zeroed_vec(len).map_err(|()| refused::<T>(what, len))
}

/// Makes room for `more` elements; as much again as there is, so that a list that grows is seldom moved. Where that much
/// cannot be had it stops, while there is memory left for what is small.
pub fn reserve<T>(what: &'static str, list: &mut Vec<T>, more: usize) -> Result<(), NoMemory> {
    list.try_reserve(more).map_err(|_| refused::<T>(what, list.len().saturating_add(more)))
}

/// Makes room for exactly `more` elements.
pub fn reserve_exact<T>(what: &'static str, list: &mut Vec<T>, more: usize) -> Result<(), NoMemory> {
    list.try_reserve_exact(more).map_err(|_| refused::<T>(what, list.len().saturating_add(more)))
}

/// Whether there is memory left for what is small and many: so much is asked for, and given back.
pub fn spare(what: &'static str) -> Result<(), NoMemory> {
    Vec::<u8>::new().try_reserve_exact(SPARE).map_err(|_| refused::<u8>(what, SPARE))
}

/// Appends a slice.
pub fn append<T: Copy>(what: &'static str, list: &mut Vec<T>, more: &[T]) -> Result<(), NoMemory> {
    reserve(what, list, more.len())?;
    list.extend_from_slice(more);
    Ok(())
}

/// A copy of a slice.
pub fn copy<T: Copy>(what: &'static str, from: &[T]) -> Result<Vec<T>, NoMemory> {
    let mut list = Vec::new();
    append(what, &mut list, from)?;
    Ok(list)
}

/// Makes a list at least `len` long.
pub fn grow<T: Copy>(what: &'static str, list: &mut Vec<T>, len: usize, fill: T) -> Result<(), NoMemory> {
    if let Some(more) = len.checked_sub(list.len()) {
        reserve_exact(what, list, more)?;
        list.resize(len, fill);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_had_is_named() {
        let most = usize::MAX / 16;
        let bytes = most as u64 * 8;
        let none = NoMemory { what: "a test", bytes, limit: None };
        assert_eq!(zeros::<f64>("a test", most), Err(none));
        let mut list = vec![1.0];
        assert_eq!(grow("a test", &mut list, most, 0.0), Err(none));
        assert_eq!(reserve("a test", &mut list, most - 1), Err(none));
        assert_eq!(list, [1.0]);
        assert_eq!(none.to_string(), format!("the system gave no {bytes} bytes for a test"));
    }

    #[test]
    fn what_is_beyond_the_limit_is_refused_with_it() {
        assert_eq!(within("a test", u128::from(MOST_BYTES), MOST_BYTES), Ok(()));
        let refused = within("a test", 1 << 40, MOST_BYTES).expect_err("beyond the limit");
        assert_eq!(refused.bytes, 1 << 40);
        assert_eq!(
            refused.to_string(),
            "a test would take 1099511627776 bytes (1024.0 GiB), more than the limit of 16.0 GiB"
        );
        assert_eq!(within("a test", u128::MAX, MOST_BYTES).map_err(|e| e.bytes), Err(u64::MAX));
    }

    #[test]
    fn lists_grow_to_what_is_asked() {
        assert_eq!(zeros::<f64>("a test", 3), Ok(vec![0.0; 3]));
        let mut list = copy("a test", &[1, 2]).expect("memory");
        append("a test", &mut list, &[3]).expect("memory");
        grow("a test", &mut list, 5, 7).expect("memory");
        grow("a test", &mut list, 1, 8).expect("memory");
        assert_eq!(list, [1, 2, 3, 7, 7]);
    }
}

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

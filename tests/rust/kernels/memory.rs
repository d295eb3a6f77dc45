//! Memory that cannot be had is named.

use tadcore_kernels::error::NoMemory;
use tadcore_kernels::memory::{MOST_BYTES, append, copy, grow, reserve, within, zeros};

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

//! The table of transitions.

use tadcore_kernels::policy::step_table::{LINE, StepTable, padded};

/// Thousands of entries of each kind of key, each found again with its own matrix, and nothing else found.
#[test]
fn every_entry_is_found_again() {
    for (rows, size) in [(3, 4), (4, 4), (4, 5), (8, 8), (8, 9), (12, 13)] {
        let mut table = StepTable::new(rows, size);
        let (bits, stride) = (rows * size, size * padded(size));
        let mask = if bits >= 64 { u64::MAX } else { (1 << bits) - 1 };
        let key = |i: u64| -> Vec<u64> {
            let mixed = i.wrapping_mul(0x2545_F491_4F6C_DD1D);
            let last = if bits % 64 == 0 { u64::MAX } else { (1 << (bits % 64)) - 1 };
            match bits.div_ceil(64) {
                1 => vec![if bits <= 16 { i } else { mixed } & mask],
                words => (0..words).map(|w| if w == 0 { i } else { mixed & last }).collect(),
            }
        };
        for i in 0..3000 {
            assert_eq!(table.find(&key(i)), 0, "{rows} {size} {i}");
            table.insert(&key(i), Some(&key(i / 2 * 2)), &vec![i as f64; stride]).expect("memory");
        }
        assert_eq!(table.len(), 3000);
        for i in 0..3000 {
            let slot = table.find(&key(i)) as usize;
            assert_eq!(slot, i as usize + 1);
            assert!(table.matrix(slot).iter().all(|&x| x == i as f64));
            assert_eq!(table.key(slot), key(i));
            // Two entries each have the first as their canonical form.
            assert_eq!(table.find_canonical(&key(i)), if i % 2 == 0 { i as u32 + 1 } else { 0 });
        }
        assert_eq!(table.matrices().as_ptr().align_offset(LINE), 0);
        assert_eq!(table.find(&key(3000)), 0);
        table.clear();
        assert_eq!((table.find(&key(5)), table.find_canonical(&key(4)), table.len()), (0, 0, 0));
    }
}

/// By the key itself, by a hash of one word, and of several: what is cleared is forgotten, and room again.
#[test]
fn a_cleared_table_knows_nothing_and_takes_entries_again() {
    for (rows, size) in [(3, 4), (4, 5), (9, 9)] {
        let mut table = StepTable::new(rows, size);
        let words = |key: u64| vec![key; (rows * size).div_ceil(64)];
        let matrix = |key: u64| vec![key as f64; size * padded(size)];
        for round in 0..3 {
            let keys = [0, 5, 77, 4095].map(|key: u64| (key + round) % 4096);
            for &key in &keys {
                assert_eq!(table.find(&words(key)), 0);
                table.insert(&words(key), Some(&words(key)), &matrix(key)).expect("memory");
            }
            for &key in &keys {
                assert_eq!(table.matrix(table.find(&words(key)) as usize), matrix(key));
                assert_ne!(table.find_canonical(&words(key)), 0);
            }
            table.clear();
            assert!((0..4096).all(|key| table.find(&words(key)) == 0 && table.find_canonical(&words(key)) == 0));
            assert_eq!(table.len(), 0);
        }
    }
}

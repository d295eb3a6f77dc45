//! Each operation, lane by lane, against the same one on numbers by themselves.

use tadcore_kernels::dispatch;
use tadcore_kernels::simd::{Entries, Number, Scalar, Simd, Width, dot, dot_in_order, norm, take};

/// Pairs of them are in any order, equal, of both signs, zero, and no numbers; all are numbers of single precision.
const NUMBERS: [f64; 11] =
    [0.0, -0.0, 1.0, -1.0, 1.5, -2.75, 0.1_f32 as f64, 3e38_f32 as f64, -7e-38_f32 as f64, f64::INFINITY, f64::NAN];

/// A result in double precision as one in the other: rounded twice it is what is rounded once, but for sums of products.
fn rounded(single: bool, x: f64) -> f64 {
    if single { f64::from(x as f32) } else { x }
}

fn fused(single: bool, x: f64, y: f64, to: f64) -> f64 {
    if single { f64::from((x as f32).mul_add(y as f32, to as f32)) } else { x.mul_add(y, to) }
}

fn same(found: f64, expected: f64) -> bool {
    found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan()
}

/// Another number in each lane.
fn filled<T: Number>(from: usize, step: usize) -> T {
    let mut number = T::splat(NUMBERS[0]);
    for lane in 0..T::LANES {
        number.set_lane(lane, NUMBERS[(from + lane * step) % NUMBERS.len()]);
    }
    number
}

fn check<T: Number>() {
    for from in 0..NUMBERS.len() {
        for step in 1..NUMBERS.len() {
            let (a, x, y): (T, T, T) = (filled(from, 1), filled(2 * from, step), filled(from + step, step));
            let (less, at_most) = (T::bits(x.less(y)), T::bits(x.at_most(y)));
            let mask = ((from * NUMBERS.len() + step) * 0x0101) as u16;
            let chosen = T::select(T::mask(mask), x, y);
            let all = ((1_u32 << T::LANES) - 1) as u16;
            assert_eq!(T::bits(T::mask(mask)) & all, mask & all);
            assert_eq!((less | at_most) & !all, 0);
            let mut stored = vec![T::Scalar::of(0.0); T::LANES + 1];
            x.store(&mut stored);
            let loaded = T::load(&stored);
            (0..T::LANES).for_each(|lane| assert!(same(loaded.lane(lane), x.lane(lane))));
            for lane in 0..T::LANES {
                let (p, u, v) = (a.lane(lane), x.lane(lane), y.lane(lane));
                assert!(same(u, NUMBERS[(2 * from + lane * step) % NUMBERS.len()]));
                let is = |found: T, expected: f64| same(found.lane(lane), rounded(T::SINGLE, expected));
                assert!(is(x + y, u + v) && is(x - y, u - v));
                assert!(is(x * y, u * v) && is(x / y, u / v), "{u} {v}");
                assert!(same(a.plus(x, y).lane(lane), fused(T::SINGLE, u, v, p)));
                assert!(same(a.minus(x, y).lane(lane), fused(T::SINGLE, -u, v, p)));
                assert!(is(x.sqrt(), f64::sqrt(u)) && is(x.abs(), f64::abs(u)));
                assert_eq!((less >> lane & 1 == 1, at_most >> lane & 1 == 1), (u < v, u <= v), "{u} {v}");
                assert!(same(x.or_larger(y).lane(lane), if u < v { v } else { u }), "{u} {v}");
                assert!(same(chosen.lane(lane), if mask >> lane & 1 == 1 { u } else { v }));
            }
        }
    }
    // Small integers: sums are exact in any order.
    for len in 0..11 {
        let numbers = |factor: usize| -> Vec<T> {
            let lane = |i: usize, lane: usize| ((factor * i + lane) % 7) as f64 - 3.0;
            (0..len)
                .map(|i| {
                    let mut number = T::splat(0.0);
                    (0..T::LANES).for_each(|l| number.set_lane(l, lane(i, l)));
                    number
                })
                .collect()
        };
        let (x, mut y) = (numbers(2), numbers(3));
        for lane in 0..T::LANES {
            let expected: f64 = x.iter().zip(&y).map(|(x, y)| x.lane(lane) * y.lane(lane)).sum();
            assert_eq!((dot(&x, &y).lane(lane), dot_in_order(&x, &y).lane(lane)), (expected, expected));
            let squares: f64 = x.iter().map(|x| x.lane(lane) * x.lane(lane)).sum();
            assert_eq!(norm(&x).lane(lane), rounded(T::SINGLE, squares.sqrt()));
        }
        let before = y.clone();
        take(T::mask(0b1001_1100_0101_0010), &x, &mut y);
        for ((y, x), before) in y.iter().zip(&x).zip(&before) {
            for lane in 0..T::LANES {
                let from = if 0b1001_1100_0101_0010 >> lane & 1 == 1 { x } else { before };
                assert_eq!(y.lane(lane), from.lane(lane));
            }
        }
    }
}

dispatch! {
    fn check_width<V>() {
        check::<V::Four>();
        check::<V::Eight>();
        check::<V::Double>();
        check::<V::Single>();
        check::<V::Half>();
        check_whole::<V>();
    }
}

/// What is not done lane by lane, against the same by indices.
fn check_whole<V: Simd>() {
    let numbers: [f64; 16] = std::array::from_fn(|i| (1.0 + i as f64).sqrt());
    let rows = std::array::from_fn(|r| V::Four::load(&numbers[4 * r..]));
    for (c, column) in V::transpose(rows).into_iter().enumerate() {
        (0..4).for_each(|r| assert_eq!(column.lane(r), numbers[4 * r + c]));
    }
    for (h, half) in V::halves(V::Eight::load(&numbers)).into_iter().enumerate() {
        (0..4).for_each(|c| assert_eq!(half.lane(c), numbers[4 * h + c]));
    }
    let (mut keys, mut expected) = (V::no_keys(), [0_u64; 8]);
    for (bit, lanes) in [(1 << 3, 0b1010_0110), (1 << 15, 0b0111_0001), (1, 0), (1 << 3, 0b0000_1111)] {
        keys = V::set(keys, bit, V::Eight::mask(lanes));
        (0..8).filter(|lane| lanes >> lane & 1 == 1).for_each(|lane| expected[lane] |= bit);
    }
    assert_eq!(V::keys(keys), expected);
    let low = V::low(keys);
    (0..8).for_each(|lane| assert_eq!(low[lane / 4] >> (16 * (lane % 4)) & 0xFFFF, expected[lane]));
    let keys = V::set(keys, 1 << 40, V::Eight::mask(0b1000_0001));
    assert_eq!(V::keys(keys), std::array::from_fn(|l| expected[l] | if l % 7 == 0 { 1 << 40 } else { 0 }));
    let others: [u64; 8] = std::array::from_fn(|l| (1 << 40) | (l as u64 * 0x0123_4567));
    let both = V::keys(V::both(keys, V::load_keys(&others)));
    assert_eq!(both, std::array::from_fn(|l| V::keys(keys)[l] & others[l]));
    // Words at both ends of a table, and keys with bits that it has not.
    let mut table = Entries::new(6);
    (0..64).for_each(|key| table.set(key, (key * 1021 + 3) as u16));
    let asked = [0, 63, 1, 62, 64 + 5, u64::MAX, 17, 1 << 40];
    assert_eq!(V::keys(V::entries(&table, V::load_keys(&asked))), asked.map(|key| (key % 64 * 1021 + 3) & 0xFFFF));
    // Halves of keys: multiplied, exchanged, moved down; and bits as those of numbers.
    let words = V::keys(keys);
    let found = V::keys(V::differ(keys, V::load_keys(&others)));
    assert_eq!(found, std::array::from_fn(|l| words[l] ^ others[l]));
    let odd: [u64; 8] =
        std::array::from_fn(|l| (others[l] | 1 << 63 | 0xFFFF_0000).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let low = |word: u64| word & 0xFFFF_FFFF;
    let found = V::keys(V::product(V::load_keys(&odd), V::all_keys(0xFEDC_BA98_D251_1F53)));
    assert_eq!(found, odd.map(|word| low(word) * 0xD251_1F53));
    assert_eq!(V::keys(V::swap(V::load_keys(&odd))), odd.map(|word| word.rotate_left(32)));
    assert_eq!(V::keys(V::down::<12>(V::load_keys(&odd))), odd.map(|word| word >> 12));
    assert_eq!(V::keys(V::down::<32>(V::load_keys(&odd))), odd.map(|word| word >> 32));
    let found = V::numbers(V::load_keys(&numbers.first_chunk::<8>().expect("sixteen numbers").map(f64::to_bits)));
    (0..8).for_each(|lane| assert_eq!(found.lane(lane), numbers[lane]));
}

#[test]
fn a_lane_does_what_a_number_alone_does() {
    check::<f64>();
    check::<f32>();
    for width in Width::all() {
        check_width(width);
    }
}

//! Sweeps against the version for any size, and rims that belong to their balls.

use tadcore_kernels::ensemble::anysize::{observe_any, sweep_any};
use tadcore_kernels::ensemble::block::{BLOCK, Blocks, PerTrial, Shape, Stop};
use tadcore_kernels::ensemble::sweep::{observe, sweep_of};

use crate::network::{self, Topology, squared_norm, squared_reach};
use crate::policy::step_table::StepTable;
use crate::simd::{Baseline, Simd, Width};
use crate::simulation::Reach;

/// Points whose distances are whole numbers, on the rims of whole radii: as one run sees and ends them.
#[test]
fn rims_belong_to_the_balls_at_every_size() {
    let points =
        [[9.0, 12.0], [18.0, 24.0], [0.0, 15.0], [15.0, 36.0], [-9.0, 12.0], [0.0, 30.0], [24.0, 45.0], [-15.0, 0.0]];
    let radii = [15.0, 30.0, 39.0, 15.0_f64.next_down(), 9.0, 6.0, 18.0, 12.0];
    let shape = Shape { size: 3, rows: 2, dim: 2, words: 1 };
    for turn in 0..radii.len() {
        let row = |member: usize, i: usize| points[(member + 3 * i) % points.len()];
        let radius = |member: usize, i: usize| squared_reach(radii[(member + i + turn) % radii.len()]);
        let z: Vec<PerTrial> = (0..6).map(|e| std::array::from_fn(|l| row(l, e / 2)[e % 2])).collect();
        let sight: Vec<PerTrial> = (0..2).map(|i| std::array::from_fn(|l| radius(l, i))).collect();
        let capture: Vec<PerTrial> = (0..3).map(|i| std::array::from_fn(|l| radius(l, i + 2))).collect();
        let mut keys = vec![[0; BLOCK]];
        let any = [f64::INFINITY; BLOCK];
        let caught = observe_any(&shape, &z, &sight, &capture, &any, &mut keys);
        let (compiled, ends) = observe::<Baseline, 3, 2, 2, false>(&z, &sight, &capture, &any, &[]);
        assert_eq!((keys[0], caught), (Baseline::keys(compiled), u32::from(ends)));
        // With nothing on the table a sweep stops with what it saw, or with who is caught or beyond the limit: in the
        // second trial on the limit, in the last three a double beyond it, no number, and infinitely far.
        let nothing = [-1.0; BLOCK];
        let most: PerTrial = std::array::from_fn(|l| (0..3).map(|i| squared_norm(&row(l, i))).fold(0.0, f64::max));
        let limits: PerTrial = std::array::from_fn(|l| if l == BLOCK - 3 { most[l].next_down() } else { most[l] });
        let cases =
            [(capture.clone(), any, caught), (vec![nothing; 3], any, 0), (vec![nothing; 3], limits, 0b1110_0000)];
        for (capture, far, over) in cases {
            let mut z = z.clone();
            if far == limits {
                z.iter_mut().for_each(|numbers| numbers[BLOCK - 2] = f64::NAN);
                z[turn % 6][BLOCK - 1] = f64::INFINITY;
            }
            let expected = if over == 0 { Stop::Missing(0) } else { Stop::Over(0, over) };
            assert_eq!(observe_any(&shape, &z, &sight, &capture, &far, &mut vec![[0; BLOCK]]), over);
            for width in Width::all() {
                let (z, sight, capture) = (z.clone(), sight.clone(), capture.clone());
                let far = vec![far];
                let network = None;
                let mut blocks =
                    Blocks { z, sight, capture, far, sight_step: 0, capture_step: 0, network, live: BLOCK };
                let mut seen = vec![[0; BLOCK]];
                let stop =
                    sweep_of(&shape, None)(width, &shape, &mut blocks, 0, &StepTable::new(2, 3), None, &mut seen);
                assert_eq!(stop, expected, "{width:?}");
                assert!(over != 0 || seen == keys, "{width:?}");
            }
        }
        for l in 0..BLOCK {
            let state: Vec<f64> = z.iter().map(|numbers| numbers[l]).collect();
            let mut topology = Topology::empty(2, 3);
            network::observe(&state, 2, &[sight[0][l], sight[1][l]], &mut topology);
            assert_eq!(topology.key(), Some(keys[0][l]));
            let reach = Reach::new(&[2, 3, 4].map(|i| radii[(l + i + turn) % radii.len()]));
            assert_eq!(reach.ends(&state, 2).is_some(), caught >> l & 1 == 1);
        }
    }
}

/// Stops, keys and states are those of the version that takes one block after another, at every width.
#[test]
fn blocks_stop_where_single_strips_do() {
    let shape = Shape { size: 4, rows: 3, dim: 2, words: 1 };
    // In (−1, 1), without a pattern.
    let wave = |i: usize| ((12.9898 * i as f64 + 4.1).sin() * 43758.5453).fract();
    let mut table = StepTable::new(3, 4);
    for key in (0..1 << 12).filter(|key| key % 41 != 3) {
        let matrix: Vec<f64> = (0..16).map(|e| f64::from(e % 5 == 0) + 0.01 * wave(e + key)).collect();
        table.insert(&[key as u64], None, &matrix).expect("memory");
    }
    let blocks = || Blocks {
        z: (0..40 * 8).map(|e| std::array::from_fn(|l| 2.0 * wave(8 * e + l))).collect(),
        sight: vec![[4.0; BLOCK], [2.0; BLOCK], [1.0; BLOCK]],
        capture: vec![[0.04; BLOCK]; 4],
        far: vec![[f64::INFINITY; BLOCK]; 40],
        sight_step: 0,
        capture_step: 0,
        network: None,
        live: 40 * BLOCK - 3,
    };
    for width in Width::all() {
        let (mut ours, mut single) = (blocks(), blocks());
        let (mut keys, mut expected) = (vec![[0; BLOCK]], vec![[0; BLOCK]]);
        let (mut from, mut counts) = (0, [0; 2]);
        loop {
            let stop = sweep_of(&shape, None)(width, &shape, &mut ours, from, &table, Some(&table), &mut keys);
            assert_eq!(stop, sweep_any(width, &shape, &mut single, from, &table, None, &mut expected), "{width:?}");
            assert_eq!(ours.z, single.z, "{width:?} {stop:?}");
            match stop {
                Stop::End => break,
                Stop::Over(block, _) => {
                    // All eight a long way off, where nobody sees or catches anybody.
                    for all in [&mut ours, &mut single] {
                        all.z[8 * block..][..8]
                            .iter_mut()
                            .enumerate()
                            .for_each(|(e, z)| *z = [10.0 * (1 + e) as f64; 8]);
                    }
                    (from, counts[0]) = (block, counts[0] + 1);
                }
                Stop::Missing(block) => {
                    assert_eq!(keys, expected);
                    (from, counts[1]) = (block + 1, counts[1] + 1);
                }
            }
        }
        assert!(counts.iter().all(|&count| count > 3 && count < 30), "{counts:?}");
    }
}

//! Who is told, against a search of the graph of differences, one after another; and what more knowledge may do.

use super::{Frame, Links, Topology};

/// Bits without a pattern.
struct Bits(u64);

impl Bits {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }

    fn network(&mut self, rows: usize, size: usize, percent: u64) -> Topology {
        let mut topology = Topology::empty(rows, size);
        for bit in 0..rows * size {
            if self.below(100) < percent {
                topology.set(bit / size, bit % size);
            }
        }
        topology
    }
}

/// Whether a node is reached from another one over undirected edges.
fn reached(edges: &[(usize, usize)], from: usize, to: usize, nodes: usize) -> bool {
    let mut found = vec![false; nodes];
    found[from] = true;
    for _ in 0..nodes {
        for &(a, b) in edges {
            let either = found[a] || found[b];
            (found[a], found[b]) = (either, either);
        }
    }
    found[to]
}

/// The definition, word by word: paths of links up to a length, then components.
fn by_search(seen: &Topology, heard: &Topology, relays: Option<usize>, frame: Frame) -> Topology {
    let (m, n) = (seen.rows(), seen.size());
    // The fewest links from j to i, by relaxation.
    let mut links = vec![vec![usize::MAX / 2; m]; m];
    for i in 0..m {
        links[i][i] = 0;
    }
    for _ in 0..m {
        for i in 0..m {
            for j in (0..m).filter(|&j| j != i && heard.sees(i, j)) {
                for from in 0..m {
                    links[i][from] = links[i][from].min(links[j][from] + 1);
                }
            }
        }
    }
    let most = relays.map_or(m, |relays| relays.min(m) + 1);
    Topology::from_fn(m, n, |i, j| {
        let mut edges = Vec::new();
        for speaker in (0..m).filter(|&j| links[i][j] <= most) {
            edges
                .extend((0..n).filter(|&q| seen.sees(speaker, q)).map(|q| (speaker, if q == speaker { n } else { q })));
            if frame == Frame::Common {
                edges.push((i, speaker));
            }
        }
        reached(&edges, i, if j == i { n } else { j }, n + 1)
    })
}

#[test]
fn everyone_is_told_what_a_search_finds() {
    let mut bits = Bits(1);
    let small = (1..=12).flat_map(|n| [(n, n + 1), (n + 1, n + 1)]);
    for (rows, size) in small.chain([(64, 65), (70, 70)]) {
        // Every bound on relays that can matter, and one that cannot, in both frames.
        let bounds: Vec<_> = (0..=rows.min(12)).chain([99]).map(Some).chain([None]).collect();
        let limit = if size > 20 { 6 } else { 12 * bounds.len() };
        for case in 0..limit {
            // Sparse ones, in which relays and single edges decide.
            let (of_sight, of_links) = (bits.below(200 / size as u64), bits.below(300 / size as u64));
            let seen = bits.network(rows, size, of_sight);
            let mut heard = bits.network(rows, rows, of_links);
            (0..rows).for_each(|i| heard.unset(i, i));
            let relays = bounds[case % bounds.len()];
            let frame = [Frame::Relative, Frame::Common][case / bounds.len() % 2];
            let links = Links::new(&vec![Some(1.0); rows], relays, frame);
            let told = links.told(&seen, &heard);
            assert_eq!(told, by_search(&seen, &heard, relays, frame), "{rows} {size} {relays:?} {frame:?}");
            // What is seen is kept, and telling again tells nothing new where all relays are allowed.
            let mut kept = seen.clone();
            kept.keep(&told);
            assert_eq!(kept, seen);
        }
    }
}

#[test]
fn nobody_is_told_without_links_and_everybody_with_all() {
    let mut bits = Bits(2);
    for _ in 0..200 {
        let seen = bits.network(3, 4, 40);
        let silent = Links::new(&[None; 3], None, Frame::Relative).told(&seen, &Topology::empty(3, 3));
        // Alone, a player knows what it sees: its star is its component.
        assert_eq!(silent, seen);
    }
    // A chain of single edges to the attacker: d1 sees d2, d2 sees d3, d3 sees the target and the attacker.
    let seen =
        Topology::from_fn(3, 4, |i, j| (i, j) == (0, 1) || (i, j) == (1, 2) || (i, j) == (2, 3) || (i, j) == (2, 2));
    let links = Links::new(&[Some(f64::INFINITY); 3], Some(0), Frame::Relative);
    let mut heard = Topology::empty(3, 3);
    links.heard(&[0.0; 8], 2, &mut heard);
    assert_eq!(heard.edges(), 6);
    assert!(links.told(&seen, &heard).is_complete());
}

/// Three on a line, 1 apart: a ball is closed, who sends nothing is not heard, and relays carry.
#[test]
fn links_reach_as_far_as_their_speakers() {
    let z = [0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 9.0, 0.0];
    let heard = |radius: [Option<f64>; 3]| {
        let mut heard = Topology::empty(3, 3);
        Links::new(&radius, None, Frame::Relative).heard(&z, 2, &mut heard);
        heard
    };
    assert_eq!(heard([Some(1.0); 3]), Topology::from_fn(3, 3, |i, j| i.abs_diff(j) == 1));
    assert_eq!(heard([Some(1.0_f64.next_down()); 3]).edges(), 0);
    assert_eq!(heard([None, Some(2.0), None]), Topology::from_fn(3, 3, |i, j| j == 1 && i != 1));
    // d1 alone sees the attacker; d3 hears d2, who hears d1.
    let seen = Topology::from_fn(3, 4, |i, j| (i, j) == (0, 0));
    for (relays, attackers) in [(Some(0), 0b011), (Some(1), 0b111), (None, 0b111)] {
        let links = Links::new(&[Some(1.0); 3], relays, Frame::Common);
        let told = links.told(&seen, &heard([Some(1.0); 3]));
        let found: usize = (0..3).map(|i| usize::from(told.sees_attacker(i)) << i).sum();
        assert_eq!(found, attackers, "{relays:?}");
    }
}

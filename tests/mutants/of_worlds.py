"""The mutants of random numbers, failures, links and disturbances; `listed.py` says how to read a row."""

MUTANTS = {
    "random/philox.rs": [
        ("Philox: which key", "[p1 >> 32 ^ x[1] ^ «key[0]»", "key[1]"),
        ("Philox: halves", "p0 >> 32 ^ «x[3]»", "x[1]"),
        ("uniform: the middle of an interval", "= «1.0 - f64::EPSILON / 2.0»;", "1.0"),
        ("uniform, many: B", "[(words[1], words[0]), («words[3], words[2]»)]", "words[1], words[0]"),
        ("Philox, many: the second round", "low(p) ^ «keys[1][1]»", "keys[1][0]"),
        ("Philox, many: trials beyond 2³²", "if V::PRODUCTS && «self.alike» {", "true"),
    ],
    "random/mod.rs": [
        ("draws: a trial beyond 2³²", "bits | «(self.trial >> 32) as u32»", "0"),
        ("draws: the key", "[seed as u32, «(seed >> 32) as u32»]", "0"),
        ("draws: a pair of axes", "«4 + u32::from(pair)»", "4"),
    ],
    "random/normal.rs": [
        ("normal: middle part", "let r = «0.180625 - q * q»", "0.180625 + q * q"),
        ("normal: near tail", "(&NEAR, «root - 1.6»)", "root + 1.6"),
        ("normal: far tail", "(&FAR, «root - 5.0»)", "root - 1.6"),
        ("normal: which tail", "libm::log(if «q < 0.0» {", "q > 0.0"),
        ("normal: sign", "if «q < 0.0» { -size }", "q > 0.0"),
        ("normal, many: which tail", "tails.sizes[count] = «0.5 - (numbers[at] - 0.5).abs()»;", "numbers[at]"),
        ("normal, many: sign", "*x = «size.copysign(*x)»;", "size"),
        (
            "normal, many: near tail",
            "(&NEAR, [«root[0] - V::Eight::splat(1.6)», root[1]",
            "root[0] + V::Eight::splat(1.6)",
        ),
        ("normal, many: far tails", "if «far != 0» {", "false"),
        ("ln: halves", "s * («half + (odd + even)»)", "half - (odd + even)"),
    ],
    "random/chain.rs": [
        ("chain: both rates", "libm::expm1(«-both * step»)", "-fails * step"),
        ("chain: p", "libm::log1p(«leaves / both * within»)", "leaves * within"),
        ("chain: share of up", "{ 1.0 } else { «returns / both» }", "fails / both"),
        ("chain: which rate", "stays: [«stays(returns)», stays(fails)]", "stays(fails)"),
        ("chain: holding time", "let steps = «(libm::log(u) / stays).floor() + 1.0»", "(libm::log(u) / stays).floor()"),
        ("chain: number of a flip", "uniform(«self.state / 2 + 1»)", "self.state / 2"),
    ],
    "network/mask.rs": [
        ("mask: edge", "(Purpose::Edge, «i * self.size + j»)", "j * self.size + i"),
        ("mask: link", "(Purpose::Link, «i * self.rows + j»)", "j * self.rows + i"),
        ("mask: what is up", "if «walk.is_up()»", "!walk.is_up()"),
        ("mask: by whom a link is sent", "link[«j»]", "i"),
    ],
    "network/relay.rs": [
        ("links: closed ball", "if «d2 <= self.reach[j]»", "d2 < self.reach[j]"),
        ("links: who sends nothing", "rho.map_or(«-1.0», squared_reach)", "f64::INFINITY"),
        ("relay: the attacker in a star", "stars[i].add(«n»);", "n - 1"),
        ("relay: only what meets", "if «stars[j].meets(&component)»", "true"),
        ("relay: common frame", "if «self.frame == Frame::Common»", "self.frame == Frame::Relative"),
        ("relay: how many relays", "for _ in «0..self.relays»", "0..self.relays + 1"),
    ],
    "simulation/disturbance.rs": [
        ("disturbance: of the attacker", "*x += «by - own»;", "by + own"),
        ("disturbance: s ξ", "*x = «s * normal(u)»", "s * s * normal(u)"),
    ],
    "simulation/world.rs": [
        ("disturbance: s = ς √δ", "map(|sigma| «sigma * step.sqrt()»)", "sigma * step"),
    ],
    "ensemble/noise.rs": [
        (
            "batches: disturbance of the attacker",
            "let by = «V::Eight::load(&by[block * BLOCK..]) - V::Eight::load(&own[block * BLOCK..])»",
            "V::Eight::load(&by[block * BLOCK..]) + V::Eight::load(&own[block * BLOCK..])",
        ),
    ],
    "ensemble/network.rs": [
        ("batches: mask", "«words[l] &= up[l];»", "words[l] |= up[l];"),
        ("batches: edges in registers", "if let Some(up) = «self.edges».get(block)", "self.sensors"),
        ("batches: links that are up, in registers", "if let Some(up) = relay.up.get(«block»)", "0"),
        ("batches: what is told but not known", "if «first & second & ALL != ALL»", "first | second == 0"),
        ("batches: what was told before", "«differs[l] |= last[l] ^ now[l];»", "differs[l] &= last[l] ^ now[l];"),
        ("batches: radius of a speaker before", "1 << (shift + «here»), d2", "there"),
    ],
    "ensemble/fates.rs": [
        ("batches: who is over", "if «place == GONE»", "false"),
        ("batches: bits of a sensor", "«i * shape.size..(i + 1) * shape.size»", "i * shape.size..i * shape.size + 1"),
    ],
    "ensemble/flips.rs": [
        ("batches: number of a flip", "let index = «entry.state / 2 + 1»", "entry.state / 2"),
        ("batches: holding time", "«steps as i32 + 1»", "steps as i32"),
    ],
    "ensemble/agenda.rs": [
        ("batches: the piece before", "self.steps[step] = «taken.before»", "NONE"),
    ],
}

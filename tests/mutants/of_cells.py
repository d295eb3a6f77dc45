"""The mutants of certified maps; `listed.py` says how to read a row."""

MUTANTS = {
    "cells/enclosure.rs": [
        ("cells: rounding of a step", "«(size as f64 + 2.0)» * f64::EPSILON", "0.0"),
        ("cells: b moves with ‖M‖", "moved[i] = «self.rest[x][i]» + unit * most", "0.0"),
        ("cells: start, rounded", "up(«2.0» * f64::EPSILON * most", "0.0"),
        ("cells: parts, rounded", "let rounded = «4.0» * unit", "0.0"),
        ("cells: half of what parts two", "«0.5 * (self.centre[x][i] + other.centre[x][i])»", "self.centre[x][i]"),
        ("cells: the other's error", "*reach = «larger(*reach, held)»", "*reach"),
        ("cells: what merging adds", "up(«far» + tilt * half[x]", "0.0"),
    ],
    "cells/guards.rs": [
        ("cells: least distance", "let near = «(middle - width)»", "middle"),
        ("cells: largest distance", "hi += «(middle + width)» * (middle + width)", "middle"),
        ("cells: tilt of a difference", "let tilt = («e.slope[i] - e.slope[j]»).abs()", "e.slope[i]"),
        ("cells: a nearer one is sure", "norms[j].hi < norms[i].«lo»", "hi"),
    ],
    "cells/cell.rs": [
        ("cells: two outcomes", "Some(found) if «found != end»", "false"),
        ("cells: no time left", "let timeout = «last && !s.ends.over»", "false"),
    ],
}

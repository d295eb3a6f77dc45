"""What is claimed of a record, in one table: the bound of each check, its source in the paper and its remedy.

Every array and every number that a `tadcore.Run` carries is recomputed by one of these checks, or compared with the
scenario. ``docs/verification.md`` prints the table.
"""

from __future__ import annotations

from tadcore.verification.report import Claim

_ALL = (
    Claim(
        "record.arrays",
        0.0,
        "the record is cut short or damaged: play the scenario again; nothing else can be checked of it",
        "",
    ),
    Claim("record.start", 1e-15, "the run does not begin where the scenario puts the players", "eq:stateequation"),
    Claim("record.times", 0.0, "the instants are not kT/K: the time axis was shifted, cut or stretched", ""),
    Claim(
        "record.outcome",
        1e-13,
        "the end is not that of the distances and capture radii: another radius, winner or instant was used",
        "sec:problem_formulation",
    ),
    Claim("record.divergence", 1e-9, "the distances diverge at another instant, or by another size, or not at all", ""),
    Claim("record.network", 1e-13, "the network is not that of the distances and visibility radii", "eq:limob"),
    Claim(
        "record.admissible",
        1e-12,
        "a gain uses a player that is out of sight: the strategy cannot be implemented",
        "eq:nwadapt",
    ),
    Claim("record.motion", 1e-12, "the players do not move by the recorded gains", "eq:stateequation"),
    Claim(
        "record.attacker",
        1e-12,
        "the attacker does not move by its own control: all positions are shifted along with it",
        "eq:stateequation",
    ),
    Claim("record.control", 1e-12, "the control is not the feedback of the gains and of P at that state", "eq:1d"),
    Claim("record.theta", 1e-10, "Θ is not that of the recorded gains", "eq:errfun1, 2"),
    Claim(
        "record.costs",
        1e-10,
        "the costs are not the players' objectives along this record",
        "eq:fullobj, eq:obj:zero_sum",
    ),
    Claim(
        "record.last_row",
        1.0,
        "the terminal row is not the last network in force, with its gains, Θ and controls at t_L",
        "eq:nwadapt",
    ),
    Claim(
        "record.certified",
        0.0,
        "the number of rows proved optimal is not that of the certificates: do not rely on it",
        "eq:optproblem",
    ),
    Claim(
        "record.synthesis",
        1e-9,
        "gains, iterations or statuses are not those of another play or of `synthesize`",
        "eq:optproblem",
    ),
)

RECORD = {claim.name: claim for claim in _ALL}
"""The claims by name, in the order in which they are checked."""

_AROUND = (
    Claim(
        "record.failures",
        0.0,
        "sensors and edges do not fail when this seed and trial say: another trial, or other mean times, was played",
        "",
    ),
    Claim(
        "record.seen",
        1e-13,
        "what is seen is not that of the distances, the visibility radii and the failures",
        "eq:limob",
    ),
    Claim(
        "record.contacts",
        1e-13,
        "who hears whom is not that of the distances, the radii of communication and the links of this trial",
        "",
    ),
    Claim("record.relay", 0.0, "the network in use is not what each player sees and is told", "eq:extadj"),
    Claim(
        "record.displacement",
        1e-12,
        "the players are not displaced as this seed and trial say: another trial, or another ς, was played",
        "",
    ),
)

AROUND = {claim.name: claim for claim in _AROUND}
"""The claims, in the place of ``record.network``, of a run with failures, links or disturbances."""

BY_POSITIONS_ALONE = frozenset(
    {
        "record.arrays",
        "record.start",
        "record.times",
        "record.network",
        "record.admissible",
        "record.outcome",
        "record.divergence",
        *AROUND,
    }
)
"""The checks that do not read P(t)."""

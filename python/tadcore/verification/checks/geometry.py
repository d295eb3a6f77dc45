"""What geometry demands: the straight line, the delay of a radius, and the symmetries of the plane and of space.

Theorem straight_line (I1, λ = 0): the attacker and the target stay on the line that joins them at t = 0. Theorem
delayproperty: two games that differ in one player's visibility radius are the same, here bitwise, until that
player's first edge in either. A game that is turned, mirrored or moved is the same game, turned, mirrored or
moved; one whose defenders are renamed, the same with other names.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.errors import ScenarioError
from tadcore.game.equilibrium import solve_equilibrium
from tadcore.game.recorded import scalar_gains
from tadcore.scenario.model import Scenario
from tadcore.simulation.play import simulate
from tadcore.simulation.run import Run
from tadcore.verification.oracle.draws import generator
from tadcore.verification.oracle.matrices import matrices_of, stacked_rows
from tadcore.verification.oracle.sampled_data import sampled_steps
from tadcore.verification.report import Check, Claim, VerificationReport

_LINE, _SAME, _DECIDED = 1e-10, 1e-8, 1e-11


def off_the_line(run: Run) -> float:
    """How far the attacker and the target leave the line that joins them at t = 0, relative to the run's extent."""
    pair = run.position[:, -2:] - run.position[0, -1]
    along = pair[0, 0]
    length = float(np.linalg.norm(along))
    if length == 0.0:
        return 0.0
    across = pair - (pair @ (along / length))[..., None] * (along / length)
    return float(np.abs(across).max() / max(np.abs(pair).max(), 1e-300))


def radius_delay(
    sc: Scenario, player: str, one: float, other: float, *, seed: int = 0, trial: int = 0
) -> tuple[int, bool]:
    """Compare the games under two visibility radii of one player.

    Parameters
    ----------
    sc : Scenario
        The game and its start.
    player : str
        A player with limited sight.
    one, other : float
        Its two radii.
    seed, trial : int
        Of failures and disturbances, the same in both games.

    Returns
    -------
    instants : int
        Instants before that player's first edge in either game.
    identical : bool
        Whether states and controls are bitwise equal at all of them.

    Raises
    ------
    ScenarioError
        The player is not one with limited sight, or a radius is not one.
    """
    if player not in sc.constrained:
        raise ScenarioError("player", player, f"one of {', '.join(sc.constrained)}")
    i = sc.constrained.index(player)
    games = [sc.replace({f"{player}.visibility_radius": radius}) for radius in (one, other)]
    runs = [simulate(game, seed=seed, trial=trial) for game in games]
    first = min(_first_edge(run, i) for run in runs)
    records = ((runs[0].position, runs[1].position), (runs[0].control, runs[1].control))
    return first, all(np.array_equal(x[:first], y[:first]) for x, y in records)


def _first_edge(run: Run, i: int) -> int:
    sees = run.seen[:-1, i].any(axis=1)
    return int(np.argmax(sees)) if sees.any() else len(run.times) - 1


def moved(sc: Scenario, turn: Floats, shift: Floats) -> Scenario:
    """The scenario with every position x at turn x + shift; ``turn`` is orthogonal, shape (dim, dim)."""
    places = (sc.positions @ turn.T + shift).tolist()
    return sc.replace({f"{player}.position": place for player, place in zip(sc.players, places, strict=True)})


def relabelled(sc: Scenario, order: Sequence[int]) -> Scenario:
    """The scenario with its defenders in another order: defender i is what ``order[i]`` was."""
    return sc.replace(defenders=[sc.defenders[i].model_dump(exclude_unset=True) for i in order])


def unlike(run: Run, other: Run, expected: Floats, defender: int | None) -> float:
    """How far ``other`` is from what symmetry makes of ``run``: inf for another ending or other network changes.

    Parameters
    ----------
    run, other : Run
        The run, and that of the moved or relabelled scenario.
    expected : ndarray, shape (L + 1, n + 2, dim)
        The positions of ``other`` by symmetry.
    defender : int or None
        Who intercepts in ``other`` by symmetry.

    Returns
    -------
    float
        The largest difference of positions, relative to the extent of ``expected``.
    """
    same_end = (other.outcome.kind, other.outcome.defender, other.outcome.time) == (
        run.outcome.kind,
        defender,
        run.outcome.time,
    )
    if not same_end or [c.time for c in run.network_changes] != [c.time for c in other.network_changes]:
        return float("inf")
    spread = expected - expected.mean(axis=1, keepdims=True)
    return float(np.abs(other.position - expected).max() / max(np.abs(spread).max(), 1e-300))


def check_geometry(run: Run, *, seed: int = 0) -> VerificationReport:
    """Check the straight line, the radius delay and the symmetries on a run.

    Parameters
    ----------
    run : Run
        The run; its scenario is played again moved, mirrored, relabelled and with other radii.
    seed : int
        Key of the rotation and the translation.

    Returns
    -------
    VerificationReport
        One check for each claim that applies. A symmetry that fails where a player stands so close to a threshold that
        rounding decides is not converged.
    """
    sc = run.scenario
    rounded = _rounding(run, float(np.abs(run.position).max()))
    checks: list[Check] = []
    notes: list[str] = []
    if sc.interaction == "I1" and sc.attacker.evasion == 0.0 and not _is_shaken(sc):
        remedy = "a suicidal attacker and its target must stay on their line: P_τ or P_a reaches beyond the target"
        claim = Claim("geometry.line", _LINE, remedy, "thm:straight_line")
        checks.append(claim.judge(off_the_line(run), doubt=rounded))
    delay, note = _delay(run)
    checks += [delay] if delay is not None else []
    notes += [note] if note else []
    checks += _frames(run, generator(seed, 2**40))
    if sc.is_random:
        notes.append("failures and disturbances are drawn by player and axis: no symmetry exchanges these")
    elif sc.n > 1:
        checks.append(_relabelling(run, rounded))
    return VerificationReport("geometry", tuple(checks), notes=tuple(notes))


def _is_shaken(sc: Scenario) -> bool:
    """Whether any player is disturbed."""
    return sc.world is not None and sc.world.shakes


def _delay(run: Run) -> tuple[Check | None, str]:
    """Theorem delayproperty for every player that starts far enough from all others; or why for nobody."""
    sc = run.scenario
    compared, differing = 0, 0
    apart = np.linalg.norm(sc.positions[:, None] - sc.positions, axis=-1)
    for i, player in enumerate(sc.constrained):
        nearest = float(np.delete(apart[i], i).min())  # below it nobody is seen at the start
        least = 1.001 * float(sc.capture_radii[i]) if i < sc.n else 0.0
        if nearest > 2.0 * least:
            radii = max(0.4 * nearest, least), 0.9 * nearest
            first, same = radius_delay(sc, player, *radii, seed=run.seed, trial=run.trial)
            compared += first
            differing += not same
    if not compared:
        return None, "everyone with limited sight starts within a capture radius of someone: no radius to delay"
    remedy = "a radius acts before its first edge: something else than the network reads it"
    where = f"{compared} instants in pairs of games of {len(sc.constrained)} players"
    return Check("geometry.delay", float(differing), 0.0, True, remedy, "thm:delayproperty", where), ""


def _frames(run: Run, rng: np.random.Generator) -> list[Check]:
    """The game turned, mirrored and moved; only moved, where displacements would have to be turned, too."""
    sc = run.scenario
    turn = np.linalg.qr(rng.normal(size=(sc.dim, sc.dim)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    mirror = np.diag([-1.0] + [1.0] * (sc.dim - 1))
    shift = rng.normal(size=sc.dim) * float(np.abs(sc.positions).max())
    still, none = np.eye(sc.dim), np.zeros(sc.dim)
    frames = [("rotation", turn, none), ("reflection", mirror, none), ("translation", still, shift)]
    margin, remedy = _margin(run), "the result depends on the frame: report this scenario"
    checks = []
    for name, U, by in frames[-1:] if _is_shaken(sc) else frames:
        other_run = simulate(moved(sc, U, by), seed=run.seed, trial=run.trial)
        expected = run.position @ U.T + by
        gap = unlike(run, other_run, expected, run.outcome.defender)
        doubt = _rounding(run, float(np.abs(expected).max()))
        claim = Claim(f"geometry.{name}", _SAME, remedy, "eq:stateequation")
        checks.append(claim.judge(gap, doubt=doubt if margin > max(_DECIDED, doubt) else np.inf))
    return checks


def _relabelling(run: Run, rounded: float) -> Check:
    """The game with its defenders in the reversed order."""
    sc = run.scenario
    order = list(range(sc.n))[::-1]
    other_run = simulate(relabelled(sc, order))
    winner = None if run.outcome.defender is None else order.index(run.outcome.defender)
    gap = unlike(run, other_run, run.position[:, [*order, sc.n, sc.n + 1]], winner)
    remedy = "the result depends on the order of the defenders: the synthesis found different minima"
    claim = Claim("geometry.relabelling", _SAME, remedy, "eq:optproblem")
    return claim.judge(gap, doubt=rounded if _margin(run) > max(_DECIDED, rounded) else np.inf)


def _rounding(run: Run, reach: float) -> float:
    """What rounding positions as far out as ``reach`` makes of a run, relative to its extent.

    Every step rounds the state; the steps that follow carry it on.
    """
    sc, m = run.scenario, matrices_of(run.scenario)
    rows = stacked_rows(solve_equilibrium(sc).feedback, sc.players)[: len(run.times)]
    rows[:, : scalar_gains(run).shape[1]] = scalar_gains(run)
    with np.errstate(over="ignore", invalid="ignore"):
        transition, _ = sampled_steps(m.B @ rows[:-1], sc.horizon / sc.steps)
        carried, grown = np.eye(m.size), 1.0
        for step in transition:
            carried = step @ carried
            grown = max(grown, float(np.abs(carried).sum(axis=1).max()))
    at = run.position
    extent = max(float(np.abs(at - at.mean(axis=1, keepdims=True)).max()), 1e-300)
    found = 16.0 * float(np.finfo(np.float64).eps) * (1.0 + reach / extent) * grown
    return found if np.isfinite(found) else np.inf


def _margin(run: Run) -> float:
    """The smallest distance of any pair from a radius that is tested, relative to the run's extent."""
    sc, at = run.scenario, run.position
    m, size = len(sc.constrained), sc.n + 1
    distance = np.linalg.norm(at[:, :, None] - at[:, None], axis=-1)
    capture = np.abs(distance[:, :size, -1] - sc.capture_radii)
    sight = np.abs(distance[:-1, :m] - sc.visibility_radii[:, None])
    sight[:, np.arange(m), np.arange(m)] = np.inf
    extent = max(float(distance.max()), 1e-300)
    margins = [capture, sight]
    if sc.world is not None and sc.world.link_radius is not None:
        margins.append(np.abs(distance[:-1, :m, :m] - sc.world.link_radius)[:, ~np.eye(m, dtype=bool)])
    return min(float(np.nanmin(margin, initial=np.inf)) for margin in margins) / extent

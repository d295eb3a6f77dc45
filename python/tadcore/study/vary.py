"""Which quantities of a scenario a study varies, with the sampler of each; `tadcore.scenario.paths` has the grammar."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tadcore.errors import ScenarioError
from tadcore.sampling.adapters import as_sampler
from tadcore.sampling.base import Sampler
from tadcore.scenario.hints import hint, wildcards
from tadcore.scenario.model import Scenario
from tadcore.scenario.numbers import game_quantities_of
from tadcore.scenario.paths import beyond, expand, normal
from tadcore.scenario.quantities import Quantity, quantities_of


def quantities(sc: Scenario, vary: Mapping[str, Any]) -> tuple[tuple[Quantity, Sampler], ...]:
    """Every quantity that varies, with its sampler, in the order attacker, target, defenders.

    Raises
    ------
    ScenarioError
        A path leads nowhere, two paths mean the same quantity, or a sampler does not fit.
    """
    known = quantities_of(sc) | game_quantities_of(sc)
    found: dict[str, tuple[Quantity, Sampler, str]] = {}
    for path, value in vary.items():
        field = f'vary["{path}"]'
        sampler = as_sampler(field, value)
        matched = expand(path, known)
        if not matched:
            raise ScenarioError(field, path, _rule(sc, known, path))
        for quantity in (known[name] for name in matched):
            if quantity.of_game and (sc.world is not None or sc.is_variant):
                way = f'tadcore.sweep(study, {{"{path}": [...]}})'
                here = "with failures, reports, disturbances, a receding horizon or the team criterion"
                rule = f"a position or a radius {here}: {way} varies {path}"
                raise ScenarioError(field, path, rule)
            for earlier, _, other in found.values():
                if _same(earlier, quantity):
                    raise ScenarioError(field, quantity.path, f'varied once only: "{other}" varies it too')
            sampler.check(field, quantity.components)
            found[quantity.path] = quantity, sampler, path
    return tuple((q, sampler) for q, sampler, _ in sorted(found.values(), key=lambda entry: entry[0].purpose))


def _same(one: Quantity, other: Quantity) -> bool:
    """Whether two quantities share a column."""
    together = one.field == other.field and one.row == other.row
    return together and (one.axis is None or other.axis is None or one.axis == other.axis)


def _rule(sc: Scenario, known: Mapping[str, Quantity], path: str) -> str:
    """What the path of something that cannot vary must be."""
    if expand(path, ["interaction"]):
        way = f'tadcore.sweep(study, {{"{path}": [...]}})'
        return f"a number: {way} plays both interactions"
    if expand(path, sc.paths):
        way = f'tadcore.sweep(study, {{"{path}": [...]}})'
        return f"a position, a radius or a weight; {way} varies {path}"
    if sc.interaction == "I1" and normal(path) == "target.visibility_radius":
        return "left out: it belongs to interaction I2, and this is I1, where the target sees all"
    nearest = hint(path, wildcards(known))
    some = "attacker.position, d*.visibility_radius or d1.control_weight"
    return (
        beyond(sc.n, path)
        or f"the path of a position, a radius or a weight, such as {some}{nearest and f'; {nearest}'}"
    )

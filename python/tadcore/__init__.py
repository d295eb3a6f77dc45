"""Target-attacker-defender linear-quadratic differential games with limited observations.

>>> import tadcore
>>> run = tadcore.simulate(tadcore.scenarios.load("paper-i1"))
>>> print(run.outcome)
d1 intercepts the attacker at t = 1.395

A `Scenario` says what is played; `solve_equilibrium`, `synthesize`, `simulate` and `simulate_batch` compute; a `Study`
draws, plays and keeps as many games as one likes, and `sweep` repeats it over weights. Bad input raises
`ScenarioError`, a game without an equilibrium `NoEquilibriumError`.
"""

import lazy_loader

# The names stand in the stub alone, which type checkers read; what is asked for is imported when it is asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

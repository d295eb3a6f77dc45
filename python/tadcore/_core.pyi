"""The compiled core. Everything here is reduced (one Kronecker factor); `tadcore` wraps it."""

from collections.abc import Callable, Sequence
from typing import Literal, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Cells",
    "Equilibrium",
    "Gains",
    "Game",
    "Record",
    "Stop",
    "World",
    "__version__",
    "grid_times",
    "observe",
    "simd",
    "simulate_games",
]

__version__: str

def simd() -> Literal["baseline", "avx2", "avx512"]:
    """The vector instructions in use: the widest that this processor has, or those that TADCORE_SIMD chose.

    TadcoreError where TADCORE_SIMD names none, or some that this processor does not have.
    """

def grid_times(horizon: float, step: float) -> NDArray[np.float64]:
    """t_0 … t_K, the doubles nearest to k T / K; ScenarioError for a step that does not divide the horizon."""

@final
class Cells:
    """A certified map in the making: cells of one player's start from which every game ends alike, and others."""

    def __new__(
        cls,
        game: Game,
        positions: NDArray[np.float64],
        visibility_radii: NDArray[np.float64],
        capture_radii: NDArray[np.float64],
        *,
        player: int,
        low: Sequence[float],
        high: Sequence[float],
        resolution: float,
        budget: int,
    ) -> Cells: ...
    def advance(self, cells: int, *, threads: int | None = None, stop: Stop | None = None) -> int:
        """Look at the next cells, at most so many; how many it were. Interrupted, the map is as before."""

    @property
    def done(self) -> bool:
        """Whether every cell is settled."""

    @property
    def counts(self) -> tuple[int, int]:
        """Cells looked at, and steps of their histories."""

    def leaves(self) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.int8], NDArray[np.int32]]:
        """The settled cells: corners (L, 4), level, kind (-1 unknown, -2 past the budget, -3 diverges), defender."""

@final
class Game:
    """Weights, horizon and grid; owns the equilibrium and the (step, topology) table."""

    def __new__(
        cls,
        *,
        interaction: Literal["I1", "I2"],
        horizon: float,
        step: float,
        defender_control_weight: NDArray[np.float64],
        target_control_weight: float,
        attacker_control_weight: float,
        defender_running_weight: NDArray[np.float64] | None = None,
        defender_terminal_weight: NDArray[np.float64] | None = None,
        target_running_weight: float = 1.0,
        target_terminal_weight: float = 1.0,
        attacker_target_running_weight: float = 1.0,
        attacker_target_terminal_weight: float = 1.0,
        evasion_running_weight: NDArray[np.float64],
        evasion_terminal_weight: NDArray[np.float64],
        evasion: float = 1.0,
        synthesis_weights: NDArray[np.float64],
        prediction_horizon: float | None = None,
        criterion: Literal["paper", "component"] = "paper",
        table_bytes: int | None = None,
    ) -> Game: ...
    @property
    def defenders(self) -> int: ...
    @property
    def steps(self) -> int: ...
    @property
    def times(self) -> NDArray[np.float64]: ...
    def equilibrium(self) -> Equilibrium: ...
    def synthesize(
        self,
        step: int,
        adjacency: NDArray[np.bool_],
        *,
        method: Literal["newton", "restarts", "descent"] = "newton",
        max_iterations: int | None = None,
        gains: Literal["scalar", "turning", "mirror"] = "scalar",
    ) -> Gains: ...
    """With gains other than "scalar" by Newton's method without a limit, in the plane."""
    def theta_price(self, steps: NDArray[np.int64], adjacency: NDArray[np.bool_]) -> NDArray[np.float64]: ...
    """(L,): Θ under "component" less Θ under "paper", at steps (L,) under adjacency (L, m, N)."""
    def simulate(
        self,
        positions: NDArray[np.float64],
        visibility_radii: NDArray[np.float64],
        capture_radii: NDArray[np.float64],
        *,
        hysteresis: float = 0.0,
        dwell: float = 0.0,
        continuous: bool = False,
        world: World | None = None,
        seed: int = 0,
        trial: int = 0,
        network: Callable[[int, float, NDArray[np.float64], NDArray[np.bool_]], NDArray[np.bool_]] | None = None,
        gains: Literal["scalar", "turning", "mirror"] = "scalar",
    ) -> Record:
        """One recorded run; `network(k, t, positions, seen)` gives the adjacency in the place of what is seen."""
    def simulate_batch(
        self,
        positions: NDArray[np.float64],
        visibility_radii: NDArray[np.float64],
        capture_radii: NDArray[np.float64],
        *,
        continuous: bool = False,
        passes: bool = False,
        threads: int | None = None,
        stop: Stop | None = None,
        world: World | None = None,
        seed: int = 0,
        first_trial: int = 0,
    ) -> tuple[NDArray[np.int8], NDArray[np.int32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
        """Kind, defender, time, whether the game diverged, and whether it passed within a radius between instants."""
    def score_batch(
        self,
        positions: NDArray[np.float64],
        visibility_radii: NDArray[np.float64],
        capture_radii: NDArray[np.float64],
        *,
        threads: int | None = None,
        stop: Stop | None = None,
        world: World | None = None,
        seed: int = 0,
        first_trial: int = 0,
    ) -> tuple[NDArray[np.int8], NDArray[np.int32], NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
        """Kind, defender, time, whether the game diverged, and scores: timeout, captured, intercepted, d1 to dn."""
    def score_courses(
        self,
        positions: NDArray[np.float64],
        visibility_radii: NDArray[np.float64],
        capture_radii: NDArray[np.float64],
        *,
        world: World,
        seed: int,
        offsets: NDArray[np.uint64],
        steps: NDArray[np.uint64],
        trials: NDArray[np.uint64],
        column: int,
        threads: int | None = None,
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Defender and the course of one score, of rows with draws of ``trials[offsets[r]:offsets[r + 1]]``."""
    def save_table(self) -> bytes:
        """The table of one-step transitions; for `load_table` of the same game and version."""
    def table_length(self, start: bytes) -> int:
        """Bytes of the saved table that begins with these (40 at least); ValueError where it is not this game's."""
    def load_table(self, table: bytes) -> int:
        """Add the entries of a saved table; ValueError for one that is not this game's. The entries held now."""
    def table(self) -> dict[str, int]: ...

@final
class Stop:
    """A flag by which one thread ends what others compute: each computation that has it raises KeyboardInterrupt."""

    def __new__(cls) -> Stop: ...
    def set(self) -> None: ...
    def is_set(self) -> bool: ...

@final
class World:
    """What a run is given besides positions and radii: m numbers of the constrained players, n + 2 disturbances.

    ScenarioError for a number that breaks its rule; inf is never (until a failure) or for good (until the end of one).
    """

    def __new__(
        cls,
        *,
        mean_time_to_failure: NDArray[np.float64],
        mean_time_to_repair: NDArray[np.float64],
        mean_time_detected: NDArray[np.float64],
        mean_time_missed: NDArray[np.float64],
        stationary: NDArray[np.bool_],
        link_radius: Sequence[float | None] | None = None,
        relays: int | None = None,
        common_frame: bool = False,
        link_mean_time_up: NDArray[np.float64] | None = None,
        link_mean_time_down: NDArray[np.float64] | None = None,
        link_stationary: bool = False,
        disturbance: NDArray[np.float64],
    ) -> World: ...

@final
class Equilibrium:
    """P on the grid: groups ["defenders", "target", "attacker"] in I1, ["team"] in I2."""

    @property
    def groups(self) -> list[str]: ...
    @property
    def P(self) -> NDArray[np.float64]: ...
    """(groups, K+1, N, N), read-only."""
    @property
    def steps(self) -> int: ...
    """Accepted steps of the integrator."""
    def residual(self) -> NDArray[np.float64]: ...
    """(groups, K+1): relative Riccati residual at each node."""
    def feedback(self) -> NDArray[np.float64]: ...
    """(K+1, N+1, N): FNE feedback rows d1…dn, target, attacker: u = row @ z."""

@final
class Gains:
    """The gains at one (instant, topology)."""

    @property
    def rows(self) -> NDArray[np.float64]: ...
    """(m, N): u_i = rows[i] @ z."""
    @property
    def turn(self) -> NDArray[np.float64] | None: ...
    """(m, N): u_i = rows[i] @ z + turn[i] @ Jz, J a quarter turn; None for scalar gains."""
    @property
    def K(self) -> NDArray[np.float64]: ...
    """(m, N): the paper's scalar block factors, K_i 𝓘_i = rows[i]; zero on players not seen."""
    @property
    def K_turn(self) -> NDArray[np.float64] | None: ...
    """(m, N): the factors of J in the paper's blocks; None for scalar gains."""
    @property
    def theta(self) -> float: ...
    @property
    def terms(self) -> NDArray[np.float64]: ...
    """Unweighted squared norms, four in I1, three in I2; theta = γ · terms."""
    @property
    def gradient_norm(self) -> float: ...
    """Relative."""
    @property
    def iterations(self) -> int: ...
    @property
    def converged(self) -> bool: ...
    @property
    def status(self) -> str: ...
    @property
    def certified(self) -> bool: ...
    """Whether the minimum is proved to be global among scalar gains."""
    @property
    def certified_blocks(self) -> bool: ...
    """Whether it is proved to be global among the paper's gains in blocks."""
    @property
    def start(self) -> Literal["canonical", "complex", "stacked", "reversed", "between"]: ...
    """The start that led to the minimum."""
    @property
    def restarts_left_out(self) -> int: ...
    """Restarts that promised to lead lower, beyond those made: in large games their number is limited."""

@final
class Record:
    """One recorded run; L = steps taken, rows 0…L, the last the terminal state.

    Where a game that diverged leaves the range of double precision, the record stops before its end.
    """

    @property
    def kind(self) -> int: ...
    @property
    def defender(self) -> int: ...
    @property
    def time(self) -> float: ...
    @property
    def diverged(self) -> tuple[float, float] | None: ...
    """The instant of the divergence, and the largest size over that of the start."""
    @property
    def times(self) -> NDArray[np.float64]: ...
    @property
    def passes(self) -> list[tuple[int, float, float, float, float, float]]: ...
    """Defender (-1 for the target), t_k, t_{k+1}, when a radius is entered, when the two are closest, how close."""
    @property
    def position(self) -> NDArray[np.float64]: ...
    """(L+1, n+2, dim)."""
    @property
    def control(self) -> NDArray[np.float64]: ...
    """(L+1, n+2, dim); the last row under the network of the last step."""
    @property
    def adjacency(self) -> NDArray[np.bool_]: ...
    """(L+1, m, N): row i, entry j ≠ i player j, entry i the attacker; the last row repeats the one before."""
    @property
    def seen(self) -> NDArray[np.bool_] | None: ...
    """(L+1, m, N): the sight less what failed; None but in a world or under a network from outside."""
    @property
    def sensor_up(self) -> NDArray[np.bool_] | None: ...
    """(L+1, m); None without a world."""
    @property
    def edge_up(self) -> NDArray[np.bool_] | None: ...
    """(L+1, m, N); None without a world."""
    @property
    def heard(self) -> NDArray[np.bool_] | None: ...
    """(L+1, m, m): i hears j, the diagonal false; None without a world."""
    @property
    def displacement(self) -> NDArray[np.float64] | None: ...
    """(L+1, n+2, dim): what is added to the positions after the step from each row; None without a world."""
    @property
    def gains(self) -> NDArray[np.float64]: ...
    """(L+1, m, N)."""
    @property
    def turn(self) -> NDArray[np.float64] | None: ...
    """(L+1, m, N): the factors of Jz; None for scalar gains."""
    @property
    def theta(self) -> NDArray[np.float64]: ...
    @property
    def theta_terms(self) -> NDArray[np.float64]: ...
    """(L+1, 4 or 3), unweighted."""
    @property
    def costs(self) -> NDArray[np.float64]: ...
    """J_d, J_τ, J_a over [0, time] in I1; the zero-sum J in I2."""
    @property
    def iterations(self) -> int: ...
    @property
    def unconverged(self) -> int: ...
    """Instants whose synthesis stopped short of the tolerance."""
    @property
    def certified(self) -> int: ...
    """Rows whose gains are proved to be globally optimal."""

def observe(positions: NDArray[np.float64], visibility_radii: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Who sees whom at positions (n + 2, dim): 𝒜, shape (m, N), as a run sees it."""

def simulate_games(
    interaction: Literal["I1", "I2"],
    numbers: NDArray[np.float64],
    positions: NDArray[np.float64],
    visibility_radii: NDArray[np.float64],
    capture_radii: NDArray[np.float64],
    *,
    continuous: bool = False,
    passes: bool = False,
    threads: int | None = None,
    stop: Stop | None = None,
) -> tuple[
    NDArray[np.int8],
    NDArray[np.int32],
    NDArray[np.float64],
    NDArray[np.int64],
    NDArray[np.bool_],
    NDArray[np.bool_],
]:
    """Trials with a game each: kind (3: no equilibrium), defender, time, grid index, diverged, passed.

    Each row of numbers: horizon, step, r_τ, r_a, q_aτ, f_aτ, q_τa, f_τa, λ; of all defenders r_d, q_ad, f_ad, q_da,
    f_da; then γ. What does not belong to the interaction is not read.
    """

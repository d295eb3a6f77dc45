"""The network-adapted performance indices of Theorems thm1 and thm2, as the paper prints them.

======================  ==========================================  ==========================================
here                    I1 (eq:perfindex, eq:Jseq)                  I2 (eq:perfmatzsg, eq:obj:zero_sum_stru)
======================  ==========================================  ==========================================
``S``                   S₁ = B_dᵀP_d + R_d G                        S₂ = R_d G_d - B_dᵀP, S₃ = R_τ G_τ - B_τᵀP
``dQ``                  ΔQ_d = GᵀR_dG - P_dB_dR_d⁻¹B_dᵀP_d          ΔQ = PS_dP + PS_τP - GᵀRG
                        ΔQ_p = -P_pB_dR_d⁻¹S₁ - (·)ᵀ, p = τ, a
======================  ==========================================  ==========================================

G = K𝓘 holds the rows of the players with limited sight. All matrices are reduced factors; a state is (…, N, dim) and a
control (…, players, dim), so every quadratic form sums over the axes and the indices are the paper's own numbers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tadcore._shared.arrays import Floats
from tadcore.scenario.model import Scenario

from .matrices import Matrices


@dataclass(frozen=True, eq=False)
class AdaptedWeights:
    """S and ΔQ^Ad at some instants.

    Attributes
    ----------
    S : ndarray, shape (…, m, N)
        S₁ in I1; S₂ with S₃ below it in I2.
    dQ : ndarray, shape (indices, …, N, N)
        ΔQ_d, ΔQ_τ, ΔQ_a in I1; ΔQ alone in I2.
    """

    S: Floats
    dQ: Floats


def adapted_weights(sc: Scenario, m: Matrices, values: Floats, G: Floats) -> AdaptedWeights:
    """S and ΔQ^Ad for value matrices (parties, …, N, N) and rows (…, m, N) of the players with limited sight."""
    limited = len(sc.constrained)
    r = m.r[:limited, None]
    Gt = np.swapaxes(G, -1, -2)
    if sc.interaction == "I2":
        P = values[1]
        S = r * G - P  # B_d and B_τ together are the identity
        return AdaptedWeights(S, (P @ (P / r) - Gt @ (r * G))[None])
    first = values[..., :limited, :]  # B_dᵀP_p: the defenders' rows
    S = first[0] + r * G
    across = [-np.swapaxes(first[p], -1, -2) @ (S / r) for p in (1, 2)]
    own = Gt @ (r * G) - np.swapaxes(first[0], -1, -2) @ (first[0] / r)
    return AdaptedWeights(S, np.stack([own, *(x + np.swapaxes(x, -1, -2) for x in across)]))


def theta_terms(sc: Scenario, weights: AdaptedWeights) -> Floats:
    """The squared norms that Θ weighs, in the order of γ, shape (…, 4) in I1 and (…, 3) in I2 (reduced norms)."""
    squares = [np.sum(x * x, axis=(-1, -2)) for x in weights.dQ]
    if sc.interaction == "I1":
        squares.append(np.sum(weights.S**2, axis=(-1, -2)))
    else:
        squares += [np.sum(weights.S[..., part, :] ** 2, axis=(-1, -2)) for part in (slice(0, sc.n), slice(sc.n, None))]
    return np.stack(squares, axis=-1)


def integrands(sc: Scenario, m: Matrices, weights: AdaptedWeights, z: Floats, u: Floats) -> Floats:
    """Twice the integrand of every index J^Ad, shape (indices, …).

    Parameters
    ----------
    sc : Scenario
        The game.
    m : Matrices
        Its matrices.
    weights : AdaptedWeights
        S and ΔQ^Ad at the same instants.
    z : ndarray, shape (…, N, dim)
        State.
    u : ndarray, shape (…, n + 2, dim)
        Controls of all players.
    """
    limited = len(sc.constrained)
    effort = m.r * np.sum(u * u, axis=-1)
    cross = 2.0 * np.sum(u[..., :limited, :] * (weights.S @ z), axis=(-1, -2))
    running = m.Q if sc.interaction == "I1" else m.Q[1:]
    state = np.stack([np.sum(z * ((Q + dQ) @ z), axis=(-1, -2)) for Q, dQ in zip(running, weights.dQ, strict=True)])
    if sc.interaction == "I2":
        total = state[0] + cross + effort[..., -1] - effort[..., :-1].sum(axis=-1)
        return np.asarray(total[None])
    state[0] += effort[..., :limited].sum(axis=-1) - cross
    state[1] += effort[..., limited]
    state[2] += effort[..., limited + 1]
    return state

"""One step of a closed loop under zero-order hold, exactly: its transition and the Gramians of quadratic integrands.

Over a step ż = Cz with C constant, so

    z(δ) = Φ(δ)z,  ∫₀^δ z(s)ᵀ W z(s) ds = zᵀ Γ(δ) z,  Φ(δ) = exp(Cδ),  Γ(δ) = ∫₀^δ Φ(s)ᵀ W Φ(s) ds.

Both double: Φ(2h) = Φ(h)² and Γ(2h) = Γ(h) + Φ(h)ᵀ Γ(h) Φ(h). They start from an h with ‖C‖h ≤ ½, where a Taylor
polynomial is exact to rounding and Gauss-Legendre quadrature of a high order with it. A step of any stiffness takes
log₂(‖C‖δ) doublings.
"""

from __future__ import annotations

import numpy as np

from tadcore._shared.arrays import Floats

DOUBT = 64.0 * float(np.finfo(np.float64).eps)
"""Rounding of a step relative to its size, for ‖C‖δ ≤ 1; it grows with ‖C‖δ, as the condition of exp does."""
_DEGREE, _NODES, _MOST = 14, 8, 200


def sampled_steps(C: Floats, step: float, W: Floats | None = None) -> tuple[Floats, Floats]:
    """Transitions and Gramians of many steps.

    Parameters
    ----------
    C : ndarray, shape (L, D, D)
        The closed loop of every step.
    step : float
        δ.
    W : ndarray, shape (w, L, D, D), optional
        Symmetric weights of w integrands; none by default.

    Returns
    -------
    transition : ndarray, shape (L, D, D)
        Φ(δ).
    gramian : ndarray, shape (w, L, D, D)
        Γ(δ). What overflows is inf or nan in both.
    """
    weights = np.empty((0, *C.shape)) if W is None else W
    halvings = 0
    fastest = float(stiffness(C, step).max(initial=0.0))
    if np.isfinite(fastest) and fastest > 0.5:
        halvings = min(int(np.ceil(np.log2(2.0 * fastest))), _MOST)
    h = step / 2.0**halvings
    gramian = np.zeros(weights.shape)
    if len(weights):
        nodes, shares = np.polynomial.legendre.leggauss(_NODES)
        for node, share in zip(0.5 * (nodes + 1.0), 0.5 * shares, strict=True):
            at = _taylor(C, node * h)
            gramian += share * h * (np.swapaxes(at, -1, -2) @ weights @ at)
    transition = _taylor(C, h)
    for _ in range(halvings):
        gramian = gramian + np.swapaxes(transition, -1, -2) @ gramian @ transition
        transition = transition @ transition
    return transition, gramian


def stiffness(C: Floats, step: float) -> Floats:
    """‖C‖δ of every step in the largest row sum, shape (L,)."""
    found: Floats = np.abs(C).sum(axis=-1).max(axis=-1) * step
    return found


def _taylor(C: Floats, h: float) -> Floats:
    """exp(Ch) for ‖C‖h ≤ ½, by Horner's rule."""
    one = np.eye(C.shape[-1])
    value = np.broadcast_to(one, C.shape)
    for k in range(_DEGREE, 0, -1):
        value = one + (h / k) * (C @ value)
    return np.array(value)

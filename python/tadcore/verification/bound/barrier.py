"""The least s for which G + sD is positive definite, over the Gram matrices G of a polynomial: Newton's method.

    minimise τs - log det(G + sD),   τ growing,

from a matrix that is feasible. With D positive definite, s < 0 says that some G is positive definite itself, and
G ⪰ -sD. The status is a hint: `tadcore.verification.bound.proof` proves, or not, by the matrix that is returned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, solve_triangular

from tadcore._shared.arrays import Floats

from .gram import Gram

_STEPS, _GROWTH, _NEAR, _RIM = 100, 8.0, 1.0, 0.999999
_LONGEST = 1e3


@dataclass
class Reached:
    """Where the minimisation ended.

    Attributes
    ----------
    G : ndarray, shape (b, b)
        The Gram matrix.
    s : float
        The least s reached.
    W : ndarray, shape (b, b)
        (G + sD)⁻¹, which over its first entry is the matrix of the moments where D is the constant alone.
    status : str
        ``"reached"``: s is below what was asked for; ``"above"``: no s is; ``"least"``: to the accuracy asked for;
        ``"stopped"``: rounding or the limit of steps.
    steps : int
        Newton steps.
    """

    G: Floats
    s: float
    W: Floats
    status: Literal["reached", "above", "least", "stopped"]
    steps: int


def shift_of(G: Floats, D: Floats) -> float:
    """The least s with G + s diag(D) ⪰ 0."""
    scale = 1.0 / np.sqrt(D)
    return -float(np.linalg.eigvalsh(G * np.outer(scale, scale))[0])


def minimise(
    gram: Gram, G: Floats, D: Floats, s: float, *, below: float, accuracy: float, enough: float = -np.inf
) -> Reached:
    """Decrease s from a feasible G + s diag(D).

    Parameters
    ----------
    gram : Gram
        The affine space of G.
    G : ndarray, shape (b, b)
        Where to begin.
    D : ndarray, shape (b,)
        The diagonal of D, at least 0.
    s : float
        With which G + s diag(D) is positive definite.
    below : float
        Stop as soon as s is less.
    accuracy : float
        Stop where s is within that of the least one.
    enough : float, optional
        Stop where s is less and most of the way to the least one is done.
    """
    size, count = len(D), gram.freedom
    tau = size / max(abs(s - below), accuracy) if np.isfinite(below) else size / max(abs(s), accuracy)
    W = np.zeros_like(G)
    for step in range(_STEPS):
        try:
            L = np.linalg.cholesky(G + s * np.diag(D))
            W = cho_solve((L, True), np.eye(size))
            W = 0.5 * (W + W.T)
            WD = W * D
            H = np.empty((count + 1, count + 1))
            H[:count, :count] = gram.metric(W)
            H[:count, count] = H[count, :count] = gram.pull(WD @ W)
            H[count, count] = np.sum(WD * WD.T)
            unit = 1.0 / np.sqrt(H.diagonal())
            factor = cho_factor(H * np.outer(unit, unit) + 1e-14 * np.eye(count + 1))
        except LinAlgError:
            return Reached(G, s, W, "stopped", step)
        slope = np.append(gram.pull(W), np.trace(WD))
        move, decrement = _newton(factor, unit, slope, tau)
        if decrement < _NEAR:  # near the centre of τ
            if s - 2.0 * size / tau > below:
                return Reached(G, s, W, "above", step)
            if size / tau < (max(accuracy, -0.5 * s) if s < enough else accuracy):
                return Reached(G, s, W, "least", step)
            tau *= _GROWTH
            move, decrement = _newton(factor, unit, slope, tau)
        change = gram.direction(move[:count])
        Y = solve_triangular(L, change + move[count] * np.diag(D), lower=True)
        spectrum = np.linalg.eigvalsh(solve_triangular(L, Y.T, lower=True))
        length = _search(tau * move[count], spectrum, decrement)
        if not np.isfinite(length):
            return Reached(G, s, W, "stopped", step)
        G, s = G + length * change, s + length * float(move[count])
        if s < below:
            return Reached(G, s, W, "reached", step + 1)
    return Reached(G, s, W, "stopped", _STEPS)


def _newton(factor: tuple[Floats, bool], unit: Floats, slope: Floats, tau: float) -> tuple[Floats, float]:
    """Newton's step and its decrement, squared."""
    downhill = slope.copy()
    downhill[-1] -= tau
    move = unit * cho_solve(factor, unit * downhill)
    return move, float(downhill @ move)


def _search(linear: float, spectrum: Floats, decrement: float) -> float:
    """The length that minimises length·linear - Σ log(1 + length·spectrum)."""
    low, high = 0.0, min(_RIM / -spectrum[0], _LONGEST) if spectrum[0] < 0.0 else _LONGEST
    length = min(1.0 / (1.0 + np.sqrt(max(decrement, 0.0))), high)
    for _ in range(40):
        part = spectrum / (1.0 + length * spectrum)
        slope, curve = linear - float(part.sum()), float(part @ part)
        low, high = (length, high) if slope < 0.0 else (low, length)
        new = length - slope / curve if curve > 0.0 else high
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - length) < 1e-3 * length:
            return float(new)
        length = new
    return float(length)

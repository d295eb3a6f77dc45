"""A proof that Θ is nowhere below a number, in whole numbers alone.

Where the unknowns fall into groups, Θ(x̂ + y) = Θ(x̂) + Σ p_c(y_c). For each group a part says p_c(y) + ε_c ≥ 0:

- G, a matrix of doubles, becomes an exact Gram matrix of p_c + ε_c when what is wrong with each product of monomials
  is spread over its entries (Peyrl and Parrilo), as rational numbers; those that pair two unknowns with 1 are spared;
- with L, a matrix of doubles, the remainder E = G - LL' has E_ii w_i ≥ Σ_j≠i |E_ij| w_j for powers of two w, so E is
  positive semidefinite (diagonal dominance), and with it G = LL' + E.

Then p_c + ε_c = |L'b|² + b'Eb ≥ 0 and Θ ≥ Θ(x̂) - Σ ε_c at all real gains. `Proof.holds` checks all of it; nothing
rests on how G and L were found.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError

from tadcore._shared.arrays import Floats

from .gram import basis_of, products_of
from .polynomial import Polynomial

_TIMES = 12
"""What the number of entries of every product divides: 1, 2, 3, 4 or 6."""


@dataclass(frozen=True)
class Part:
    """That p + ε ≥ 0 for the polynomial p of one group.

    Attributes
    ----------
    G, L : ndarray, shape (b, b)
        See the head of this module.
    weights : tuple of int
        Exponents of w.
    epsilon : float
        ε.
    """

    G: Floats
    L: Floats
    weights: tuple[int, ...]
    epsilon: float

    def holds(self, p: Polynomial) -> bool:
        """Check it, exactly."""
        basis = basis_of(p, True)
        products = products_of(basis)
        if any(value and monomial not in products for monomial, value in p.coefficients.items()):
            return False
        (G, g), (L, h), (constant, c) = _whole(self.G), _whole(self.L), _whole(np.array([self.epsilon]))
        e = max(g, 2 * h, c)
        unit = _TIMES * p.denominator  # everything is over unit·2^e
        G = G * (1 << e - g)
        E = unit * (G - (L @ L.T) * (1 << e - 2 * h))
        for product, entries in products.items():
            wanted = p.coefficients.get(product, 0) << e
            if not product:
                wanted += p.denominator * int(constant[0]) << e - c
            wrong = wanted - p.denominator * sum(int(G[a, b]) * (1 if a == b else 2) for a, b in entries)
            spread = [(a, b) for a, b in entries if a > 0] or entries  # the constant's row has the least room
            times = sum(1 if a == b else 2 for a, b in spread)
            for a, b in spread:
                E[a, b] += _TIMES // times * wrong
                E[b, a] = E[a, b]
        least = min(self.weights)
        size = np.abs(E) * np.array([1 << w - least for w in self.weights], dtype=object)
        return all(2 * size[i, i] >= size[i].sum() and E[i, i] >= 0 for i in range(len(basis)))


@dataclass(frozen=True)
class Proof:
    """That Θ ≥ ``bound`` at all gains that the network allows.

    Attributes
    ----------
    polynomial : Polynomial
        Θ around gains x̂, in units that are powers of two.
    parts : tuple of Part
        One for each group of unknowns.
    """

    polynomial: Polynomial = field(repr=False)
    parts: tuple[Part, ...] = field(repr=False)

    @property
    def theta(self) -> Fraction:
        """Θ(x̂), exactly."""
        return self.polynomial.constant

    @property
    def bound(self) -> Fraction:
        """Θ(x̂) - Σ ε, exactly."""
        return self.theta - sum((Fraction(part.epsilon) for part in self.parts), Fraction(0))

    def holds(self) -> bool:
        """Check the proof in exact arithmetic."""
        groups = self.polynomial.groups()
        return len(groups) == len(self.parts) and all(
            part.holds(self.polynomial.of(group)) for group, part in zip(groups, self.parts, strict=True)
        )


def part_of(G: Floats, D: Floats, margin: float) -> Part | None:
    """A part from a matrix with G ⪰ margin·diag(D), whose first entry is ε; None where rounding is in the way."""
    try:
        L = np.linalg.cholesky(G - np.diag(0.5 * margin * D))
    except LinAlgError:
        return None
    weights = tuple(np.rint(-0.5 * np.log2(D)).astype(int).tolist())
    return Part(G, np.asarray(L), weights, float(G[0, 0]))


def _whole(values: Floats) -> tuple[NDArray[Any], int]:
    """Whole numbers and the e with values = numbers / 2^e."""
    mantissa, exponent = np.frexp(values)
    exponent = np.where(mantissa == 0.0, 53, exponent)
    e = max(53 - int(exponent.min(initial=53)), 0)
    numbers = np.empty(values.shape, dtype=object)
    for where in np.ndindex(values.shape):
        numbers[where] = int(mantissa[where] * 2.0**53) << int(exponent[where]) - 53 + e
    return numbers, e

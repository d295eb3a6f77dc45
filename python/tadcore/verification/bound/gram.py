"""The Gram matrices of a polynomial: symmetric G with b(y)'G b(y) = p(y), b monomials of degree at most two.

They are an affine space: entries whose monomials have the same product may be exchanged for each other. p is a sum of
squares exactly where one of them is positive semidefinite.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from tadcore._shared.arrays import Floats

from .polynomial import Monomial, Polynomial


class Gram:
    """The affine space of the Gram matrices of one polynomial.

    Parameters
    ----------
    polynomial : Polynomial
        p.
    constant : float or None
        What is added to p; None for a basis without 1: the constant and the linear part of p are then left out.

    Attributes
    ----------
    basis : list of tuple
        b.
    products : dict
        The entries (row, column), row ≤ column, of each product of two monomials.
    """

    def __init__(self, polynomial: Polynomial, constant: float | None = None) -> None:
        self.basis = basis_of(polynomial, constant is not None)
        self.products = products_of(self.basis)
        self._entries = [np.array(entries) for entries in self.products.values()]
        self._wanted = np.array([polynomial.coefficient(product) for product in self.products])
        if constant is not None:
            self._wanted[list(self.products).index(())] = constant
        free = [entries for entries in self._entries if len(entries) > 1]
        ends = np.concatenate(free) if free else np.zeros((0, 2), dtype=int)
        self.row, self.column = ends[:, 0], ends[:, 1]
        first = np.cumsum([0, *map(len, free)])[:-1]
        lengths = [len(entries) - 1 for entries in free]
        self._minus = np.repeat(first, lengths).astype(int)
        others = [np.arange(f + 1, f + 1 + m) for f, m in zip(first, lengths, strict=True)]
        self._plus = np.concatenate(others) if others else np.zeros(0, dtype=int)
        self.freedom = len(self._plus)

    @property
    def quadratics(self) -> int:
        """How many products of two unknowns the basis has."""
        return sum(len(b) == 2 for b in self.basis)

    def project(self, G: Floats) -> Floats:
        """The nearest Gram matrix: what is wrong with a product is spread over its entries (Peyrl and Parrilo)."""
        G = G.copy()
        for entries, wanted in zip(self._entries, self._wanted, strict=True):
            a, b = entries[:, 0], entries[:, 1]
            times = np.where(a == b, 1.0, 2.0)
            G[a, b] += (wanted - times @ G[a, b]) / times.sum()
            G[b, a] = G[a, b]
        return G

    def direction(self, z: Floats) -> Floats:
        """Σ z_k N_k: what changes G and not p."""
        amount = np.zeros(len(self.row))
        amount[self._plus] = z
        np.subtract.at(amount, self._minus, z)
        X = np.zeros((len(self.basis),) * 2)
        X[self.row, self.column] = 0.5 * amount
        X[self.column, self.row] += 0.5 * amount
        return X

    def pull(self, X: Floats) -> Floats:
        """⟨N_k, X⟩ for a symmetric X."""
        amount = X[self.row, self.column]
        difference: Floats = amount[self._plus] - amount[self._minus]
        return difference

    def metric(self, W: Floats) -> Floats:
        """⟨N_k, W N_l W⟩ for a symmetric W."""
        rows, columns = W[self.row], W[self.column]
        H = rows[:, self.row] * columns[:, self.column]
        H += rows[:, self.column] * columns[:, self.row]
        H = H[self._plus] - H[self._minus]
        metric: Floats = 0.5 * (H[:, self._plus] - H[:, self._minus])
        return metric


def basis_of(polynomial: Polynomial, constant: bool) -> list[Monomial]:
    """1 where it is asked for, the unknowns, and for a quartic their products."""
    every = range(polynomial.unknowns)
    quartic = any(len(monomial) > 2 for monomial in polynomial.coefficients)
    products = list(combinations_with_replacement(every, 2)) if quartic else []
    return [*([()] if constant else []), *((v,) for v in every), *products]


def products_of(basis: list[Monomial]) -> dict[Monomial, list[tuple[int, int]]]:
    """The entries of a Gram matrix by the product of their monomials."""
    found: dict[Monomial, list[tuple[int, int]]] = {}
    for b, right in enumerate(basis):
        for a, left in enumerate(basis[: b + 1]):
            found.setdefault(tuple(sorted(left + right)), []).append((a, b))
    return found

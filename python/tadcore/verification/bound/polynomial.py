"""Θ as a polynomial with rational coefficients: what an exact proof is about.

The numbers that define Θ at one (instant, network) are doubles: the rows of P(t_k) that enter B'P, the control weights
r and γ. Each is a rational number, and so is every coefficient of Θ, the division by r included. Nothing is rounded:

    I1  S = B_d'P_d + R G,  ΔQ_d = G'RG - P_d B_d R⁻¹ B_d'P_d,  ΔQ_p = -X - X',  X = P_p B_d R⁻¹ S   (eq:perfindex)
    I2  S = R G - B'P,      ΔQ = P B R⁻¹ B'P - G'RG                                              (eq:perfmatzsg)

The unknowns are the gains on the players that are seen: g_i = x (e_j - e_i) summed over the seen players j, and x e_i
for the attacker. They are written x = x̂ + y, with x̂ doubles, and y in units that are powers of two, also exactly.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement
from math import lcm

from tadcore._shared.arrays import Floats
from tadcore.verification.oracle.objective import FullObjective

Monomial = tuple[int, ...]
"""Unknowns in order, each as often as its power."""
Terms = dict[Monomial, Fraction]


@dataclass(frozen=True)
class Polynomial:
    """Σ coefficients[α] y^α / denominator over y, with whole numbers.

    Attributes
    ----------
    unknowns : int
        How many y there are.
    coefficients : dict
        Whole numbers by monomial.
    denominator : int
        What all of them are divided by.
    """

    unknowns: int
    coefficients: dict[Monomial, int]
    denominator: int

    def coefficient(self, monomial: Monomial) -> float:
        """One coefficient, rounded once."""
        return self.coefficients.get(monomial, 0) / self.denominator

    @property
    def constant(self) -> Fraction:
        """Θ at y = 0."""
        return Fraction(self.coefficients.get((), 0), self.denominator)

    def scaled(self, exponents: Sequence[int]) -> Polynomial:
        """The same function of y_v / 2^exponents[v]."""
        by = {monomial: sum(exponents[v] for v in monomial) for monomial in self.coefficients}
        least = min(by.values(), default=0)
        scaled = {monomial: value << by[monomial] - least for monomial, value in self.coefficients.items()}
        whole = (self.denominator << -least, 1) if least <= 0 else (self.denominator, 1 << least)
        return Polynomial(self.unknowns, {a: value * whole[1] for a, value in scaled.items()}, whole[0])

    def groups(self) -> list[list[int]]:
        """The unknowns in groups that share no monomial: Θ is a constant and a polynomial of each group."""
        found: list[set[int]] = [{v} for v in range(self.unknowns)]
        for monomial, value in self.coefficients.items():
            if value and len(set(monomial)) > 1:
                joined = [group for group in found if group & set(monomial)]
                if len(joined) > 1:
                    found = [group for group in found if group not in joined] + [set().union(*joined)]
        return sorted(sorted(group) for group in found)

    def of(self, group: list[int]) -> Polynomial:
        """The part without a constant that has the unknowns of one group, numbered from 0."""
        number = {v: i for i, v in enumerate(group)}
        own = {
            tuple(number[v] for v in monomial): value
            for monomial, value in self.coefficients.items()
            if value and monomial and monomial[0] in number
        }
        return Polynomial(len(group), own, self.denominator)


def theta_polynomial(objective: FullObjective, x: Floats) -> Polynomial:
    """Θ(x + y) of an objective with one axis, as an exact polynomial in y.

    Parameters
    ----------
    objective : FullObjective
        Θ in reduced gains (``dim=1``).
    x : ndarray, shape (u,)
        The centre: gains in the order of ``objective.seen``.

    Returns
    -------
    Polynomial
        Of degree four, or two where γ₁ = 0.
    """
    m, N, first = objective.limited, objective.size, objective.first
    r = [Fraction(value) for value in objective.R[:, 0].tolist()]
    BP = [[[Fraction(value) for value in row] for row in P.tolist()] for P in objective.BP]
    gamma = [Fraction(value) for value in objective.gamma.tolist()]
    G = _rows(objective, x)
    sign = 1 if first else -1
    weight = [gamma[3]] * m if first else [gamma[1]] * (m - 1) + [gamma[2]]
    S = [[_sum([(r[i], G[i][a]), (sign * BP[0][i][a], {(): Fraction(1)})]) for a in range(N)] for i in range(m)]
    squares: list[tuple[Fraction, Terms]] = []
    if any(weight):
        squares += [(weight[i], S[i][a]) for i in range(m) for a in range(N)]
    for a in range(N):
        for b in range(a, N):
            twice = 1 if a == b else 2
            fixed = -sum((BP[0][i][a] * BP[0][i][b] / r[i] for i in range(m)), Fraction(0))
            quadratic = _sum([*((r[i], _product(G[i][a], G[i][b])) for i in range(m)), (fixed, {(): Fraction(1)})])
            squares.append((twice * gamma[0], quadratic))
            for g, P in zip(gamma[1:3], BP[1:], strict=False):
                across = [(P[i][a] / r[i], S[i][b]) for i in range(m)] + [(P[i][b] / r[i], S[i][a]) for i in range(m)]
                squares.append((twice * g, _sum(across)))
    return _total(objective.unknowns, squares)


def _rows(objective: FullObjective, x: Floats) -> list[list[Terms]]:
    """G, each entry linear in y."""
    G: list[list[Terms]] = [[{} for _ in range(objective.size)] for _ in range(objective.limited)]
    for v, ((i, j), centre) in enumerate(zip(objective.seen.tolist(), x.tolist(), strict=True)):
        entry = {(): Fraction(centre), (v,): Fraction(1)}
        G[i][j] = _sum([(Fraction(1), G[i][j]), (Fraction(1), entry)])
        if i != j:
            G[i][i] = _sum([(Fraction(1), G[i][i]), (Fraction(-1), entry)])
    return G


def _sum(parts: Iterable[tuple[Fraction, Terms]]) -> Terms:
    total: Terms = {}
    for factor, terms in parts:
        if factor:
            for monomial, value in terms.items():
                total[monomial] = total.get(monomial, Fraction(0)) + factor * value
    return total


def _product(p: Terms, q: Terms) -> Terms:
    total: Terms = {}
    for a, s in p.items():
        for b, t in q.items():
            both = tuple(sorted(a + b))
            total[both] = total.get(both, Fraction(0)) + s * t
    return total


def _total(unknowns: int, squares: list[tuple[Fraction, Terms]]) -> Polynomial:
    """Σ weight·square, over one denominator."""
    squares = [(weight, terms) for weight, terms in squares if weight and terms]
    scale = lcm(*(value.denominator for _, terms in squares for value in terms.values()))
    over = lcm(*(weight.denominator for weight, _ in squares))
    total: dict[Monomial, int] = {}
    for weight, terms in squares:
        factor = int(weight * over)
        whole = [(monomial, int(value * scale)) for monomial, value in terms.items() if value]
        for (a, s), (b, t) in combinations_with_replacement(whole, 2):
            both = tuple(sorted(a + b))
            total[both] = total.get(both, 0) + factor * s * t * (1 if a == b else 2)
    return Polynomial(unknowns, total, scale * scale * over)

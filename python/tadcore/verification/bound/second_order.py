"""The second-order relaxation of Θ (Lasserre), around gains that may be its global minimum, and a proof from it.

Θ(x̂ + y) - t is a sum of squares of polynomials of degree two in y exactly where some Gram matrix over 1, the unknowns
and their products is positive semidefinite. Three questions, each asked only where the one before is answered with no:

1. *Is x̂ the minimum?* Then 1 is not needed: the Gram matrices over the unknowns and their products contain one that is
   positive definite, unless Θ has another minimum as low. What the gradient of x̂, zero up to rounding, takes from the
   minimum is at most ¼ g'G⁻¹g; that is ε.
2. *Is it the minimum up to half of a millionth?* With 1, and t that much below Θ(x̂). Another minimum may be as low.
3. *Which is the largest t?* The inverse of the last matrix is that of the moments. Where they are those of one point
   with a lower Θ, the point is given back.

The unknowns decouple: a group of them that shares no monomial with the others is treated by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from tadcore._shared.arrays import Floats
from tadcore.verification.oracle.objective import FullObjective

from .barrier import minimise, shift_of
from .gram import Gram
from .polynomial import Polynomial, theta_polynomial
from .proof import Part, Proof, part_of

TIGHT = 5e-7
"""How far below Θ(x̂) the second question asks, relatively."""
_MARGIN, _DEEP, _ACCURACY, _LEAST = 1e-5, 1e-3, 1e-7, 1e-11


@dataclass
class Relaxed:
    """What the relaxation found.

    Attributes
    ----------
    theta : Fraction
        Θ(x̂), exactly.
    proof : Proof or None
        Checked; None where rounding was in the way.
    point : ndarray or None
        Gains in the order of ``objective.seen`` at the first moments, where question 3 was asked.
    steps : int
        Newton steps of the barrier.
    """

    theta: Fraction
    proof: Proof | None
    point: Floats | None
    steps: int


def relax(
    objective: FullObjective, x: Floats, floor: float, near: Proof | None = None, *, deep: bool = False
) -> Relaxed:
    """Ask the three questions.

    Parameters
    ----------
    objective : FullObjective
        Θ in reduced gains (``dim=1``).
    x : ndarray, shape (u,)
        x̂, in the order of ``objective.seen``.
    floor : float
        What half of a millionth is relative to where Θ(x̂) is smaller.
    near : Proof, optional
        That of a similar Θ of the same network, such as that of the instant before: where to begin.
    deep : bool
        Whether to go on to a Gram matrix far from singular, near which that of a similar Θ will be positive definite.
    """
    raw = theta_polynomial(objective, x)
    polynomial = raw.scaled(exponents := _units(objective, raw))
    groups = polynomial.groups()
    allowed = TIGHT * max(float(polynomial.constant), floor) / max(len(groups), 1)
    starts: Sequence[Part | None] = [None] * len(groups)
    if near is not None and near.polynomial.groups() == groups:
        starts = near.parts
    parts, point, steps = [], np.zeros(len(x)), 0
    moved = False
    for group, start in zip(groups, starts, strict=True):
        one = _Group(polynomial.of(group), allowed, _DEEP if deep else _MARGIN)
        parts.append(one.part(start))
        steps += one.steps
        if one.moments is not None:
            point[group], moved = one.moments, True
    proof = None if None in parts else Proof(polynomial, tuple(part for part in parts if part is not None))
    if proof is not None and not proof.holds():
        proof = None
    return Relaxed(raw.constant, proof, x + point * 2.0 ** np.array(exponents) if moved else None, steps)


def largest_group(objective: FullObjective) -> int:
    """How many unknowns the largest group has that shares no monomial with the others."""
    return max(map(len, theta_polynomial(objective, np.zeros(objective.unknowns)).groups()), default=0)


def _units(objective: FullObjective, raw: Polynomial) -> list[int]:
    """Units of the unknowns in which the squares and the fourth powers of each have like coefficients."""
    length = float(np.linalg.norm(objective.constant))
    found = []
    for v, (i, _) in enumerate(objective.seen.tolist()):
        fourth, square = raw.coefficient((v,) * 4), abs(raw.coefficient((v,) * 2))
        least = 1e-3 * fourth * length / float(objective.R[i, 0])
        found.append(round(0.5 * np.log2(max(square, least, 1e-300) / fourth)) if fourth > 0.0 else 0)
    return found


class _Group:
    """The three questions for one group of unknowns."""

    def __init__(self, p: Polynomial, allowed: float, margin: float) -> None:
        self.p, self.allowed, self.margin = p, allowed, margin
        self.steps = 0
        self.moments: Floats | None = None
        powers = [max(p.coefficient((v,) * 4), abs(p.coefficient((v,) * 2)), 1e-300) for v in range(p.unknowns)]
        self.size = np.array(powers)

    def part(self, start: Part | None) -> Part | None:
        """The strongest part that is found."""
        found = None if start is None else self._centred(start.G[1:, 1:])
        found = found or self._centred(None)
        if found is None:
            found = self._lowered(self.allowed)
        return found or self._largest()

    def _scales(self, gram: Gram, constant: float) -> Floats:
        """D: what each square of the basis is compared with."""
        return np.array([np.sqrt(np.prod(self.size[list(b)]) ** (2 / len(b))) if b else constant for b in gram.basis])

    def _centred(self, start: Floats | None) -> Part | None:
        """Question 1."""
        gram = Gram(self.p)
        D = self._scales(gram, 0.0)
        G = gram.project(np.zeros((len(D),) * 2) if start is None else start)
        s = shift_of(G, D)
        if s >= -_MARGIN:
            reached = minimise(
                gram, G, D, max(1.2 * s, s + 1e-4), below=-self.margin, accuracy=_ACCURACY, enough=-_MARGIN
            )
            self.steps += reached.steps
            G, s = reached.G, shift_of(reached.G, D)
        if s > -_LEAST:
            return None
        half = 0.5 * np.array([self.p.coefficient((v,)) for v in range(self.p.unknowns)] + [0.0] * gram.quadratics)
        try:
            epsilon = 4.0 * float(half @ cho_solve(cho_factor(G + 0.5 * s * np.diag(D)), half))
        except LinAlgError:
            return None
        epsilon = max(epsilon, 1e-18 * self.allowed)
        if epsilon > self.allowed:
            return None
        whole = np.block([[np.array([[epsilon]]), half[None, :]], [half[:, None], G]])
        return part_of(whole, np.append(epsilon, D), -s)

    def _lowered(self, epsilon: float) -> Part | None:
        """Question 2."""
        gram = Gram(self.p, epsilon)
        D = self._scales(gram, epsilon)
        G = gram.project(np.zeros((len(D),) * 2))
        reached = minimise(gram, G, D, 1.2 * shift_of(G, D) + 1e-3, below=-1e-9, accuracy=1e-10)
        self.steps += reached.steps
        return self._checked(reached.G, D)

    def _largest(self) -> Part | None:
        """Question 3."""
        far = float(np.sum(self.size))
        for _ in range(40):  # every t that is low enough has a certificate
            gram = Gram(self.p, far)
            D = self._scales(gram, far)
            G = gram.project(np.zeros((len(D),) * 2))
            reached = minimise(gram, G, D, 1.2 * shift_of(G, D) + 1e-3, below=-1e-4, accuracy=1e-5)
            self.steps += reached.steps
            if reached.status == "reached":
                break
            far *= 4.0
        else:
            return None
        first = np.zeros(len(D))
        first[0] = 1.0
        reached = minimise(gram, reached.G, first, 0.0, below=self.allowed - far, accuracy=0.01 * self.allowed)
        self.steps += reached.steps
        self.moments = reached.W[0, 1 : self.p.unknowns + 1] / reached.W[0, 0]
        G = reached.G + reached.s * np.diag(first)
        return self._checked(G, self._scales(gram, float(G[0, 0])))

    def _checked(self, G: Floats, D: Floats) -> Part | None:
        s = shift_of(G, D)
        return part_of(G, D, -s) if s < 0.0 else None

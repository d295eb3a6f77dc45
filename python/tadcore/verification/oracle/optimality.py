"""Gradient of Θ and the certificate of a global minimum, for all rows of a record at once.

The gains of row k are critical where the gradient of Θ in the unknowns that the network leaves vanishes
(eq:errgradient). Write Θ = γ₁‖X‖² + a convex quadratic, with X = GᵀRG - M. Since ‖X‖² ≥ ‖X*‖² + 2⟨X*, X - X*⟩, a
critical point is a *global* minimum among scalar gains where the form with blocks 4γ₁δ_ij r_i X* + Q_ij is positive
semidefinite on those unknowns; Q is the Hessian of the quadratic part. Its smallest eigenvalue decides. Under the team
criterion the rows that are held at the equilibrium are no unknowns, and the same holds over the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tadcore._shared.arrays import Floats
from tadcore.scenario.model import Scenario

from .criterion import chosen
from .indices import adapted_weights
from .matrices import Matrices

CRITICAL = 1e-9
"""The largest gradient, relative to what cancels in it, of gains that count as critical."""
_CHUNK_BYTES = 64 * 2**20
_MOST_WORK = 2e10
"""Multiplications that the eigenvalues may take: a few seconds."""


@dataclass(frozen=True, eq=False)
class Optimality:
    """What is known of the gains of every row.

    Attributes
    ----------
    gradient : ndarray, shape (rows,)
        Norm of the gradient of Θ, relative to the products that cancel in it; 0 where nobody sees anyone.
    certificate : ndarray, shape (rows,)
        Smallest eigenvalue of the certificate's form, relative to the largest absolute one or to what cancels in the
        form, whichever is larger; 0 where nobody sees anyone, nan where the form is too large to be decomposed in
        reasonable time.
    """

    gradient: Floats
    certificate: Floats


def optimality(sc: Scenario, m: Matrices, values: Floats, adjacency: NDArray[np.bool_], gains: Floats) -> Optimality:
    """Examine gains of shape (rows, m, N) under P of shape (parties, rows, N, N) and networks (rows, m, N)."""
    rows, limited, size = gains.shape
    gradient, certificate = np.zeros(rows), np.zeros(rows)
    networks, which = np.unique(chosen(sc, adjacency).reshape(rows, -1), axis=0, return_inverse=True)
    which = which.reshape(-1)
    work = float(np.sum(networks.sum(axis=1)[which].astype(float) ** 3))
    chunk = max(int(_CHUNK_BYTES // (8 * 4 * (limited * size) ** 2)), 1)
    for network, flat in enumerate(networks):
        basis = _unknowns(flat.reshape(limited, size))
        if not len(basis):
            continue
        members = np.flatnonzero(which == network)
        for first in range(0, len(members), chunk):
            part = members[first : first + chunk]
            slope, scale, form, cancels = _derivatives(sc, m, values[:, part], gains[part])
            slope = slope.reshape(len(part), -1) @ basis.T
            norm = np.linalg.norm(slope, axis=1)
            gradient[part] = np.where(norm > 0.0, norm / np.maximum(scale, 1e-300), 0.0)
            certificate[part] = _lowest(basis @ form @ basis.T, cancels) if work <= _MOST_WORK else np.nan
    return Optimality(gradient, certificate)


def _unknowns(sees: NDArray[np.bool_]) -> Floats:
    """The joint rows that a unit of each unknown makes, shape (unknowns, m · N)."""
    seen = np.argwhere(sees)
    basis = np.zeros((len(seen), *sees.shape))
    for s, (i, j) in enumerate(seen):
        basis[s, i, j] = 1.0
        if i != j:
            basis[s, i, i] -= 1.0  # z_j - z_i
    return basis.reshape(len(seen), sees.size)


def _derivatives(sc: Scenario, m: Matrices, values: Floats, G: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """The gradient in the joint rows and the certificate's form, (rows, mN, mN), each with the size of what cancels."""
    rows, limited, size = G.shape
    first = sc.interaction == "I1"
    gamma = np.array(sc.synthesis_weights)
    r = m.r[:limited, None]
    own = values[0 if first else 1][:, :limited]
    across = [(gamma[p], values[p][:, :limited]) for p in (1, 2)] if first else []
    weight = np.full((limited, 1), gamma[3]) if first else np.repeat(gamma[1:], [limited - 1, 1])[:, None]
    weights = adapted_weights(sc, m, values, G)
    X = weights.dQ[0] if first else -weights.dQ[0]
    norm = np.linalg.norm
    RG = r * G
    slope = 4.0 * gamma[0] * RG @ X + 2.0 * weight * r * weights.S
    team = norm(own, axis=(1, 2)) + norm(RG, axis=(1, 2))
    squares = norm(np.swapaxes(G, 1, 2) @ RG, axis=(1, 2)) + norm(np.swapaxes(own, 1, 2) @ (own / r), axis=(1, 2))
    scale = 4.0 * gamma[0] * norm(RG, axis=(1, 2)) * squares + 2.0 * norm(weight * r) * team
    form = np.zeros((rows, limited, size, limited, size))
    each = np.arange(limited)
    form[:, each, :, each, :] += 4.0 * gamma[0] * r[:, :, None, None] * X
    axes = np.arange(size)
    form[:, each[:, None], axes, each[:, None], axes] += 2.0 * weight * r**2
    for p, (g, BP) in enumerate(across, start=1):
        slope = slope - 4.0 * g * BP @ weights.dQ[p]
        scale = scale + 8.0 * g * norm(BP, axis=(1, 2)) ** 2 * (team + norm(weights.S, axis=(1, 2))) / float(r.min())
        gram = BP @ np.swapaxes(BP, 1, 2)
        form[:, :, axes, :, axes] += 4.0 * g * gram
        form += 4.0 * g * np.einsum("kib,kja->kiajb", BP, BP)
    shape = (rows, limited * size, limited * size)
    return slope, scale, form.reshape(shape), 4.0 * gamma[0] * float(r.max()) * squares


def _lowest(form: Floats, cancels: Floats) -> Floats:
    """The smallest eigenvalue over the largest absolute one or what cancels; nan where the form overflows."""
    found = np.full(len(form), np.nan)
    finite = np.isfinite(form).all(axis=(1, 2))
    spectrum = np.linalg.eigvalsh(form[finite])
    largest = np.maximum(np.abs(spectrum).max(axis=1), cancels[finite])
    found[finite] = np.divide(spectrum[:, 0], largest, out=np.zeros(len(spectrum)), where=largest > 0.0)
    return found

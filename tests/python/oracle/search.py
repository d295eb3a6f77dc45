"""A trust-region Newton method for Theta in reduced gains, real or complex, from a given start.

Both interactions have the shape

    f(G) = g ‖G* R G - M‖² + Σ w_i |G_i - G0_i|² + Σ_p c_p ‖C_p (G - G0) + (·)*‖²,

with G0 the FNE rows, M = G0* R G0, C_p = P_p B_d (I1 only) and * the conjugate transpose. A complex entry a + ib
stands for the 2 x 2 block aI + bJ. The derivative along D is linear in D and in its conjugate; L and A below are
these two parts. The lines run in NumPy; `compile_with_numba` compiles the same lines, for long tables.
"""

import numpy as np


def derivatives(G, r, G0, M, w, C, c, g):
    """Value, gradient (m, N) and the two parts of the second derivative (mN, mN) at G, all of G's type."""
    m, N = G.shape
    D = G - G0
    V = G * r.reshape(m, 1)
    Gh = np.ascontiguousarray(G.conj().T)
    E = Gh @ V - M
    value = g * np.sum(np.abs(E) ** 2) + np.sum(w.reshape(m, 1) * np.abs(D) ** 2)
    grad = 4 * g * (V @ E) + 2 * D * w.reshape(m, 1)
    VV = V @ np.ascontiguousarray(V.conj().T)
    L = np.zeros((m * N, m * N), dtype=G.dtype)
    A = np.zeros((m * N, m * N), dtype=G.dtype)
    eye = np.eye(N)
    ET = np.ascontiguousarray(E.T)
    for k in range(m):
        for i in range(m):
            block = 4 * g * VV[k, i] * eye
            if i == k:
                block = block + 4 * g * r[k] * ET + 2 * w[k] * eye
            L[k * N : (k + 1) * N, i * N : (i + 1) * N] += block
            A[k * N : (k + 1) * N, i * N : (i + 1) * N] += 4 * g * np.outer(V[i], V[k])
    for p in range(len(c)):
        Cp = np.ascontiguousarray(C[p])
        CT = np.ascontiguousarray(Cp.T)
        X = Cp @ D
        X = X + X.conj().T
        value += c[p] * np.sum(np.abs(X) ** 2)
        grad = grad + 4 * c[p] * (CT @ X)
        CC = CT @ Cp
        for k in range(m):
            for i in range(m):
                L[k * N : (k + 1) * N, i * N : (i + 1) * N] += 4 * c[p] * CC[k, i] * eye
                A[k * N : (k + 1) * N, i * N : (i + 1) * N] += 4 * c[p] * np.outer(CT[i], CT[k])
    return value, grad, L, A


def real_model(x, basis, shape, r, G0, M, w, C, c, g):
    G = (basis @ x).reshape(shape)
    value, grad, L, A = derivatives(G, r, G0, M, w, C, c, g)
    bt = np.ascontiguousarray(basis.T)
    return value, bt @ grad.copy().reshape(-1), bt @ (L + A) @ basis


def complex_model(x, basis, shape, r, G0, M, w, C, c, g):
    half = basis.shape[1]
    G = ((basis @ x[:half]) + 1j * (basis @ x[half:])).reshape(shape)
    value, grad, L, A = derivatives(G, r, G0 + 0j, M + 0j, w, C + 0j, c, g)
    bt = np.ascontiguousarray(basis.T)
    flat = grad.copy().reshape(-1)
    gradient = np.concatenate((bt @ np.ascontiguousarray(flat.real), bt @ np.ascontiguousarray(flat.imag)))
    plus, minus = L + A, L - A
    H = np.empty((2 * half, 2 * half))
    H[:half, :half] = bt @ np.ascontiguousarray(plus.real) @ basis
    H[half:, :half] = bt @ np.ascontiguousarray(plus.imag) @ basis
    H[:half, half:] = bt @ np.ascontiguousarray(-minus.imag) @ basis
    H[half:, half:] = bt @ np.ascontiguousarray(minus.real) @ basis
    return value, gradient, H


def model(x, is_complex, basis, shape, r, G0, M, w, C, c, g):
    """Value, gradient and Hessian in the coordinates x (complex: real parts, then imaginary parts)."""
    if is_complex:
        return complex_model(x, basis, shape, r, G0, M, w, C, c, g)
    return real_model(x, basis, shape, r, G0, M, w, C, c, g)


def trust_step(gradient, H, radius):
    """Minimise the quadratic model within a ball, by the eigenvalues of H."""
    lam, U = np.linalg.eigh((H + H.T) / 2)
    gt = np.ascontiguousarray(U.T) @ gradient
    if lam[0] > 0:
        p = -gt / lam
        if np.sqrt(np.sum(p * p)) <= radius:
            return U @ p, lam[0]
    scale = max(abs(lam[0]), abs(lam[-1]), 1e-300)
    low = max(0.0, -lam[0]) + 1e-14 * scale
    p = -gt / (lam + low)
    if np.sqrt(np.sum(p * p)) < radius:  # the hard case: the gradient has no part along the lowest eigenvector
        p[0] += np.sqrt(radius**2 - np.sum(p * p)) * (1.0 if p[0] >= 0 else -1.0)
        return U @ p, lam[0]
    high = low + np.sqrt(np.sum(gt * gt)) / radius + scale
    for _ in range(100):
        mid = 0.5 * (low + high)
        p = -gt / (lam + mid)
        size = np.sqrt(np.sum(p * p))
        if abs(size - radius) < 1e-3 * radius:
            break
        if size > radius:
            low = mid
        else:
            high = mid
    return U @ p, lam[0]


def minimise(x, is_complex, radius, largest, rounds, basis, shape, r, G0, M, w, C, c, g):
    """Return (x, value, gradient norm, lowest eigenvalue of the Hessian, iterations)."""
    value, gradient, H = model(x, is_complex, basis, shape, r, G0, M, w, C, c, g)
    norm = np.sqrt(np.sum(gradient * gradient))
    lowest, stalled, count = 0.0, 0, 0
    while count < rounds:
        count += 1
        p, lowest = trust_step(gradient, H, radius)
        size = np.sqrt(np.sum(p * p))
        promised = -(gradient @ p) - 0.5 * (p @ (H @ p))
        new_value, new_gradient, new_H = model(x + p, is_complex, basis, shape, r, G0, M, w, C, c, g)
        new_norm = np.sqrt(np.sum(new_gradient * new_gradient))
        fine = promised <= 1e-12 * abs(value)  # beyond what the value can resolve: go by the gradient
        accept = new_norm < norm and lowest > 0 if fine else value - new_value > 0.1 * promised
        if accept:
            good = fine or value - new_value > 0.5 * promised
            if good and size > 0.8 * radius:
                radius = min(2 * radius, largest)
            stalled = stalled + 1 if fine and new_norm > 0.5 * norm else 0
            x, value, gradient, H, norm = x + p, new_value, new_gradient, new_H, new_norm
        elif fine and lowest > 0:
            break
        else:
            radius = 0.25 * min(radius, size)
            stalled = stalled + 1 if fine else stalled
        if norm == 0.0 or stalled >= 2 or radius < 1e-15:
            break
    return x, value, norm, lowest, count


def compile_with_numba():
    """Replace the functions of this module by their compiled form (half a minute the first time)."""
    from numba import njit

    for function in (derivatives, real_model, complex_model, model, trust_step, minimise):
        globals()[function.__name__] = njit(cache=True)(function)

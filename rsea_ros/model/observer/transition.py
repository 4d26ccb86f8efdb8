"""Exact transitions over any time, compiled: Taylor's series over a short part of it, then doubling.

    e^{2At} = (e^{At})^2,   Q(2t) = Q(t) + e^{At} Q(t) e^{A't},   Q(t) = int_0^t e^{As} W e^{A's} ds

Unlike an exponential of [[-A, W], [0, A']] it cannot overflow where modes die within t. Matrices come
balanced (scipy.linalg.matrix_balance) with their scale: A = T A_b T^-1, T = diag(scale).
Source: Moler, Van Loan, SIAM Review 45, 2003, method 3; Anderson, Moore, Optimal Filtering, 1979, sec. 6.7.
"""

import numpy as np

from rsea_ros.compiler import njit

SMALL, TERMS = 0.25, 10
"""Norm of A t at which the series is cut after so many terms: 0.25^11 / 11! = 6e-15."""


@njit(cache=True, nogil=True, error_model="numpy")
def product(a, b, out):  # type: ignore[no-untyped-def]
    """Put a b into out, all shape (n, n); BLAS takes longer to call for matrices as small as these."""
    n = len(a)
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.0
        for k in range(n):
            factor = a[i, k]
            if factor != 0.0:
                for j in range(n):
                    out[i, j] += factor * b[k, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _scale(a, factor, out):  # type: ignore[no-untyped-def]
    for i in range(len(a)):
        for j in range(len(a)):
            out[i, j] = factor * a[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _copy(a, out):  # type: ignore[no-untyped-def]
    _scale(a, 1.0, out)


@njit(cache=True, nogil=True, error_model="numpy")
def _add(a, out):  # type: ignore[no-untyped-def]
    for i in range(len(a)):
        for j in range(len(a)):
            out[i, j] += a[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _transpose(a, out):  # type: ignore[no-untyped-def]
    for i in range(len(a)):
        for j in range(len(a)):
            out[j, i] = a[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _halvings(a, t):  # type: ignore[no-untyped-def]
    """Return how often t must be halved until the series is short enough."""
    norm = 0.0
    for i in range(len(a)):
        row = 0.0
        for j in range(len(a)):
            row += abs(a[i, j])
        norm = max(norm, row)
    return max(0, int(np.ceil(np.log2(max(norm * t / SMALL, 1e-300)))))


@njit(cache=True, nogil=True, error_model="numpy")
def exponential(a, scale, t, out):  # type: ignore[no-untyped-def]
    """Put e^{At} into out, shape (n, n), for a balanced a."""
    n, halvings = len(a), _halvings(a, t)
    part, term, spare = t / 2.0**halvings, np.eye(n), np.eye(n)
    _copy(term, out)
    for k in range(TERMS):
        product(a, term, spare)
        _scale(spare, part / (k + 1), term)
        _add(term, out)
    for _ in range(halvings):
        product(out, out, spare)
        _copy(spare, out)
    for i in range(n):
        for j in range(n):
            out[i, j] *= scale[i] / scale[j]


@njit(cache=True, nogil=True, error_model="numpy")
def transition(a, walk, scale, t, f, q):  # type: ignore[no-untyped-def]
    """Put e^{At} into f and Q(t) into q, shape (n, n); a and walk (W) are balanced."""
    n, halvings = len(a), _halvings(a, t)
    part, term, spare, turned = t / 2.0**halvings, np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    exponential(a, np.ones(n), part, f)
    _scale(walk, part, term)
    _copy(term, q)
    for k in range(TERMS):
        product(a, term, spare)
        _transpose(spare, turned)
        _add(turned, spare)
        _scale(spare, part / (k + 2), term)
        _add(term, q)
    for _ in range(halvings):
        product(f, q, spare)
        _transpose(f, turned)
        product(spare, turned, term)
        _add(term, q)
        product(f, f, spare)
        _copy(spare, f)
    for i in range(n):
        for j in range(n):
            f[i, j] *= scale[i] / scale[j]
            q[i, j] *= scale[i] * scale[j]

"""Lengths for which a Fourier transform is fast: products of small primes.

scipy.fft has the same function, but imports for 0.15 s at every start; numpy.fft transforms alike.
"""

from __future__ import annotations

_COMPLEX, _REAL = (2, 3, 5, 7, 11), (2, 3, 5)


def next_fast_length(least: int, *, real: bool = False) -> int:
    """Return the least fast length that is not below `least`, 1 or more. real: of a real signal."""
    length = max(1, least)
    while not _is_product_of(length, _REAL if real else _COMPLEX):
        length += 1
    return length


def _is_product_of(number: int, primes: tuple[int, ...]) -> bool:
    for prime in primes:
        while number % prime == 0:
            number //= prime
    return number == 1

"""The response of a channel to its prediction is scipy's, in bands; what is unrelated is known by chance."""

from itertools import pairwise

import numpy as np
import pytest
from scipy import signal

from rsea_ros.checks.expected import Quotient, quotient, usable
from rsea_ros.records.record import FloatArray

RATE, LENGTH = 100.0, 800
"""Hz; samples of a segment: 8 s, where the record has more than five such."""


def pair(count: int = 6000, noise: float = 0.3) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stamps, a prediction, and what a first order makes of it, with noise."""
    rng = np.random.default_rng(1)
    p = signal.lfilter([0.2], [1.0, -0.8], rng.standard_normal(count))
    y = 1.7 * np.roll(p, 1) + noise * rng.standard_normal(count)
    return np.arange(count) / RATE, y, p


def spectra(y: FloatArray, p: FloatArray, length: int) -> tuple[FloatArray, ...]:
    """Return frequencies and the spectra pp, yy, py of scipy, but for two lines and the last tenth."""
    inside = slice(2, int(0.9 * (length // 2 + 1)))
    of = {"fs": RATE, "nperseg": length, "noverlap": length // 2, "detrend": "constant"}
    hz, *found = signal.csd(p, p, **of), signal.csd(y, y, **of)[1], signal.csd(p, y, **of)[1]
    return hz[0][inside], *(np.asarray(v)[inside] for v in (hz[1], *found))


@pytest.mark.parametrize(("count", "length"), [(6000, LENGTH), (2000, 400)])
def test_a_quotient_is_that_of_scipys_spectra_in_bands(count: int, length: int) -> None:
    t, y, p = pair(count)
    hz, pp, yy, py = spectra(y, p, length)
    q = quotient("ft", t, y, p)
    assert q is not None and q.channel == "ft"
    edges = [int(e) for e in np.unique(np.floor(np.geomspace(1, len(hz) + 1, 49)))]
    rows = [slice(a - 1, b - 1) for a, b in pairwise(edges)]
    summed = [np.array([v[row].sum() for row in rows]) for v in (pp.real, yy.real, py)]
    coherence = np.abs(summed[2]) ** 2 / (summed[0] * summed[1])
    np.testing.assert_allclose(q.frequency, [hz[row].mean() for row in rows], rtol=1e-9)
    np.testing.assert_allclose(q.value, summed[2] / summed[0], rtol=1e-9)
    np.testing.assert_allclose(q.coherence, coherence, rtol=1e-9)
    share = pp.real / pp.real.sum()
    np.testing.assert_allclose(q.weight, [share[row].sum() for row in rows], rtol=1e-9)
    assert q.lines == pytest.approx(1.0 / np.sum(share**2))
    assert q.related == pytest.approx(np.sum(share * np.abs(py) ** 2 / (pp.real * yy.real)))
    assert (q.measured, q.predicted) == pytest.approx((np.std(y), np.std(p)))
    windows = len(t) // (length // 2) - 1
    assert q.segments == pytest.approx(windows / (1.0 + 2.0 / 36.0))
    widths = np.array([row.stop - row.start for row in rows])
    doubt = np.sqrt((1.0 - coherence) / (2.0 * coherence * q.segments * widths))
    np.testing.assert_allclose(q.sd, doubt, rtol=1e-9)
    assert 0.9 < q.captured / (pp.real.sum() * RATE / length / np.var(p)) < 1.3
    assert usable(q).tolist() == ((coherence > 0.3) & (q.weight > 1e-7 * q.weight.max())).tolist()


def test_a_slow_prediction_has_longer_segments() -> None:
    t = np.arange(6000) / RATE
    p = np.sin(2.0 * np.pi * t / 8.0)
    q = quotient("position", t, 3.0 * p, p)
    assert q is not None and q.segments == pytest.approx(9 / (1.0 + 2.0 / 36.0))
    assert q.captured > 0.5 and abs(q.value[np.argmax(q.weight)]) == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize(
    ("count", "scale", "is_none"),
    [(63, 1.0, True), (79, 1.0, True), (81, 1.0, False), (200, 0.0, True), (200, np.nan, True)],
)
def test_too_little_has_no_quotient(count: int, scale: float, is_none: bool) -> None:
    t, y, p = pair(count)
    assert (quotient("", t, y, scale * p) is None) == is_none
    assert quotient("", t, 0.0 * y, p) is None


def test_what_noise_has_in_common_by_chance_is_no_relation() -> None:
    """Noise passes the limit in 1 of 1000 records where one line bears all."""
    t, y, p = pair()
    noise = np.random.default_rng(5).standard_normal(len(t))
    for measured, said in ((noise, True), (y, False)):
        q = quotient("", t, measured, p)
        assert q is not None and q.is_unrelated == said
    at, single = np.zeros(1), 1.0 - 1e-3 ** (1.0 / 7.0)
    for lines, limit in ((1.0, single), (4.0, 0.125 + (single - 0.125) / 2.0)):
        for side, captured, said in ((-1e-6, 0.31, True), (1e-6, 0.31, False), (-0.1, 0.3, False)):
            q = Quotient("", at, at, at, at, at, 8.0, lines, limit + side, 1.0, 1.0, captured)
            assert q.is_unrelated == said

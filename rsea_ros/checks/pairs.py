"""Consistency among the channels of a record, before any rig is believed: pairs, in windows of seconds.

Two channels of one machine are tied by a law y = P(s) x, late by a lag; the rig states its structure alone:

    velocity = s position      motor_torque = command      ft = (K + c s) deflection
    output held:  deflection = position     ft = (K + c s) position     torque = (K + b s + J s^2) position
                  torque = (1 + b/K s + J/K s^2) ft            torque = (K/s + b + J s) velocity
    without a spring:  torque = (G + b s + J s^2) position
    otherwise:    torque = (b s + J s^2) position + ft, which may be late, turned or in another unit
                  torque ~ ft in lag and sign, unless something else moves the output

The coefficients are fitted to the measured response over its coherent lines, for each lag within 2 s, with no
value of the rig. Where the windows agree, the pair has one part; elsewhere one for each span that does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import blake2b
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np

from rsea_ros.checks.expected import Quotient, even, quotient, related, usable
from rsea_ros.errors import RseaError
from rsea_ros.model.equations import Mechanics, gear_inertia, mechanics
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Channel, ComplexArray, FloatArray, Record
from rsea_ros.records.stamps import recorder_pauses
from rsea_ros.records.statistics import running_integral

REACH = 2.0
"""s, either way: lags that are looked for."""
NEAR = 0.05
"""s. A shorter lag may be that of a drive, a filter or a mode: a fit finds it."""
_WINDOWS, _SHORTEST = 8, 2.0
"""Windows of a record, of so many seconds at least."""
_FINEST, _SLOW = 400.0, 40.0
"""Hz. What is faster says nothing more of a lag of NEAR; what is slower survives a lag that changes."""
_RELATED = 0.5
"""Coherence by power from which a lag and a factor are those of a law."""
_FITS = 0.35
"""Median of what the law leaves of the response, over the response."""
_LEAVES = 0.2
"""Median of what a law with two torques leaves, over the first: friction and play leave less."""
_BEGINS = (0.0, 0.2, -0.2, 0.4, -0.4)
"""s. Lags about which that of a second torque is looked for, beside the one at which both correlate best."""
_MODEL_ERROR = 0.1
"""Of the response: what friction and play leave of a linear law."""
_COVERED = 0.5
"""Of a record, that windows must cover which are sure, to speak for it part by part."""
_STEPS, _MOST_STEPS, _SMOOTH = (0.5, 1.0, 2.0), 60, 0.6
"""s; steps of a record; share of them that must follow each other."""
_GRID, _MOST_SAMPLES, _BESIDE = 5e-3, 4000, 0.7
"""s; samples of a correlation; and of the best one, what every other lag must stay below."""
_AS_GOOD = 0.9
"""Of the best correlation: a lag near zero that reaches so much is the one."""
_RIVAL = 12.0
"""By how much the cost of every other lag must be above the best one, e^6 in likelihood."""
_AROUND = 0.1
"""s about the best lag that belong to its minimum."""
_FEWEST_LINES = 6
_SAME_FACTOR = 0.35
"""Logarithm, for each coefficient, within which windows share a factor: friction and play move it less."""
_ENOUGH = 0.6
"""Of a span, that both channels must cover."""
_SLOWEST, _MATCHED = 20.0, 16
"""Hz, below which a channel is compared sample by sample with a faster one; samples that this takes."""
_TORQUES = ("motor_torque", "command")
_ROTOR = ("rotor.reflected_damping", "rotor.reflected_inertia")


@dataclass(frozen=True)
class Law:
    """y = sum_k c_k s^power_k x. expected: c_k by the rig, 0 where it states none. names: of the rig's values
    that they are, empty for a pure number. less: a channel that is taken off y first, by its own pair."""

    y: str
    x: str
    powers: tuple[int, ...]
    expected: tuple[float, ...]
    names: tuple[str, ...]
    less: str = ""

    @property
    def inverted(self) -> bool:
        """Whether the response is measured from y to x: a torque, as the cause, has no sensor's noise."""
        return self.y in _TORQUES and self.x not in _TORQUES


@dataclass(frozen=True)
class Pair:
    """What two channels say of each other from `start` to `stop`, s.

    factor: the first coefficient that is sure, over the expected one (of `y` per `x` where none is expected),
    nan where none is. sign: of it. lag: s, of y behind x. coherence: 0 to 1, by power. ratios, sds: of every
    coefficient over the expected one, and one sigma of its logarithm. left: median of what the law leaves of
    the response, over the response. fits: the law describes it. clear: no other lag does as well. unrelated:
    the two have no more in common than noise has by chance.
    """

    law: Law
    start: float
    stop: float
    factor: float = math.nan
    sign: int = 0
    lag: float = math.nan
    coherence: float = 0.0
    ratios: tuple[float, ...] = ()
    sds: tuple[float, ...] = ()
    left: float = math.inf
    fits: bool = False
    clear: bool = False
    unrelated: bool = False


def predicted(record: Record, pair: Pair, name: str) -> FloatArray | None:
    """Return a channel that a law gives from the others at its stamps, shape (n,).

    None for another channel, one that is absent, and a law that integrates. Coefficients that the pair
    leaves open are those of the rig.
    """
    law = pair.law
    used = {law.x, law.y, law.less or law.y}
    if name not in (law.y, law.less) or law.powers[0] < 0 or not used <= record.channels.keys():
        return None
    ratios = pair.ratios or (1.0,) * len(law.powers)
    x, given = record[law.x], np.zeros(len(record[law.x]))
    for power, stated, ratio in zip(law.powers, law.expected, ratios, strict=True):
        values = x.y
        for _ in range(power):
            values = np.gradient(values, x.t)
        given += stated * (ratio if math.isfinite(ratio) else 1.0) * values
    t, y = record[name].t, record[law.y]
    at = np.interp(t, x.t, given)
    return at if name == law.y else np.interp(t, y.t, y.y) - at


def is_held(rig: Rig) -> bool:
    """Return whether the output is held behind the spring, so that position, deflection and F/T are one."""
    try:
        one = mechanics(rig, linear_gravity=True).order == 1
    except (RseaError, ValueError):
        return False
    return one and not rig.rigid_spring and rig.ft_end == "spring_end" and rig.motion != "measured"


def laws(record: Record, rig: Rig) -> tuple[Law, ...]:
    """Return the laws between the channels of a record, by the structure of the rig."""
    try:
        m = mechanics(rig, linear_gravity=True)
    except (RseaError, ValueError):
        return ()
    spring = "" if rig.rigid_spring else "spring.stiffness"
    k = 0.0 if rig.rigid_spring else rig["spring.stiffness"]
    held = is_held(rig)
    possible = [
        Law("velocity", "position", (1,), (1.0,), ("",)),
        Law("motor_torque", "command", (0,), (1.0,), ("",)),
    ]
    if not rig.rigid_spring and rig.ft_end == "spring_end":
        possible += [Law("ft", "deflection", (0, 1), (k, 0.0), (spring, ""))]
    if held:
        possible += [
            Law("deflection", "position", (0,), (1.0,), ("",)),
            Law("ft", "position", (0, 1), (k, 0.0), (spring, "")),
            Law("ft", "velocity", (-1, 0), (k, 0.0), (spring, "")),
        ]
    for torque in _TORQUES:
        possible += _of_torque(torque, rig, m, held)
    if "reference" in record or rig.loop is not None:
        possible = [law for law in possible if "command" not in (law.x, law.y)]
    return tuple(law for law in possible if {law.x, law.y, law.less or law.y} <= record.channels.keys())


def _of_torque(torque: str, rig: Rig, m: Mechanics, held: bool) -> list[Law]:
    """Return the laws between a torque and what it moves."""
    if m.order != 1 or rig.motion == "measured":
        stated = (rig["rotor.reflected_damping"], gear_inertia(rig))
        rotor = [Law(torque, "position", (1, 2), stated, _ROTOR, "ft")]
        grounded = "housing_end" in rig.clamped and rig.ft_end == "spring_end"
        driven = [] if rig.motion == "measured" else [Law(torque, "ft", (0,), (0.0,), ("",))]
        return driven + (rotor if grounded else [])
    mass, damping, stiffness = (float(v[0, 0]) for v in (m.mass, m.damping, m.stiffness))
    inertia = "spring_end.inertia" if rig.rigid_spring else "rotor.reflected_inertia"
    names = ("spring.stiffness" if held else "spring_end.stiffness", "rotor.reflected_damping", inertia)
    values = (stiffness, damping, mass)
    found = [
        Law(torque, "position", (0, 1, 2), values, names),
        Law(torque, "velocity", (-1, 0, 1), values, names),
    ]
    if held:
        shares = (1.0, damping / stiffness, mass / stiffness)
        found += [Law(torque, "ft", (0, 1, 2), shares, ("", "", ""))]
        found += [Law(torque, "deflection", (0, 1, 2), values, names)]
    return found


def pairs_of(record: Record, rig: Rig) -> tuple[Pair, ...]:
    """Return what each pair of channels says, a part for each span in which it says the same.

    record: finite values, rising stamps.
    """
    return tuple(each_pair(record, rig))


def each_pair(record: Record, rig: Rig) -> Iterator[Pair]:
    """Yield `pairs_of` law by law, each measured when it is asked for: who needs a few goes no further.

    A verb checks its record twice, before the fit and in it: what the last few asked for is kept.
    """
    asked = laws(record, rig)
    parts = ((n.encode(), c.t.tobytes(), c.y.tobytes()) for n, c in record.channels.items())
    known = repr(rig.filters()).encode() if rig.filters() else b""
    kept = _kept(asked, blake2b(known + b"".join(chain.from_iterable(parts))).digest())
    for law in asked:
        if law not in kept:
            with np.errstate(all="ignore"):
                kept[law] = _between_pauses(_behind_all(record, law, rig), law)
        yield from kept[law]


def _behind_all(record: Record, law: Law, rig: Rig) -> Record:
    """Return the channels of a law, each behind the known filters of the others: their law is the same."""
    names = {law.y, law.x, law.less or law.y}
    behind: dict[str, Channel] = {}
    for other, known in rig.filters().items():
        for n in names - {other} if other in names else ():
            c, t = behind.get(n, record[n]), record[other].t
            y = known.over(np.interp(t, c.t, c.y), float(np.median(np.diff(t))))
            behind[n] = Channel(t, y)
    return record.with_channels(**behind) if behind else record


@lru_cache(maxsize=32)
def _kept(asked: tuple[Law, ...], content: bytes) -> dict[Law, list[Pair]]:
    """Return where the pairs of a record are kept by law, for all its laws and its content."""
    return {}


def _between_pauses(record: Record, law: Law) -> list[Pair]:
    """Return the parts of a law beside each pause of the recorder: one, where they say the same."""
    begin, end = recorder_pauses(record)
    if not len(begin):
        return _parts(record, law)
    spans = zip((-math.inf, *end), (*np.nextafter(begin, math.inf), math.inf), strict=True)
    recorded = [record.between(a, b) for a, b in spans]
    names = (law.y, law.x, law.less or law.y)
    found = [p for r in recorded if all(len(r[n]) > 1 for n in names) for p in _parts(r, law)]
    if not found or not all(_agree(p, found[0]) for p in found):
        return found
    best = max(found, key=lambda p: (p.fits and p.clear, p.stop - p.start))
    return [replace(best, start=found[0].start, stop=found[-1].stop)]


def _parts(record: Record, law: Law) -> list[Pair]:
    y, x = record[law.y], record[law.x]
    if not law.less:
        return _of_two(y, x, law)
    less = record[law.less]
    y, x = (c.between(less.t[0], np.nextafter(less.t[-1], np.inf)) for c in (y, x))
    start, stop = max(y.t[0], x.t[0]), min(y.t[-1], x.t[-1])
    shared: list[Pair] = []
    if min(len(y), len(x), len(less)) >= 64 and stop - start > _SHORTEST:
        both = Signals(y, less, *map(_thinned, (y, less)))
        shared = _in_parts(lambda a, b: _share(both, x, law, a, b), float(start), float(stop), list)
    if not shared or not all(p.fits and p.clear for p in shared):
        shared = [Pair(law, float(start), float(stop))]
    found = []
    for p in shared:
        span = (p.start, np.nextafter(p.stop, np.inf))
        gains = [(1.0, 0.0), *([(p.ratios[0], p.lag)] if p.fits else [])]
        rests = [Channel(y.t, y.y - g * np.interp(y.t, less.t + lag, less.y)) for g, lag in gains]
        plain, *other = (_of_two(rest.between(*span), x, law) for rest in rests)
        near = p.sign > 0 and abs(p.lag) < 0.5 * NEAR and abs(math.log(p.factor)) < _SAME_FACTOR
        sure = p.fits and (near or not any(q.fits and q.left < 2.0 * p.left for q in plain))
        found += [p, *(plain if near else other[0])] if sure else plain
    return found


def _loose(law: Law) -> Law:
    """Return the law of a torque and the one that is taken off it, of which the lag alone counts."""
    return Law(law.y, law.less, (0,), (0.0,), ("",))


def _of_two(y: Channel, x: Channel, law: Law) -> list[Pair]:
    start, stop = max(y.t[0], x.t[0]), min(y.t[-1], x.t[-1])
    if min(y.rate, x.rate) < min(_SLOWEST, 0.6 * max(y.rate, x.rate)):
        simple = law.powers[-1] < 2 and law.powers[0] >= 0 and y.rate < x.rate
        return [_matched(y, x, Pair(law, float(start), float(stop)))] if simple else []
    if len(y) < 64 or len(x) < 64 or not stop - start > _SHORTEST:
        return []
    both = Signals(y, x, *(_thinned(c) for c in (y, x)))
    return _in_parts(
        lambda a, b: _measure(both, law, a, b), float(start), float(stop),
        lambda: _followed(y, x, law, start, stop),
    )  # fmt: skip


def _in_parts(
    measure: Callable[[float, float], Pair], start: float, stop: float, follow: Callable[[], list[Pair]]
) -> list[Pair]:
    """Return a pair for the whole, s, or one for each span in which windows say the same.

    follow: a lag that changes too fast for windows.
    """
    whole = measure(start, stop)
    number = 0 if whole.unrelated else int(min(_WINDOWS, (stop - start) // _SHORTEST))
    edges = np.linspace(start, stop, number + 1)
    windows = [measure(float(a), float(b)) for a, b in pairwise(edges)]
    sure = [w for w in windows if w.fits and w.clear]
    if whole.fits and whole.clear and all(_agree(w, whole) for w in sure):
        return [whole]
    if sum(w.stop - w.start for w in sure) < _COVERED * (stop - start):
        if whole.fits and whole.clear:
            return [whole]
        sure = follow() or [whole]
    runs: list[list[Pair]] = []
    for w in sure:
        if runs and _agree(runs[-1][-1], w) and _agree(runs[-1][0], w):
            runs[-1].append(w)
        else:
            runs.append([w])
    return [_joined(run, measure) for run in runs]


def _share(both: Signals, x: Channel, law: Law, start: float, stop: float) -> Pair:
    """Return the pair of a torque and the one that is to be taken off it, over a span, s.

    1 = P(i w) x / y + g exp(-i w lag) less / y at each line, with real coefficients of P, and g.
    """
    pair = replace(_measure(both, _loose(law), start, stop), fits=False)
    y, less = both.y, both.x
    fast = max(*(1.0 / c.rate for c in (y, x, less)), 1.0 / _FINEST)
    y = Channel(y.t + 0.5 / y.rate, y.y) if law.y == "command" else y  # it holds
    of_x = _response(y, x, law, (start, stop), fast, 0.0)
    if of_x is None or np.count_nonzero(usable(of_x)) < max(_FEWEST_LINES, len(law.powers) + 3):
        return pair
    keep = usable(of_x)
    w, doubt = 2.0 * np.pi * of_x.frequency[keep], np.hypot(of_x.sd[keep], _MODEL_ERROR)
    near, lags, turned = np.arange(-_AROUND, _AROUND, 1e-3), [], []
    for begin in (*_BEGINS, *([pair.lag] if math.isfinite(pair.lag) else [])):
        of_less = _response(y, Channel(less.t + begin, less.y), law, (start, stop), fast, 0.0)
        if of_less is not None and len(of_less.frequency) == len(of_x.frequency):
            lags.append(begin + near)
            turned.append(np.exp(-1j * np.outer(near, w)) * of_less.value[keep])
    if not lags:
        return pair
    lag, other = np.concatenate(lags), np.concatenate(turned)
    terms = [np.broadcast_to((1j * w) ** p * of_x.value[keep], other.shape) for p in law.powers]
    table = np.stack([other, *terms], axis=2) / doubt[:, None]
    table = np.concatenate([table.real, table.imag], axis=1)
    size = np.linalg.norm(table, axis=1, keepdims=True) + 1e-300
    basis, triangle = np.linalg.qr(table / size)
    target = np.concatenate([1.0 / doubt, np.zeros(len(w))])
    explained = target @ basis
    cost = target @ target - np.sum(explained**2, axis=1)
    k = int(np.argmin(cost))
    inverse = np.linalg.pinv(triangle[k]) / size[k].T
    c = inverse @ explained[k]
    scale = max(1.0, float(cost[k]) / max(2 * len(w) - len(c) - 1, 1))
    sd = np.linalg.norm(inverse, axis=1) * math.sqrt(scale) / (np.abs(c) + 1e-300)
    gain, rest = float(c[0]), 1.0 - c[0] * other[k]
    left = float(np.median(np.abs(rest - sum(v * t[k] for v, t in zip(c[1:], terms, strict=True)))))
    moves = len({np.sign(v) for v, u in zip(c[1:], sd[1:], strict=True) if u < 0.25}) == 1
    moves &= float(np.median(np.abs(rest))) > _LEAVES  # else ft itself would be its law
    apart = np.abs(lag - lag[k]) > 0.5 * NEAR
    return replace(
        pair, law=replace(_loose(law), expected=(1.0,)), lag=float(lag[k]), factor=abs(gain),
        sign=int(np.sign(gain)), coherence=1.0 - left**2, ratios=(gain,), sds=(float(sd[0]),),
        left=left, fits=bool(left < _LEAVES and sd[0] < 0.25 and moves), unrelated=False,
        clear=bool(float(cost[apart].min() - cost[k]) > _RIVAL * scale),
    )  # fmt: skip


def _matched(y: Channel, x: Channel, pair: Pair) -> Pair:
    """Return the pair of a channel whose samples are further apart than the lags that are looked for."""
    reach = min(REACH, 0.25 * float(np.ptp(x.t)))
    kept = np.flatnonzero((y.t >= x.t[0] + reach) & (y.t <= x.t[-1] - reach))
    kept = kept[np.linspace(0, len(kept) - 1, min(len(kept), 400)).astype(np.int64)]
    if len(kept) < _MATCHED or not np.ptp(y.y[kept]) > 0.0:
        return pair
    lag = np.arange(-reach, reach, max(1.0 / x.rate, 2.0 * reach / 4000))
    values = np.gradient(x.y, x.t) if pair.law.powers[0] == 1 else x.y
    b = np.interp(y.t[kept] - lag[:, None], x.t, values)
    b, a = b - b.mean(axis=1, keepdims=True), y.y[kept] - y.y[kept].mean()
    power = np.sum(b**2, axis=1) + 1e-300
    alike = (b @ a) ** 2 / (power * float(a @ a))
    k = int(np.argmax(alike))
    rival = float(alike[np.abs(lag - lag[k]) > _AROUND].max(initial=0.0))
    clear = bool(alike[k] > _RELATED and rival < _BESIDE * alike[k])
    factor = float((b[k] @ a) / power[k]) / (pair.law.expected[0] or 1.0)
    return replace(
        pair, factor=abs(factor), sign=int(np.sign(factor)), lag=float(lag[k]), coherence=float(alike[k]),
        ratios=(factor,), sds=(_MODEL_ERROR,), left=1.0 - float(alike[k]), fits=clear, clear=clear,
    )  # fmt: skip


def _followed(y: Channel, x: Channel, law: Law, start: float, stop: float) -> list[Pair]:
    """Return a lag that changes too fast for windows of seconds, followed from one short step to the next."""
    if 0 not in law.powers:
        return []
    for length in _STEPS:
        edges = np.arange(start, stop, max(length, (stop - start) / _MOST_STEPS))
        steps = [_correlated(y, x, Pair(law, float(a), float(b))) for a, b in pairwise(edges)]
        sure = [p for p in steps if p.clear and p.coherence > _RELATED]
        near = (NEAR * (b.start - a.start) / (a.stop - a.start) for a, b in pairwise(sure))
        smooth = sum(abs(b.lag - a.lag) < most for (a, b), most in zip(pairwise(sure), near, strict=True))
        if smooth > _SMOOTH * (len(steps) - 1):
            return sure
    return []


def _joined(run: Sequence[Pair], measure: Callable[[float, float], Pair]) -> Pair:
    """Return one part of windows in a row that agree: measured over all of them, if that is clear."""
    first, last = run[0], run[-1]
    if len(run) == 1:
        return first
    whole = measure(first.start, last.stop)
    middle = sorted(run, key=lambda p: p.lag)[len(run) // 2]
    return whole if whole.fits and whole.clear else replace(middle, start=first.start, stop=last.stop)


def _agree(a: Pair, b: Pair) -> bool:
    """Return whether two parts say the same: sign, lag, and the factor where both are sure of one."""
    if abs(a.lag - b.lag) > 0.5 * NEAR:
        return False
    if not (a.sign and b.sign) or not (a.fits and b.fits):
        return True
    return a.sign == b.sign and abs(math.log(a.factor / b.factor)) < _SAME_FACTOR * len(a.law.powers)


class Signals(NamedTuple):
    """The two channels of a law, as recorded and as slow as SLOW."""

    y: Channel
    x: Channel
    slow_y: Channel
    slow_x: Channel


def _thinned(channel: Channel) -> Channel:
    """Return the channel averaged over periods of the slow rate, itself where it is no faster."""
    if channel.rate <= _SLOW:
        return channel
    t = np.arange(channel.t[0], channel.t[-1], 1.0 / _SLOW)
    return Channel(t, _averaged(channel, t, 1.0 / _SLOW))


def _measure(both: Signals, law: Law, start: float, stop: float) -> Pair:
    """Return the pair over a span, s: of all that both can show, or else of the slow part of it."""
    pair = Pair(law, start, stop)
    y, x, slow_y, slow_x = both
    fast = max(1.0 / y.rate, 1.0 / x.rate, 1.0 / _FINEST)
    slow = max(1.0 / _SLOW, fast)
    q, late = _response(y, x, law, (start, stop), fast, 0.0), 0.0
    if q is None or q.related < _RELATED:
        late = _most_related(slow_y, slow_x, law, (start, stop), slow)
        best = _response(slow_y, slow_x, law, (start, stop), slow, late)
        q = _response(y, x, law, (start, stop), fast, late)
        q = best if best is not None and (q is None or q.related < _RELATED) else q
    if q is None:
        return pair
    pair = replace(pair, coherence=q.related, unrelated=q.is_unrelated)
    keep = usable(q)
    if np.count_nonzero(keep) >= max(_FEWEST_LINES, len(law.powers) + 2):
        pair = _fit(q, keep, law, late, pair)
    return pair if pair.fits or law.powers[-1] == 2 else _correlated(y, x, pair)


def _most_related(y: Channel, x: Channel, law: Law, span: tuple[float, float], period: float) -> float:
    """Return the lag within REACH, s, at which the two have most in common: lags of one span at one go."""
    tried = np.arange(-REACH, REACH + 0.5 * NEAR, NEAR)
    found, spans = np.full(len(tried), -1.0), np.array([_overlap(y, x, span, float(v)) for v in tried])
    for low, high in {*map(tuple, spans[spans[:, 1] > spans[:, 0]])}:
        rows = np.flatnonzero((spans == (low, high)).all(axis=1))
        if len(t := np.arange(low, high, period)) < 2:
            continue
        t, _ = even(t)
        a, b = _averaged(y, t[None], period), _averaged(x, t - tried[rows, None], period)
        found[rows] = related(*((b, a) if law.inverted else (a, b)), period)
    return float(tried[np.argmax(found)]) if found.max() >= 0.0 else 0.0


def _overlap(y: Channel, x: Channel, span: tuple[float, float], late: float) -> tuple[float, float]:
    """Return from when to when, s, both cover a span with x later by `late`; (0, 0) for too little of it."""
    low, high = max(span[0], x.t[0] + late, y.t[0]), min(span[1], x.t[-1] + late, y.t[-1])
    return (low, high) if high - low > _ENOUGH * (span[1] - span[0]) else (0.0, 0.0)


def _response(
    y: Channel, x: Channel, law: Law, span: tuple[float, float], period: float, late: float
) -> Quotient | None:
    """Return the response over a span, s, of y to x, or of x to y, with y taken earlier by `late`, s."""
    low, high = _overlap(y, x, span, late)
    if not high > low:
        return None
    t = np.arange(low, high, period)
    a, b = _averaged(y, t, period), _averaged(x, t - late, period)
    return quotient("", t, *((b, a) if law.inverted else (a, b)))


def _averaged(channel: Channel, t: FloatArray, period: float) -> FloatArray:
    """Return the means of a channel over the periods about some times: what is faster does not fold."""
    if period < 1.5 / channel.rate:
        return np.interp(t, channel.t, channel.y)
    area = running_integral(channel.y, channel.t)
    low, high = (np.clip(t + side * period, channel.t[0], channel.t[-1]) for side in (-0.5, 0.5))
    sums = np.diff([np.interp(v, channel.t, area) for v in (low, high)], axis=0)[0]
    return np.asarray(sums / np.maximum(high - low, 1e-300))


def _correlated(y: Channel, x: Channel, pair: Pair) -> Pair:
    """Return a pair that its law does not describe: the lag and the factor by which they correlate best."""
    period = max(_GRID, (pair.stop - pair.start) / _MOST_SAMPLES)
    t = np.arange(pair.start, pair.stop, period)
    most = int(min(REACH, 0.5 * (x.t[-1] - x.t[0])) / period)
    wide = t[0] + period * np.arange(-most, len(t) + most)
    known = ((wide >= x.t[0]) & (wide <= x.t[-1])).astype(float)
    a, b = np.interp(t, y.t, y.y), np.interp(wide, x.t, x.y)
    b = np.gradient(b, period) if pair.law.powers[0] == 1 else b
    a, b = a - a.mean(), known * (b - b.mean())
    power = np.correlate(b**2, np.ones(len(a)), "valid") + 1e-300
    both = np.correlate(b, a, "valid")
    energy = np.correlate(known, a**2, "valid")
    alike = both**2 / np.maximum(power * energy, 1e-300)
    alike = np.where(np.correlate(known, np.ones(len(a)), "valid") > _ENOUGH * len(a), alike, 0.0)
    lag = period * (most - np.arange(len(both)))
    near = np.where(np.abs(lag) < _AROUND, alike, 0.0)
    k = int(np.argmax(near if near.max() > _AS_GOOD * alike.max() else alike))
    rival = float(alike[np.abs(lag - lag[k]) > _AROUND].max(initial=0.0))
    sensors = pair.law.powers[-1] < 2
    factor = abs(float(both[k] / power[k]) / (pair.law.expected[0] or 1.0)) if sensors else math.nan
    return replace(
        pair, lag=float(lag[k]), factor=factor, sign=int(np.sign(both[k])) if sensors else 0,
        coherence=float(alike[k]), clear=rival < _BESIDE * float(alike[k]),
    )  # fmt: skip


def _fit(q: Quotient, keep: np.ndarray, law: Law, late: float, pair: Pair) -> Pair:
    """Return the pair with the lag and the coefficients that fit its response best."""
    w = 2.0 * np.pi * q.frequency[keep]
    response = q.value[keep] / np.sqrt(q.coherence[keep])  # the noise of x lowers it
    doubt = np.hypot(q.sd[keep], _MODEL_ERROR)
    h = 1.0 / response if law.inverted else response
    span = min(REACH, 0.5 * math.pi * len(w) / float(w.max() - w.min() + 1e-9) + _AROUND)
    step = min(0.25 / float(w.max()), 0.01)
    lag, weight = np.arange(-span, span, step), np.abs(h) * doubt
    rows = np.column_stack([(1j * w) ** p for p in law.powers]) / weight[:, None]
    rows = np.vstack([rows.real, rows.imag])
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    basis, triangle = np.linalg.qr(rows / size)
    explained = _turned_onto(h / weight * (basis[: len(w)] - 1j * basis[len(w) :]).T, w, lag, step)
    cost = np.sum(doubt**-2) - np.sum(explained**2, axis=0)
    k = int(np.argmin(cost))
    apart = np.abs(lag - lag[k]) > _AROUND
    scale = max(1.0, float(cost[k]) / max(2 * len(w) - len(law.powers) - 1, 1))
    clear = not apart.any() or float(cost[apart].min() - cost[k]) > _RIVAL * scale
    inverse = np.linalg.pinv(triangle)
    c = (inverse @ explained[:, k]) / size
    sd = np.linalg.norm(inverse, axis=1) / size * math.sqrt(scale)
    turned = h * np.exp(1j * w * lag[k])
    left = np.abs(turned - sum(v * (1j * w) ** p for v, p in zip(c, law.powers, strict=True)))
    share = float(np.median(left / np.abs(h)))
    fits = share < _FITS and q.related > _RELATED
    relative = sd / np.maximum(np.abs(c), 1e-300)
    ratios = tuple(float(v / e) if e else float(v) for v, e in zip(c, law.expected, strict=True))
    sure = [i for i, r in enumerate(relative) if r < 0.25 and (law.expected[i] or len(c) == 1)]
    factor = ratios[sure[0]] if sure else math.nan
    fits &= len({np.sign(c[i]) for i in sure}) < 2  # no machine has a mass and a negative damping
    return replace(
        pair, factor=abs(factor), sign=int(np.sign(factor)) if sure else 0, lag=late + float(lag[k]),
        ratios=ratios, sds=tuple(relative.tolist()), left=share, fits=bool(fits), clear=bool(clear),
    )  # fmt: skip


def _turned_onto(directions: ComplexArray, w: FloatArray, lag: FloatArray, step: float) -> FloatArray:
    """Return Re sum_n directions_kn exp(i w_n lag), shape (k, lags), for lags (s) a step (s) apart."""
    fine = math.isqrt(len(lag)) + 1
    coarse, beside = (np.exp(1j * np.outer(v, w)) for v in (lag[::fine], step * np.arange(fine)))
    found: FloatArray = ((directions[:, None] * coarse) @ beside.T).real
    return found.reshape(len(directions), -1)[:, : len(lag)]

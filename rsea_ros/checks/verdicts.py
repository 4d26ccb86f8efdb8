"""Which channel is wrong: sign, unit and clock, from what its pairs say of it.

Each law that fits gives one equation in the logarithms of its channels' factors and of the rig's values, and
one in their lags:

    ln |c / c_rig| = g_y - g_x + r,      lag = l_y - l_x

with g and l zero for a sound channel and r that of a value of the rig. The fewest changes that leave every
equation within its doubt are the explanation. It convicts a channel only where two others, which agree with
each other without it, witness against it, and where nothing else explains as much; otherwise the
contradiction itself is the finding. Each span in which the pairs say the same is judged for itself.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from rsea_ros.checks.finding import Finding, Light
from rsea_ros.checks.linearised_rig import Start
from rsea_ros.checks.pairs import NEAR, Pair
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import MEASURED, Channel, FloatArray, Record

_TURN = 2.0 * math.pi
_ANGLES = {"deg": math.degrees(1.0), "mrad": 1e3, "rev": 1.0 / _TURN, "arcmin": 60.0 * math.degrees(1.0)}
_SPEEDS = {"rpm": 60.0 / _TURN, "deg/s": math.degrees(1.0), "rev/s": 1.0 / _TURN}
_TORQUES = {"mN m": 1e3, "N cm": 100.0, "kN m": 1e-3, "lbf in": 8.8507}
_UNITS = {"position": _ANGLES, "deflection": _ANGLES, "velocity": _SPEEDS}
SAME_NUMBER = {"mN m": ("mN m", "N mm")}
"""Units that a factor cannot distinguish."""
_BY_A_CONSTANT = "a current, a voltage or a count"
RIGHT_RIG = "is this the right rig? name another with --rig, or another joint with --joint"
TOGETHER = (("position", "velocity"), ("command", "motor_torque"))
"""Channels of one encoder and of one drive, which share a unit, a sign and a clock."""
Group = Mapping[str, float]
"""Channels that change as one, each by so many times the change."""
AT_MOTOR: Group = {"position": 1.0, "velocity": 1.0, "command": -1.0, "motor_torque": -1.0}
"""By the logarithm of the gear's ratio, where all that a drive reports is on its own side of the gear."""

ALLOWED = 1.1
"""Logarithm of a gain, either way, that a bench may have: a factor of 3, that of a drive at its limit."""
_UNIT, _ALIKE = 0.2, 0.15
"""Logarithm: what a unit leaves of a gain; factors that lie so close cannot be distinguished."""
_TOLERANCE, _OF_DAMPING = 0.15, 0.5
"""Logarithm: what play and friction move a factor; a damping is that of friction of every kind."""
_LEAST_SPREAD = 0.2
"""Of a rig's value: a stated spread is a hope."""
_IN_TIME = 0.012
"""s. What drives, filters and modes move a lag."""
_CHANGE = 25.0
"""Cost that a change must save, twelve in the logarithm of the likelihood."""
_ODD = 15.0
"""Cost of a factor that no unit has, beside the change itself."""
_MOST_CHANGES = 3
_HOLDS = 4.0
"""Sigmas within which an equation holds."""
_FAR, _MOVED, _ELSEWHERE = 4.0, 1.6, 3.0
"""Factor of a rig's value that is another machine's; that is worth a look; and spreads that go with both."""
_SAME_RATE, _FLAT = 0.15, 0.07
"""Logarithm and share left: a factor between two channels that is the same at all frequencies."""
_LINEAR = 0.998
"""Coherence, by power, of a torque in proportion to its command: one that was limited a little has less."""
_WHOLE = 0.9
"""Coherence, by power, of a channel that is only turned or in another unit: a wrapped code has less."""
_MEASURED, _OF_ONE = 0.2, 0.7
"""Share of the response that a law may leave, and coherence, for values of a machine."""
_BEGIN = 5e-3
"""s. A shorter lag may be that of a held command; a fit begins without it."""
_SHORTEST = 0.25
"""s. A span shorter than this is an edge between two."""
_SURE_SPRING = 0.1
"""Logarithm, one sigma, of a stiffness that the rig does not have."""
_GROWS = 0.05
"""s by which a lag must change within a record to be told as one that grows."""


@dataclass(frozen=True)
class Factor:
    """A channel's value over the SI value at the gear output. at_motor: on the motor's side."""

    value: float
    unit: str
    at_motor: bool = False

    @property
    def meaning(self) -> str:
        """Return `rpm at the motor`."""
        unit = " or ".join(SAME_NUMBER.get(self.unit, (self.unit,)))
        return f"{unit} at the motor" if self.at_motor else unit


def factors(channel: str, rig: Rig) -> tuple[Factor, ...]:
    """Return the factors that a channel may have beside 1, the plain units first."""
    units = _UNITS.get(channel, _TORQUES)
    plain = [Factor(v, u) for u, v in units.items()]
    ratio = rig["gear.ratio"]
    if channel not in ("ft", "deflection") and ratio > 1.5:
        si = {"position": "rad", "velocity": "rad/s"}.get(channel, "N m")
        side = ratio if channel in _UNITS else 1.0 / ratio
        plain += [Factor(side, si, True), *(Factor(f.value * side, f.unit, True) for f in list(plain))]
    sensor = rig.sensors.get(channel)
    if sensor is not None and sensor.quantum > 0.0:
        plain.append(Factor(1.0 / sensor.quantum, "counts"))
    return tuple(plain)


class Equation(NamedTuple):
    """value = sum of its terms, within sd. terms: of each channel and of each value of the rig."""

    terms: Mapping[str, float]
    value: float
    sd: float
    pair: Pair

    def left(self, changes: Mapping[str, float]) -> float:
        """Return by how many sigmas it fails with some changes."""
        return (self.value - sum(self.terms.get(n, 0.0) * v for n, v in changes.items())) / self.sd


@dataclass(frozen=True)
class Verdict:
    """What is wrong with a channel or a value of the rig from `start` to `stop`, s.

    kind: `sign`, `scale`, `clock_offset`, `wrong_rig`. value: -1, ln of the factor, s, ln of the factor.
    """

    kind: str
    name: str
    value: float
    start: float
    stop: float


def judged(pairs: Sequence[Pair], rig: Rig) -> tuple[list[Verdict], list[Pair]]:
    """Return who is wrong, span by span, and the pairs of contradictions that convict nobody."""
    verdicts: list[Verdict] = []
    open_pairs: list[Pair] = []
    edges = sorted({v for p in pairs for v in (p.start, p.stop)})
    for start, stop in ((a, b) for a, b in pairwise(edges) if b - a > _SHORTEST):
        within = [p for p in pairs if p.start < stop - 1e-6 and p.stop > start + 1e-6 and p.clear]
        for kind, equations in _kinds(within):
            changes, convicted = _explained(equations, kind, rig)
            ratio = _of_gear(changes) if kind == "scale" else 0.0
            if ratio and abs(ratio - math.log(rig["gear.ratio"])) > _UNIT:
                verdicts.append(Verdict("gear", "gear.ratio", ratio, start, stop))
                continue
            for name, value in changes.items():
                if name in convicted:
                    verdicts.append(Verdict("wrong_rig" if "." in name else kind, name, value, start, stop))
            kept = {n: v for n, v in changes.items() if n in convicted or "." in n}
            open_pairs += [e.pair for e in equations if _is_open(e, kept, kind)]
    return verdicts, list(dict.fromkeys(open_pairs))


def _is_open(e: Equation, kept: Mapping[str, float], kind: str) -> bool:
    """Return whether an equation contradicts what is known, too far for anything but a fault."""
    far = {"sign": 0.5, "scale": ALLOWED, "clock_offset": NEAR}[kind]
    rigless = not any("." in n for n in e.terms) and (e.pair.law.powers[-1] < 2 or e.pair.law.x == "ft")
    return rigless and abs(e.left(kept)) > _HOLDS and abs(e.left(kept) * e.sd) > far


def _kinds(pairs: Sequence[Pair]) -> Iterable[tuple[str, list[Equation]]]:
    """Return the equations of signs, factors and lags."""
    fitting = [p for p in pairs if p.fits]
    yield "clock_offset", [e for p in pairs for e in _lag(p)]
    yield "sign", [e for p in fitting for e in _signs(p)]
    yield "scale", [e for p in fitting for e in _factors(p)]


def _lag(p: Pair) -> list[Equation]:
    """Return the equation of a lag; where a law of motion does not fit, the lag is the motion's."""
    if not p.fits and (p.law.powers[-1] == 2 or not p.law.expected[0] or p.coherence < 0.5):
        return []
    return [Equation({p.law.y: 1.0, p.law.x: -1.0}, p.lag, _IN_TIME, p)]


def _sure(p: Pair) -> list[int]:
    """Return which coefficients of a pair are sure and have a value to be compared with."""
    last = 1 if p.law.y in ("ft", "deflection") or p.law.x == "ft" else len(p.ratios)
    return [k for k in range(last) if p.law.expected[k] and p.sds[k] < 0.25]


def _signs(p: Pair) -> list[Equation]:
    """Return the equation of a sign: 1 for a turned one, of which the changes are a sum modulo 2."""
    ks = _sure(p) or ([0] if p.sds and p.sds[0] < 0.25 and p.law.powers == (0,) else [])
    return [Equation({p.law.y: 1.0, p.law.x: 1.0}, float(p.ratios[k] < 0.0), 0.15, p) for k in ks[:1]]


def _factors(p: Pair) -> Iterator[Equation]:
    for k in _sure(p):
        name = p.law.names[k]
        if name and (p.left > _MEASURED or p.coherence < _OF_ONE):
            continue
        tolerance = _OF_DAMPING if name.endswith("damping") else _TOLERANCE
        terms = {p.law.y: 1.0, p.law.x: -1.0} | ({name: 1.0} if name else {})
        yield Equation(terms, math.log(abs(p.ratios[k])), math.hypot(tolerance, p.sds[k]), p)


def _explained(equations: Sequence[Equation], kind: str, rig: Rig) -> tuple[dict[str, float], set[str]]:
    """Return the changes that explain the equations best, and which of them are beyond doubt."""
    if not any(abs(e.left({})) > _HOLDS for e in equations):
        return {}, set()
    names = sorted({n for e in equations for n in e.terms})
    channels: list[Group] = [{n: 1.0} for n in names if "." not in n]
    channels += [dict.fromkeys(both, 1.0) for both in TOGETHER if all(n in names for n in both)]
    if kind == "scale" and {"ft", "position"} <= {*names}:
        channels.append({n: v for n, v in AT_MOTOR.items() if n in names})
    values: list[Group] = [{n: 1.0} for n in names if "." in n]
    changes, rivals = _fewest(equations, kind, channels, values, rig)
    if _of_gear(changes):
        return changes, {n for n in changes if n in AT_MOTOR}
    if kind == "scale" and (odd := {n for n, v in changes.items() if n in _UNITS and _is_odd(n, v, rig)}):
        channels = [g for g in channels if not odd & g.keys()]  # it is another rig, not another unit
        changes, rivals = _fewest(equations, kind, channels, values, rig)
    least = {"sign": 0.5, "scale": ALLOWED, "clock_offset": NEAR}[kind]
    accused = {n for n, v in changes.items() if "." not in n and abs(v) > least}
    if kind != "clock_offset":
        told = {n: max(e.pair.coherence for e in equations if n in e.terms) for n in accused}
        accused = {n for n in accused if max(told.get(m, 0.0) for m in {n, *_partner(n)}) > _WHOLE}
    convicted = {n for n in accused if all(n in r for r in rivals) and _is_witnessed(n, changes, equations)}
    return changes, convicted | {n for n in changes if "." in n}


def _fewest(
    equations: Sequence[Equation],
    kind: str,
    channels: Sequence[Group],
    values: Sequence[Group],
    rig: Rig,
) -> tuple[dict[str, float], list[set[str]]]:
    """Return the sizes of the fewest changes that explain the equations, and the names of all as good."""
    tried = []
    for number in range(_MOST_CHANGES + 1):
        for chosen in combinations([*channels, *values], number):
            changed = {n for group in chosen for n in group}
            if len(changed) == sum(map(len, chosen)):
                cost, sizes = _cost(equations, chosen, kind, values, rig)
                odd = [sum(_is_odd(n, sizes[n], rig) for n in g) for g in chosen if kind == "scale"]
                cost += _ODD * sum(min(k, 2) for k in odd)  # a unit is likelier than a factor that none has
                tried.append((cost, sizes, changed))
    cost, changes, _ = min(tried, key=lambda one: one[0])
    return changes, [changed for v, _, changed in tried if v < cost + 0.5 * _CHANGE]


def _of_gear(changes: Mapping[str, float]) -> float:
    """Return the logarithm of a ratio by which all of a drive's channels are off, 0 where they are not."""
    off = [changes[n] * by for n, by in AT_MOTOR.items() if n in changes]
    return off[0] if "position" in changes and len(off) > 2 and np.ptp(off) < 1e-9 else 0.0


def _is_odd(name: str, gain: float, rig: Rig) -> bool:
    """Return whether a change of a channel is that of no unit: a value of the rig may imitate it."""
    if "." in name or abs(gain) < ALLOWED:
        return False
    return min(abs(math.log(f.value) - gain) for f in factors(name, rig)) > _UNIT


def _spread(rig: Rig, name: str) -> float:
    """Return the stated spread of a value; of an inertia the rig's largest, for its parts move as one."""
    of = [n for n in rig.free() if n == name or (name.endswith("inertia") and n.endswith("inertia"))]
    return max((rig.spread(n) for n in of), default=0.0)


def _cost(
    equations: Sequence[Equation],
    chosen: Sequence[Group],
    kind: str,
    values: Sequence[Group],
    rig: Rig,
) -> tuple[float, dict[str, float]]:
    """Return the cost of some changes, and all sizes. values: of the rig, which move by their spread."""
    if kind == "sign":
        turned = {n for group in chosen for n in group}
        wrong = sum((sum(n in turned for n in e.terms) + e.value) % 2.0 for e in equations)
        return 1.5 * _CHANGE * wrong + _CHANGE * len(chosen), dict.fromkeys(turned, 1.0)
    groups = [*chosen, *(v for v in values if v not in chosen)]
    rows = [[sum(e.terms.get(n, 0.0) * v for n, v in g.items()) / e.sd for g in groups] for e in equations]
    right = [e.value / e.sd for e in equations]
    for k, group in enumerate(groups[len(chosen) :], len(chosen)):
        spread = max(_spread(rig, *group), _LEAST_SPREAD)
        rows.append([float(i == k) / spread for i in range(len(groups))])
        right.append(0.0)
    if not groups:
        return float(np.sum(np.square(right))), {}
    matrix: FloatArray = np.array(rows)
    size = np.linalg.lstsq(matrix, np.array(right), rcond=None)[0]
    left = np.array(right) - matrix @ size
    changes = {n: float(v) * by for g, v in zip(groups, size, strict=True) for n, by in g.items()}
    return float(np.sum(np.minimum(left**2, 4.0 * _CHANGE))) + _CHANGE * len(chosen), changes


def _partner(name: str) -> set[str]:
    """Return the channels of the same encoder or drive, itself with them; none for another."""
    return {n for both in TOGETHER if name in both for n in both}


def _is_witnessed(name: str, changes: Mapping[str, float], equations: Sequence[Equation]) -> bool:
    """Return whether two channels that agree with each other without it both know a channel."""
    sound = {n for e in equations for n in e.terms if "." not in n and n not in changes}
    agree = [set(e.terms) & sound for e in equations if abs(e.left(changes)) < _HOLDS]
    linked = {n for pair in agree if len(pair) == 2 for n in pair}
    knows = {n for e in equations if name in e.terms for n in e.terms if n != name}
    partner = _partner(name)
    knows |= {n for e in equations if partner & set(e.terms) for n in e.terms if n not in partner}
    return bool(linked & knows)


def verdict_findings(pairs: Sequence[Pair], rig: Rig, axis: str) -> tuple[list[Finding], dict[str, float]]:
    """Return the findings of the pairs, and the lags (s) by which channels are late in the whole record.

    axis: of the wrench now.
    """
    verdicts, contradictions = judged(pairs, rig)
    findings: list[Finding] = []
    late: dict[str, float] = {}
    for kind, name in dict.fromkeys((v.kind, v.name) for v in verdicts):
        of = [v for v in verdicts if (v.kind, v.name) == (kind, name)]
        about = [p for p in pairs if kind == "gear" or name in (p.law.x, p.law.y, *p.law.names)]
        where = _where(of, (min(p.start for p in about), max(p.stop for p in about)))
        if kind == "clock_offset":
            findings.append(_late(of, where))
            late |= {} if where else {name: float(np.median([v.value for v in of]))}
        elif kind == "sign":
            findings.append(_turned(name, axis, where))
        elif kind == "gear":
            findings.append(_geared(float(np.median([v.value for v in of])), rig))
        elif kind == "scale":
            findings.append(_scale(name, float(np.median([v.value for v in of])), rig, where))
        elif not where:
            stated = {n: e for p in about for n, e in zip(p.law.names, p.law.expected, strict=True)}
            findings += _of_rig(name, stated[name], float(np.median([v.value for v in of])), rig)
    named = {f.channel for f in findings}
    findings += [f for f in _springs(pairs) if f.channel not in named]
    few, faster = "not determined: its samples are too few to show it", "record it faster"
    untimed = [p.law.y for p in pairs if math.isnan(p.lag) and not p.coherence]
    findings += [Finding("green", "clock_offset", y, detail=few, remedy=faster) for y in untimed]
    findings += [_contradiction(p) for p in contradictions if not {p.law.x, p.law.y} & named]
    tied = {(p.law.y, p.law.x) for p in pairs if p.fits and p.law.expected[0]}
    apart = [p for p in pairs if _is_apart(p) and (p.law.expected[0] or (p.law.y, p.law.x) not in tied)]
    shown = [p for p in pairs if (_is_off(p) or p in apart) and p not in contradictions]
    findings += [_contradiction(p) for p in shown if not {p.law.x, p.law.y} & named]
    return findings, late


def _where(verdicts: Sequence[Verdict], whole: tuple[float, float]) -> str:
    """Return from when to when they hold, empty for the whole record."""
    start, stop = min(v.start for v in verdicts), max(v.stop for v in verdicts)
    edge = max(4.0 * NEAR, 0.03 * (whole[1] - whole[0]))
    return "" if start - whole[0] < edge and whole[1] - stop < edge else f"from {start:.4g} s to {stop:.4g} s"


def _late(of: Sequence[Verdict], where: str) -> Finding:
    name, lags = of[0].name, [v.value for v in of]
    late = float(np.median(lags))
    grows = max(lags) - min(lags) > _GROWS
    size = f"{abs(late):.3g} s {'late' if late > 0.0 else 'early'}"
    if grows:
        size = f"{lags[0]:.3g} s late at {of[0].start:.4g} s, {lags[-1]:.3g} s at {of[-1].stop:.4g} s,"
        where = "growing between"
    against = "all that was measured" if name == "command" else "the others, which agree"
    remedy = f"stamp all by one clock, or move these stamps with --shift {name}={-late:.4g}"
    if grows or where:
        remedy = "read the sensor until its buffer is empty, and stamp at acquisition"
    return Finding(
        "red", "clock_offset", name, late, "s", expected="0",
        detail=", ".join(filter(None, (f"stamped {size.rstrip(',')} against {against}", where))),
        remedy=remedy,
    )  # fmt: skip


def _turned(name: str, axis: str, where: str) -> Finding:
    remedy = f"`sign: -1` for {name} in the import map, or turn it where it is published"
    if name == "ft":
        remedy = f"--axis {axis.removeprefix('-') if axis.startswith('-') else f'-{axis}'}"
    detail = " ".join(filter(None, ("turned against the others, which agree", where)))
    return Finding("red", "sign", name, -1.0, "1", expected="1", detail=detail, remedy=remedy)


def _scale(name: str, gain: float, rig: Rig, where: str) -> Finding:
    """Return the finding of a channel in another unit; its factor, or the measured one where that is off."""
    known = sorted(factors(name, rig), key=lambda f: abs(math.log(f.value) - gain))
    best, measured = known[0], math.exp(gain)
    meanings = " or ".join(f.meaning for f in known if abs(math.log(f.value / best.value)) < _ALIKE)
    if abs(gain - math.log(best.value)) < _UNIT:
        value, detail, remedy = best.value, f"looks like {meanings}", _unit(name, best)
    else:
        value, detail = measured, f"times SI; {meanings} would be {best.value:.3g}: no unit explains it all"
        remedy = f"`scale: {1.0 / measured:.3g}` for {name} in the import map, if it is {_BY_A_CONSTANT}"
    expected = "1, SI at the gear output"
    detail = " ".join(filter(None, (detail, where)))
    return Finding("red", "scale", name, value, "1", expected=expected, detail=detail, remedy=remedy)


def _geared(ratio: float, rig: Rig) -> Finding:
    """Return the finding of a drive whose channels are all on its own side of a gear that the rig lacks."""
    off = math.exp(ratio)
    return Finding(
        "amber", "wrong_rig", "gear.ratio", off, "1", expected=f"{rig['gear.ratio']:.4g}",
        detail=f"angles are {off:.3g} times and torques 1/{off:.3g} of what ft and the rig make them: "
        "the drive's own side of a gear of about this ratio",
        remedy=f"`scale: {1.0 / off:.3g}` for angles and `scale: {off:.3g}` for torques in the import map, "
        "or publish SI at the gear output",
    )  # fmt: skip


def _unit(channel: str, factor: Factor) -> str:
    if factor.at_motor or factor.unit in ("counts", "N cm", "lbf in"):
        scale = f"`scale: {1.0 / factor.value:.6g}`"
        return f"{scale} for {channel} in the import map, or publish SI at the gear output"
    return f"`unit: {factor.unit}` for {channel} in the import map, or publish SI"


def _of_rig(name: str, stated: float, moved: float, rig: Rig) -> Iterator[Finding]:
    """Yield the finding of a rig's value that the record contradicts; a damping is no machine's mark."""
    factor, spread = math.exp(moved), _spread(rig, name)
    soft = name.endswith("damping")
    if max(factor, 1.0 / factor) < (_FAR if soft else _MOVED) or abs(moved) < _ELSEWHERE * spread:
        return
    light: Light = "red" if max(factor, 1.0 / factor) > _FAR and not soft else "amber"
    yield Finding(
        light, "wrong_rig", name, factor * stated, rig.unit(name), expected=f"{stated:.4g}",
        detail=f"{factor:.2g} times the rig's value", remedy=RIGHT_RIG,
    )  # fmt: skip


def _springs(pairs: Sequence[Pair]) -> Iterator[Finding]:
    """Yield the finding of a spring that holds an output which the rig leaves free."""
    name = "spring_end.stiffness"
    free = [p for p in pairs if p.fits and name in p.law.names and not p.law.expected[0]]
    sure = [p.ratios[0] for p in free if p.ratios[0] > 0.0 and p.sds[0] < _SURE_SPRING]
    if len(sure) < 2:
        return
    yield Finding(
        "red", "wrong_rig", name, float(np.median(sure)), "N m/rad", expected="0",
        detail="a spring or pendulum holds the output", remedy=RIGHT_RIG,
    )  # fmt: skip


_SAYS = {
    ("velocity", "position"): "the rate of the position",
    ("deflection", "position"): "the position, which the held output makes it",
    ("motor_torque", "command"): "the command",
}


def _contradiction(p: Pair) -> Finding:
    """Return the finding of two channels that disagree where no third says which is wrong."""
    law = _SAYS.get((p.law.y, p.law.x), f"what {p.law.x} makes it by the rig's structure")
    says = f"{'times' if p.sign else 'not'} {law}"
    side = "behind" if p.lag > 0.0 else "ahead of"
    late = f", {1e3 * abs(p.lag):.3g} ms {side} it" if abs(p.lag) > _IN_TIME else ""
    value, unit = (math.copysign(p.factor, p.sign), "1") if p.sign else (p.lag, "s")
    return Finding(
        "amber", "contradiction", p.law.y, value, unit, expected="1, in step",
        detail=f"{says}{late}, coherence {p.coherence:.2f}, from {p.start:.4g} s to {p.stop:.4g} s",
        remedy=f"nothing says which of {p.law.y} and {p.law.x} is wrong: look at unit and source of both",
    )  # fmt: skip


def _is_off(p: Pair) -> bool:
    """Return whether two channels of one quantity disagree by a factor, at all frequencies alike.

    A drive at its limit gives less than it was asked for, but not in proportion.
    """
    if (p.law.y, p.law.x) not in _SAYS or p.law.y not in MEASURED or not p.sign:
        return False
    flat = p.left < _FLAT if p.fits else p.coherence > 0.9 and p.law.y != "motor_torque"
    limited = p.law.y == "motor_torque" and p.factor < 1.0 and p.coherence < _LINEAR
    return flat and not limited and abs(math.log(max(p.factor, 1e-300))) > _SAME_RATE


def _is_apart(p: Pair) -> bool:
    """Return whether torque and F/T, of which no law states the lag, are too far apart for a joint."""
    if p.law.y == "ft" and p.law.expected[0]:
        return not p.fits and p.left > 0.5 and not p.unrelated and math.isfinite(p.left)
    plain = p.law.y == "motor_torque" and not p.law.expected[0] and p.law.x == "ft"
    return plain and p.clear and p.coherence > 0.5 and abs(p.lag) > NEAR


def start_of(pairs: Sequence[Pair], rig: Rig) -> Start:
    """Return what the pairs measure of the rig's values and of the lags behind a torque."""
    values: dict[str, list[float]] = {}
    delay: dict[str, list[float]] = {}
    for p in (p for p in pairs if p.fits and p.clear):
        for k in _sure(p):
            if p.law.names[k] in rig.quantities and p.ratios[k] > 0.0:
                values.setdefault(p.law.names[k], []).append(p.ratios[k] * rig[p.law.names[k]])
        if p.law.y == "command" and abs(p.lag) > _BEGIN:
            delay.setdefault(p.law.x, []).append(-p.lag)
    return Start(*({n: float(np.median(v)) for n, v in d.items()} for d in (values, delay)))


def in_step(record: Record, lags: Mapping[str, float]) -> Record:
    """Return the record with the stamps of some channels earlier by their lags (s), within the commands."""
    moved = {n: Channel(record[n].t - lag, record[n].y) for n, lag in lags.items()}
    record = record.with_channels(**moved)
    begin = max(c.t[0] for c in record.channels.values() if len(c))
    end = min(c.t[-1] for c in record.channels.values() if len(c))
    return replace(record.between(float(begin), float(end)), faults=record.faults)

"""Factors between what a channel shows and what the rig expects of it, and findings on sign, scale and rig.

A factor is reported only where the fit with it is much better than the fit without, and leaves a response
that has the rig's shape. Gains within ALLOWED do not come from units: a torque constant, a calibration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.checks.finding import Finding, Light
from rsea_ros.checks.response_shape import FittedShape, Prior, Quotient, ShapeFit
from rsea_ros.model.rig import Rig

_TURN = 2.0 * math.pi
_ANGLES = {"deg": math.degrees(1.0), "mrad": 1e3, "rev": 1.0 / _TURN, "arcmin": 60.0 * math.degrees(1.0)}
_SPEEDS = {"rpm": 60.0 / _TURN, "deg/s": math.degrees(1.0), "rev/s": 1.0 / _TURN}
_TORQUES = {"mN m": 1e3, "N cm": 100.0, "kN m": 1e-3, "lbf in": 8.8507}
_UNITS = {"position": _ANGLES, "deflection": _ANGLES, "velocity": _SPEEDS}
SAME_NUMBER = {"mN m": "mN m or N mm"}
"""Units that a factor cannot distinguish."""


@dataclass(frozen=True)
class Factor:
    """A channel's value over the SI value at the gear output.

    unit: its unit; at_motor: on the motor's side.
    """

    value: float
    unit: str
    at_motor: bool = False

    @property
    def meaning(self) -> str:
        """Return `rpm at the motor`."""
        unit = SAME_NUMBER.get(self.unit, self.unit)
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


ALLOWED = 1.1
"""Logarithm of a gain, either way, that a bench may have: a factor of 3, that of a drive at its limit."""
_RELATED = 0.8
"""Coherence below which a gain may be that of a limit: a unit changes none."""
_ALIKE = 0.15
"""Logarithm: factors that lie so close cannot be distinguished."""
SHAPED = 0.35
"""Largest median of what is left of ln R for a channel to have the rig's shape."""
_BETTER = 10.0
"""By how much a cost must fall for a sign or a factor to be reported, e^5 in likelihood."""
_FREE = 3.0
_CLEAR = 60.0
"""Difference of phase costs from which the better sign needs no trial."""
_EXACT = 0.4
"""Logarithm: what is left of every gain where two units at once are to be believed."""
_WITHIN = 2.0
"""Spreads of a rig's inertia that a drive without a spring may be off: its torque is that of the inertia."""
_NEAR = 0.7
"""Logarithm: so close to a factor's value a gain must be for the factor to be tried."""


@dataclass(frozen=True)
class ChannelCorrection:
    """The corrections of a channel. sign: -1 where it is reversed. factor: None for SI at the gear output.

    also: other factors that these data cannot distinguish. gain: the remaining logarithm of its gain
    then. odd: the gain fits no factor.
    """

    channel: str
    sign: float
    factor: Factor | None
    gain: float
    odd: bool = False
    also: tuple[Factor, ...] = ()


@dataclass(frozen=True)
class Readings:
    """Readings by channel, the command's too; the fit as the data stand, and with the readings applied."""

    channels: Mapping[str, ChannelCorrection]
    plain: FittedShape
    applied: FittedShape


def readings_of(quotients: Mapping[str, Quotient], rig: Rig) -> Readings | None:
    """Return how the channels of a record are to be read, None where no line of any can be used."""
    fit = ShapeFit(quotients, rig)
    if not fit.channels:
        return None
    plain = fit.fit({n: Prior() for n in fit.channels})
    if all(abs(plain.gain[n]) < ALLOWED and plain.error[n] < SHAPED for n in fit.channels):
        return Readings(
            {n: ChannelCorrection(n, 1.0, None, plain.gain[n]) for n in fit.channels}, plain, plain
        )
    return _try_corrections(fit, plain, quotients, rig)


def _try_corrections(
    fit: ShapeFit, plain: FittedShape, quotients: Mapping[str, Quotient], rig: Rig
) -> Readings:
    """Return the readings where something is off: signs first, then factors, then both against none."""
    signs = _signs(fit)
    free = fit.fit({n: Prior(signs[n], 0.0, _FREE) for n in fit.channels})
    command, signs, gains = _command_apart(fit.channels, signs, free.gain)
    by_channel = {n: _correction_for(n, signs[n], gains[n], rig) for n in fit.channels}
    if command is not None:
        by_channel["command"] = _correction_for("command", command[0], command[1], rig)
    elif any(r.odd for r in by_channel.values()):
        by_channel = _in_a_unit_of_the_command(signs, gains, rig) or by_channel
    applied = fit.fit({n: _prior(n, by_channel) for n in fit.channels})
    shaped = float(np.median(list(applied.error.values()))) < SHAPED
    if not shaped or applied.cost > plain.cost - _BETTER:
        return Readings(
            {n: ChannelCorrection(n, 1.0, None, plain.gain[n]) for n in fit.channels}, plain, plain
        )
    return Readings({n: _believe(r, quotients, applied) for n, r in by_channel.items()}, plain, applied)


def _believe(
    reading: ChannelCorrection, quotients: Mapping[str, Quotient], applied: FittedShape
) -> ChannelCorrection:
    """Return the reading, unchanged where the channel does not have the rig's shape or may be limited."""
    q = quotients.get(reading.channel)
    if q is None:
        q = max(quotients.values(), key=lambda one: one.related)
    of_a_limit = reading.factor is not None and abs(math.log(reading.factor.value)) < 3.0
    weak = q.related < _RELATED and of_a_limit
    if weak or applied.error.get(reading.channel, 0.0) > SHAPED:
        return ChannelCorrection(reading.channel, 1.0, None, reading.gain)
    return reading


def _signs(fit: ShapeFit) -> dict[str, float]:
    """Return for each channel the sign under which its phases fit, the positive one unless much worse."""
    lead = {n: fit.phase_cost(n, 1.0) - fit.phase_cost(n, -1.0) for n in fit.channels}
    signs = {n: -1.0 if lead[n] > _BETTER / 2.0 else 1.0 for n in fit.channels}
    best = fit.fit({n: Prior(signs[n], 0.0, _FREE) for n in fit.channels})
    for n in (n for n in fit.channels if abs(lead[n]) < _CLEAR):
        other = {**signs, n: -signs[n]}
        tried = fit.fit({c: Prior(other[c], 0.0, _FREE) for c in fit.channels})
        if tried.cost < best.cost - _BETTER:
            signs, best = other, tried
    return signs


def _command_apart(
    channels: tuple[str, ...], signs: Mapping[str, float], gains: Mapping[str, float]
) -> tuple[tuple[float, float] | None, dict[str, float], dict[str, float]]:
    """Return sign and gain that all that follow the command share, and the channels' without it.

    One odd command is likelier than several sensors that are odd alike. The motor torque may be odd with
    the command: both come from the drive.
    """
    answer = [n for n in channels if n != "motor_torque"]
    if len(answer) < 2:
        return None, dict(signs), dict(gains)
    turned = all(signs[n] < 0.0 for n in answer)
    low, high = min(gains[n] for n in answer), max(gains[n] for n in answer)
    common = 0.5 * (low + high) if low * high > 0.0 and high - low < _NEAR else 0.0
    common = common if min(abs(low), abs(high)) > ALLOWED else 0.0
    if not turned and common == 0.0:
        return None, dict(signs), dict(gains)
    sign = -1.0 if turned else 1.0
    return (
        (sign, -common),
        {n: sign * signs[n] for n in channels},
        {n: gains[n] - common for n in channels},
    )


def _in_a_unit_of_the_command(
    signs: Mapping[str, float], gains: Mapping[str, float], rig: Rig
) -> dict[str, ChannelCorrection] | None:
    """Return readings in which a unit of the command makes every gain one of a unit, None where none does.

    Commands in mN m make every sensor look a thousand times too small, in addition to its own unit.
    The one that leaves the most channels in SI counts, one sensor at least, then the one that leaves least of
    all gains: a rig whose every channel would be in another unit is another rig.
    """
    tried = []
    for factor in factors("command", rig):
        moved = {n: gain + math.log(factor.value) for n, gain in gains.items()}
        readings = {n: _correction_for(n, signs[n], gain, rig) for n, gain in moved.items()}
        exact = not any(r.odd or abs(r.gain) > _EXACT for r in readings.values())
        if exact and any(r.factor is None for n, r in readings.items() if n != "motor_torque"):
            readings["command"] = ChannelCorrection("command", 1.0, factor, 0.0)
            tried.append(readings)
    return min(tried, key=_oddness, default=None)


def _oddness(readings: Mapping[str, ChannelCorrection]) -> tuple[int, float]:
    """Return how many channels are in another unit, and the remaining gains."""
    return sum(r.factor is not None for r in readings.values()), sum(abs(r.gain) for r in readings.values())


def _correction_for(channel: str, sign: float, gain: float, rig: Rig) -> ChannelCorrection:
    """Return the reading whose factor is nearest to a gain; without a factor for an allowed gain."""
    if abs(gain) < ALLOWED:
        return ChannelCorrection(channel, sign, None, gain)
    known = sorted(factors(channel, rig), key=lambda f: abs(math.log(f.value) - gain))
    remaining = gain - math.log(known[0].value)
    if abs(remaining) > _NEAR:
        of_inertia = rig.rigid_spring and channel == "motor_torque"
        odd = not of_inertia or abs(gain) > _WITHIN * inertia_spread(rig)
        return ChannelCorrection(channel, sign, None, gain, odd=odd)
    also = tuple(f for f in known[1:] if abs(math.log(f.value / known[0].value)) < _ALIKE)
    return ChannelCorrection(channel, sign, known[0], remaining, also=also)


def inertia_spread(rig: Rig) -> float:
    """Return the largest spread of the inertias that a fit may move."""
    return max((rig.spread(n) for n in rig.free() if n.endswith("inertia")), default=0.0)


def _prior(channel: str, corrections: Mapping[str, ChannelCorrection]) -> Prior:
    """Return the prior of a channel's quotient by the readings: its factor over the command's."""
    sign, mean, doubt = 1.0, 0.0, Prior().doubt
    for name, side in ((channel, 1.0), ("command", -1.0)):
        if name in corrections:
            reading = corrections[name]
            sign *= reading.sign
            mean += side * (math.log(reading.factor.value) if reading.factor else 0.0)
            mean += side * reading.gain if reading.odd else 0.0
    return Prior(sign, float(np.clip(mean, -60.0, 60.0)), doubt)


_FAR, _MOVED, _ELSEWHERE = 4.0, 1.6, 4.0
"""Factor of a rig's value that is another machine's; that is worth a look; and spreads that go with both.

A damping is no machine's mark: friction of any kind changes it."""
_FROM_DATA = 0.9
"""Share of what is known of a value that the response must bring."""
_APART = 5.0
"""Factor between the sizes of two signals that have nothing in common, from which the rig is another."""
_STRANGE, _FOREIGN = 2.0 * SHAPED, 1.2
"""What is left of ln R: play and friction on a coarse rig reach the first, another machine the second."""
_UNIT = 0.2
"""Logarithm: what a unit leaves of a gain, up to which it is that unit; a calibration leaves 0.1."""
_BY_A_CONSTANT = "a current, a voltage or a count"
RIGHT_RIG = "is this the right rig? name another with --rig, or another joint with --joint"


def gain_findings(readings: Readings, rig: Rig, axis: str) -> list[Finding]:
    """Return findings for each channel's sign and scale, and for the rig. axis: of the wrench now."""
    findings = [f for r in readings.channels.values() for f in _of_channel(r, axis)]
    return [*findings, *_of_rig(readings.applied, rig)]


def strangers(quotients: Sequence[Quotient]) -> list[Finding]:
    """Return findings for channels that move, but not as the rig would."""
    return [
        Finding(
            "red" if max(q.measured / q.predicted, q.predicted / q.measured) > _APART else "amber",
            "wrong_rig", q.channel, q.measured / q.predicted, "1", expected="about 1",
            detail="times what the rig would give, and hardly anything in common with it", remedy=RIGHT_RIG,
        )
        for q in quotients
    ]


def _of_channel(r: ChannelCorrection, axis: str) -> list[Finding]:
    findings = []
    if r.sign < 0.0:
        findings.append(
            Finding(
                "red", "sign", r.channel, -1.0, "1", expected="1", detail="turned against the rig",
                remedy=_turn(r.channel, axis),
            )
        )
    if r.factor is not None:
        findings.append(_scale_finding(r, r.factor))
    if r.odd or not findings:
        findings.append(
            Finding(
                "red" if r.odd else "green", "wrong_rig" if r.odd else "scale", r.channel, math.exp(r.gain),
                "1", expected="about 1",
                detail=f"times what the rig would give{', which fits no unit' if r.odd else ''}",
                remedy=RIGHT_RIG if r.odd else "",
            )
        )
    return findings


def _scale_finding(r: ChannelCorrection, factor: Factor) -> Finding:
    """Return the finding of a channel in another unit; its factor, or the measured one where that is off."""
    meanings = " or ".join(f.meaning for f in (factor, *r.also))
    measured = factor.value * math.exp(r.gain)
    if abs(r.gain) < _UNIT:
        value, detail, remedy = factor.value, f"looks like {meanings}", _unit(r.channel, factor)
    else:
        value, detail = measured, f"times SI; {meanings} would be {factor.value:.3g}: no unit explains it all"
        remedy = f"`scale: {1.0 / measured:.3g}` for {r.channel} in the import map, if it is {_BY_A_CONSTANT}"
    return Finding(
        "red", "scale", r.channel, value, "1", expected="1, SI at the gear output", detail=detail,
        remedy=remedy,
    )


def _turn(channel: str, axis: str) -> str:
    if channel == "ft":
        return f"--axis {axis.removeprefix('-') if axis.startswith('-') else f'-{axis}'}"
    return f"`sign: -1` for {channel} in the import map, or turn it where it is published"


def _unit(channel: str, factor: Factor) -> str:
    if factor.at_motor or factor.unit in ("counts", "N cm", "lbf in"):
        scale = f"`scale: {1.0 / factor.value:.6g}`"
        return f"{scale} for {channel} in the import map, or publish SI at the gear output"
    return f"`unit: {factor.unit}` for {channel} in the import map, or publish SI"


def _of_rig(shape: FittedShape, rig: Rig) -> list[Finding]:
    """Return how far the rig is from the machine: its values, and the shape of its response."""
    findings = []
    for name, value in shape.values.items():
        factor, reach = value / rig[name] if rig[name] else 1.0, shape.reach[name]
        times = max(factor, 1.0 / max(factor, 1e-12))
        soft = name.endswith("damping")
        if times > (_FAR if soft else _MOVED) and reach > _ELSEWHERE and shape.data_share[name] > _FROM_DATA:
            light: Light = "red" if times > _FAR and not soft else "amber"
            findings.append(
                Finding(
                    light, "wrong_rig", name, value, rig.unit(name), expected=f"{rig[name]:.4g}",
                    detail=f"{factor:.2g} times the rig's value", remedy=RIGHT_RIG,
                )
            )
    for name, error in shape.error.items():
        beside = shape.error_measured[name]
        error = max(error, beside if beside > _FOREIGN else 0.0)
        if error > _STRANGE:
            far = error > _FOREIGN and not rig.rigid_spring
            findings.append(
                Finding(
                    "red" if far else "amber", "wrong_rig", name, math.exp(error), "1", expected="about 1",
                    detail="off: its response has another shape than the rig's", remedy=RIGHT_RIG,
                )
            )
    if not findings:
        findings.append(
            Finding("green", "wrong_rig", "", None, "", detail=f"the response has the shape of {rig.name}")
        )
    return findings

"""Findings about sign, scale and the rig, from the readings that were tried (gains.py)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rsea_ros.checks.channel_spectra import Quotient
from rsea_ros.checks.finding import Finding, Light
from rsea_ros.checks.gains import SHAPED, ChannelCorrection, Factor, Readings
from rsea_ros.checks.response_shape import FittedShape
from rsea_ros.model.rig import Rig

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
            "wrong_rig",
            q.channel,
            q.measured / q.predicted,
            "1",
            expected="about 1",
            detail="times what the rig would give, and hardly anything in common with it",
            remedy=RIGHT_RIG,
        )
        for q in quotients
    ]


def _of_channel(r: ChannelCorrection, axis: str) -> list[Finding]:
    findings = []
    if r.sign < 0.0:
        findings.append(
            Finding(
                "red",
                "sign",
                r.channel,
                -1.0,
                "1",
                expected="1",
                detail="turned against the rig",
                remedy=_turn(r.channel, axis),
            )
        )
    if r.factor is not None:
        findings.append(_scale_finding(r, r.factor))
    if r.odd or not findings:
        findings.append(
            Finding(
                "red" if r.odd else "green",
                "wrong_rig" if r.odd else "scale",
                r.channel,
                math.exp(r.gain),
                "1",
                expected="about 1",
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
        "red",
        "scale",
        r.channel,
        value,
        "1",
        expected="1, SI at the gear output",
        detail=detail,
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
                    light,
                    "wrong_rig",
                    name,
                    value,
                    rig.unit(name),
                    expected=f"{rig[name]:.4g}",
                    detail=f"{factor:.2g} times the rig's value",
                    remedy=RIGHT_RIG,
                )
            )
    for name, error in shape.error.items():
        beside = shape.error_measured[name]
        error = max(error, beside if beside > _FOREIGN else 0.0)
        if error > _STRANGE:
            far = error > _FOREIGN and not rig.rigid_spring
            findings.append(
                Finding(
                    "red" if far else "amber",
                    "wrong_rig",
                    name,
                    math.exp(error),
                    "1",
                    expected="about 1",
                    detail="off: its response has another shape than the rig's",
                    remedy=RIGHT_RIG,
                )
            )
    if not findings:
        findings.append(
            Finding("green", "wrong_rig", "", None, "", detail=f"the response has the shape of {rig.name}")
        )
    return findings

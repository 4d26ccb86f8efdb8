"""What the controller node makes of an encoder on the spring: the link's motion, or why not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from rsea_ros.control.compensation import compensation
from rsea_ros.control.law import law_of
from rsea_ros.control.link import LinkMotion, LinkShare, link_share
from rsea_ros.control.loads import lightest, load_range
from rsea_ros.control.spring_encoder import SpringEncoder, spread
from rsea_ros.control.synthesis import ControllerDesign, DesignLimits
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig

LOUD = 0.02
"""Of torque_limit: RMS of the torque that the noise of both encoders may make."""
HEARD = 2000
"""Samples of noise that show it."""


class LinkFeedforward(NamedTuple):
    """share: what is fed forward. encoder: None where nothing is, and `reason` says why."""

    share: LinkShare
    encoder: SpringEncoder | None
    reason: str


def link_of(values: Mapping[str, Any], designed: ControllerDesign) -> LinkFeedforward:
    """Return what the link's motion is used for."""
    rig = load_rig(values["rig"])
    if reason := _unusable(values, rig):
        return LinkFeedforward(LinkShare(), None, reason)
    demand = DesignLimits(*(values[name] for name in ("sensitivity", "robust", "impedance")))
    share = link_share(rig, load_range(rig, lightest(rig, values["free"])), designed, demand)
    if share == LinkShare():
        return LinkFeedforward(share, None, "no part of it keeps the demands")
    loud, most = _noise(rig, designed, share), LOUD * values["torque_limit"]
    if loud > most:
        reason = f"noise of {loud:.2g} N·m of motor torque, expected at most {most:.2g}"
        return LinkFeedforward(LinkShare(), None, reason)
    return LinkFeedforward(share, SpringEncoder(rig, designed.rate), "")


def link_words(link: LinkFeedforward) -> str:
    """Return it as a line for the log."""
    if link.encoder is None:
        return f"motion of the link is not fed forward: {link.reason}"
    s = link.share
    return (
        f"motion of the link is fed forward once deflection agrees with ft: {s.inertia:g} of the inertia,"
        f" {s.damping:g} of the damping, below {s.corner:g} Hz"
    )


def link_values(link: LinkFeedforward) -> dict[str, object]:
    """Return it as diagnostics show it."""
    encoder = link.encoder
    if encoder is None:
        return {"link": f"not used: {link.reason}"}
    waiting = f"not used: {encoder.trouble or 'deflection and ft have not been compared in motion yet'}"
    return {
        "link": "used" if encoder.used else waiting,
        "link_losses": encoder.losses,
        "missing_deflections": encoder.missing,
    }


def _unusable(values: Mapping[str, Any], rig: Rig) -> str:
    if not values["link"]:
        return "link is false"
    if "deflection" not in rig.sensors:
        return "the rig has no sensor deflection"
    if compensation(rig).gap:
        return "the rig has backlash, which looks like motion of the link"
    return ""


def _noise(rig: Rig, designed: ControllerDesign, share: LinkShare) -> float:
    """Return the RMS of the torque of a link that stands still, N m."""
    angle = math.hypot(spread(rig, "deflection"), spread(rig, "position"))
    motion = LinkMotion(law_of(rig, designed.rate, designed.gains), share)
    torques = [motion.torque(angle * x, 0.0) for x in np.random.default_rng(0).normal(size=HEARD)]
    return math.sqrt(sum(torque**2 for torque in torques) / HEARD)

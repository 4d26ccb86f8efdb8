"""Where the paper contradicts itself or is silent, each in a sentence with its number."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rsea_ros.model import outputs
from rsea_ros.model import paper_claims as claims
from rsea_ros.model import paper_formulas as paper
from rsea_ros.model.bandwidth import flat_band, inner_inertia, resonance_peak
from rsea_ros.model.response import frequency_response
from rsea_ros.model.rig import END_NAMES, Quantity
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.spring import spring_radius

Kind = Literal["inconsistent", "silent"]


@dataclass(frozen=True)
class Finding:
    """inconsistent: two statements of the paper that cannot both hold. silent: what a reader has to add."""

    kind: Kind
    where: str
    text: str


def findings() -> tuple[Finding, ...]:
    """Return all of them, in the order of the paper."""
    return (*_circuit_and_band(), *_identification(), *_moving_output(), *_prototype())


def _circuit_and_band() -> Iterator[Finding]:
    platform = load_rig("paper_high_impedance")
    spin = platform["rotor.reflected_inertia"] / platform["gear.ratio"]
    k_s, j_sc, b_s = (claims.table_2(n) for n in ("K_s", "J_sc", "b_s"))
    eq_6 = paper.eq_6_distal_per_proximal(k_s, j_sc, b_s)
    peak_hz, peak_db = resonance_peak(eq_6)
    yield Finding(
        "inconsistent",
        "Fig. 8 and Eqs. (5) to (7)",
        "The three-port of Fig. 8 makes T_p − T_d = (J_sc + J_m/N) q̈; Eqs. (5) to (7) have J_sc alone. "
        f"J_m/N is {spin:.4f} kg·m², "
        f"{100 * spin / j_sc:.0f} % of J_sc: Eq. (7) gives {paper.eq_7_bandwidth(k_s, j_sc):.1f} Hz for "
        "the platform, "
        f"{paper.eq_7_bandwidth(k_s, inner_inertia(platform)):.1f} Hz with the rotor's spin.",
    )
    yield Finding(
        "inconsistent",
        "Eq. (7)",
        "Eq. (7) is the +3 dB point of an undamped Eq. (6). With Table 2's b_s = 3 N·m·s/rad |Eq. (6)| "
        f"peaks at {peak_db:+.2f} dB "
        f"({peak_hz:.1f} Hz), never reaches +3 dB and falls below −3 dB at {flat_band(eq_6):.1f} Hz; its "
        "phase passes −10° at "
        f"{flat_band(eq_6, 3.0, 10.0):.1f} Hz.",
    )
    yield Finding(
        "inconsistent",
        "2.2 and Fig. 7",
        "With torque as voltage and velocity as current an infinite impedance is an open branch. The text "
        "puts a "
        "short circuit there, which would make T_d = 0; nodal analysis of the open one gives Eq. (4).",
    )
    lag = math.degrees(math.atan(2 * math.pi * 80.0 * b_s / k_s))
    yield Finding(
        "silent",
        "Eqs. (1), (3), (4), (6)",
        "The numerators have K_s, the torque of the elastic element. A sensor in series with spring and "
        "damper sees K_s + b_s s: "
        f"{math.degrees(math.atan(2 * math.pi * 30.0 * b_s / k_s)):.0f}° apart at 30 Hz, {lag:.0f}° at 80 "
        "Hz.",
    )


def _identification() -> Iterator[Finding]:
    c_0, _, c_2 = paper.EQ_10
    k_s = claims.table_2("K_s")
    yield Finding(
        "inconsistent",
        "Eq. (10)",
        f"The same K_s/J_eff is {c_0} in the numerator and {c_2} in the denominator, "
        f"{100 * (1 - c_0 / c_2):.1f} % apart: a gain of "
        f"{c_0 / c_2:.3f} at rest where Eq. (4) has 1. Averaging hides a torque constant that is off, or "
        "friction; "
        "an amplitude series or the drive current would tell.",
    )
    yield Finding(
        "silent",
        "3.2.1",
        "Only K_s/J_eff and b_eff/J_eff can be had from T_d/T_m. The absolute values rest on the measured "
        "K_s: J_eff is "
        f"{k_s / c_0:.3f} or {k_s / c_2:.3f} kg·m² by the one or the other K_s/J_eff, and with the nominal "
        "K_s "
        f"{1690.5 / (0.5 * (c_0 + c_2)):.3f} kg·m².",
    )
    bound = claims.TORQUE_CONSTANT * claims.NO_LOAD_CURRENT / claims.NO_LOAD_SPEED
    yield Finding(
        "inconsistent",
        "Table 2, b_m",
        f"23.088 N·m·s/rad cannot be viscous drag: at the no-load speed of 33.1 rpm it would take "
        f"{23.088 * claims.NO_LOAD_SPEED:.0f} N·m, the no-load current of 1.65 A makes "
        f"{bound * claims.NO_LOAD_SPEED:.0f} N·m, at most "
        f"{bound:.1f} N·m·s/rad. Most of b_m is dry or load-dependent friction, linearised at the test's "
        "amplitude.",
    )
    radius = spring_radius(1690.5, claims.SPRING_RATE, claims.ARM)
    yield Finding(
        "silent",
        "Eq. (9)",
        f"The spring radius r_s is not printed. K_s = 1690.5 N·m/rad needs {1e3 * radius:.1f} mm; the "
        "measured K_s is "
        f"{100 * (1 - k_s / 1690.5):.1f} % below it.",
    )
    yield Finding(
        "silent",
        "3.2.1",
        f"280 Hz with excitation to 140 Hz is exactly Nyquist. The hold's half sample, {0.5e3 / 280:.3f} "
        f"ms, is {180 * 19 / 280:.0f}° at "
        f"19 Hz and {180 * 53 / 280:.0f}° at 53 Hz; nothing is said of how command and measurement were "
        "aligned.",
    )
    yield Finding(
        "inconsistent",
        "3.2.1, 3.2.2",
        "The standard deviation of the torque noise is printed as 10 N and 30 N; it is taken as N·m. Noise "
        "of 30 N·m exceeds the "
        f"motor's 44.2 N·m continuous torque {100 * math.erfc(44.2 / 30 / math.sqrt(2)):.0f} % of the time.",
    )


def _moving_output() -> Iterator[Finding]:
    rig = load_rig("paper_moving_output")
    hz = np.linspace(10.0, 40.0, 3001)
    gain = np.abs(frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz))
    stiffness = claims.PENDULUM_MASS * claims.GRAVITY * claims.PENDULUM_LENGTH
    yield Finding(
        "silent",
        "3.2.2, 19 Hz",
        "“Around 19 Hz the experimental phase becomes out of sync” is put down to a signal lost in the "
        "sensor's noise. The unlumped model "
        f"has its resonance there, housing and pendulum on the spring, {hz[gain.argmax()]:.1f} Hz and "
        f"{20 * math.log10(gain.max()):.1f} dB: "
        "the torque is large. A resonance a little off turns the phase too, and so does a delay: "
        f"{360 * 19 / 280:.0f}° for one sample.",
    )
    at_33 = 20 * math.log10(float(np.interp(33.0, hz, gain)))
    yield Finding(
        "silent",
        "3.2.2, 33 Hz",
        f"The “resonance around 33 Hz” is in neither model: the unlumped one is smooth there, {at_33:.1f} "
        "dB. A structural resonance "
        "(the effect `structural_resonance`) can be fitted to it.",
    )
    yield Finding(
        "inconsistent",
        "Table 2, K_ld",
        f"5.8 kg at 0.114 m make m g l = {stiffness:.2f} N·m/rad; Table 2 has 7. The pendulum was "
        "“approximated by changing K_ld and b_s”; "
        "b_s is the spring's damping, b_ld must be meant.",
    )
    yield Finding(
        "silent",
        "Table 2, 10⁸",
        "A fixed end is modelled by 10⁸ in inertia, damping and stiffness. Against a clamped end that "
        "changes T_d/T_m by "
        f"{clamp_error():.0e} at most: it does no harm.",
    )
    yield Finding(
        "silent",
        "3.2.2",
        "“Much better” is not quantified: no fit, no coherence, no data set held out. The numbers for a "
        "simulated bench stand beside Fig. 18.",
    )


def clamp_error() -> float:
    """Return the largest relative change of T_d / T_m, 0.1 to 140 Hz, by Table 2's 1e8 for a clamp."""
    rig = load_rig("paper_high_impedance")
    values = {
        f"{end}.{key}": Quantity(1e8) for end in END_NAMES for key in ("inertia", "damping", "stiffness")
    }
    loose = replace(rig, clamped=frozenset(), quantities={**rig.quantities, **values})
    hz = np.geomspace(0.1, 140.0, 200)
    clamped, free = (frequency_response(r, outputs.end_torque(r, "spring_end"), hz) for r in (rig, loose))
    return float(np.max(np.abs(free / clamped - 1.0)))


def _prototype() -> Iterator[Finding]:
    rig = load_rig("prototype_knee")
    k_s, j_sc, torque = claims.PROTOTYPE_STIFFNESS, claims.PROTOTYPE_INERTIA, claims.KNEE_TORQUE
    radius = spring_radius(k_s, claims.PROTOTYPE_RATE, claims.PROTOTYPE_ARM)
    yield Finding(
        "inconsistent",
        "4.1 and Eq. (8)",
        f"By Eq. (8) a mechanism of {k_s:.0f} N·m/rad carries at most K_s/2 = {k_s / 2:.0f} N·m, at 45°: "
        f"less than the {torque:.0f} N·m asked for.",
    )
    yield Finding(
        "inconsistent",
        "4.1 and 3.1.2",
        f"{torque:.0f} N·m on {k_s:.0f} N·m/rad, taken as linear, deflect {torque / k_s:.2f} rad, "
        f"{math.degrees(torque / k_s):.0f}°: far beyond the 5° of section 3.1.2, which would need "
        f"{2 * torque / math.sin(math.radians(10.0)):.0f} N·m/rad.",
    )
    yield Finding(
        "inconsistent",
        "4.1 and Eqs. (5) to (7)",
        f"Its rotor's spin (J_m/N = {rig['rotor.reflected_inertia'] / rig['gear.ratio']:.4f} kg·m², J_m "
        "our estimate) is "
        f"{rig['rotor.reflected_inertia'] / rig['gear.ratio'] / j_sc:.0f} times J_sc: "
        f"{paper.eq_7_bandwidth(k_s, inner_inertia(rig)):.1f} Hz instead of "
        f"{paper.eq_7_bandwidth(k_s, j_sc):.1f} Hz. "
        "A light chassis alone does not buy the bandwidth.",
    )
    yield Finding(
        "silent",
        "4.1",
        f"Neither r_s ({1e3 * radius:.1f} mm by Eq. (9)), nor damping, rotor inertia or the body in the "
        "ADAMS run are printed.",
    )

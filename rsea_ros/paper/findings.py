"""Where the paper contradicts itself, is silent, or can be read in two ways, each with its number.

`found` is only what two statements of the paper make impossible together; what it admits, what it says of
another machine, or what rests on an estimate of ours is none. findings_bench.py has all after section 3.1.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from rsea_ros.design.mechanism import spring_radius
from rsea_ros.model.bandwidth import (
    flat_band,
    inner_inertia,
    pure_torque_bandwidth,
    resonance_peak,
    undamped_band,
)
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper import claims, formulas
from rsea_ros.paper.claims import PaperFinding
from rsea_ros.paper.findings_bench import identification, moving_output, prototype


def circuit() -> Iterator[PaperFinding]:
    platform = load_rig("paper_high_impedance")
    k_s, j_sc = claims.table_2("K_s"), claims.table_2("J_sc")
    spin = platform["rotor.reflected_inertia"] / platform["gear.ratio"]
    forward, backward = (float(undamped_band(k_s, j)) for j in (inner_inertia(platform), j_sc - spin))
    yield PaperFinding(
        "found", "Nomenclature and 2.2",
        "J_eff is the “sum of reflected inertia and motor chassis inertia” in the nomenclature, J_sc + J_m "
        "with the spring chassis in section 2.2 and in Table 2.",
    )  # fmt: skip
    yield PaperFinding(
        "found", "2.2, text on Fig. 7",
        "With torque as voltage and velocity as current an infinite impedance is an open branch. The text "
        "puts a short circuit there, which would make T_d = 0; nodal analysis of the open one gives Eq. "
        "(4). Fig. 7 itself we have not seen.",
    )  # fmt: skip
    yield PaperFinding(
        "unclear", "Fig. 8, Eqs. (5) to (7)",
        "Mu_1 = N + 1 = 502 and Mu_2 = −1 leave the sense of the rotor to the polarity dots of Fig. 8, "
        "which we have not seen. The three-port makes T_p − T_d = (J_sc ± J_m/N) q̈ where Eqs. (5) to (7) "
        f"have J_sc alone: J_m/N is {spin:.4f} kg·m², {100 * spin / j_sc:.0f} % of J_sc, so {forward:.1f} "
        f"or {backward:.1f} Hz for the {pure_torque_bandwidth(k_s, j_sc):.1f} Hz of Eq. (7).",
    )  # fmt: skip


def equations() -> Iterator[PaperFinding]:
    k_s, j_sc, b_s = (claims.table_2(n) for n in ("K_s", "J_sc", "b_s"))
    eq_6 = formulas.eq_6_distal_per_proximal(k_s, j_sc, b_s)
    peak_hz, peak_db = resonance_peak(eq_6)
    lumped = pure_torque_bandwidth(k_s, claims.table_2("J_m") + j_sc)
    yield PaperFinding(
        "found", "2.3.1, Eqs. (4) and (5)",
        "b_m is b_rotor N² by the line above Eq. (1), and is multiplied by N² once more in both equations. "
        "Table 2's b_m fits the first.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "Eqs. (1), (3), (4), (6)",
        "The numerators have K_s, the torque of the elastic element. A sensor in series with spring and "
        f"damper sees K_s + b_s s: {_lag(30.0, b_s, k_s):.0f}° apart at 30 Hz, {_lag(80.0, b_s, k_s):.0f}° "
        "at 80 Hz.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "Eq. (3) and Eq. (7)",
        f"The rule of Eq. (7) on the lumped Eq. (3) gives {lumped:.2f} Hz where Eq. (6) gives "
        f"{pure_torque_bandwidth(k_s, j_sc):.1f} Hz: the strongest number for the unlumped model, and not "
        "printed.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "Eq. (7)",
        "Undamped; the paper says that it ignores some subtleties. With Table 2's b_s = 3 N·m·s/rad |Eq. "
        f"(6)| peaks at {peak_db:+.2f} dB ({peak_hz:.1f} Hz), never reaches +3 dB and falls below −3 dB at "
        f"{flat_band(eq_6):.1f} Hz; its phase passes −10° at {flat_band(eq_6, 3.0, 10.0):.1f} Hz.",
    )  # fmt: skip
    nominal = formulas.eq_9_spring_stiffness(claims.SPRING_RATE, claims.ARM, 0.0)
    yield PaperFinding(
        "unclear", "3.1, Eqs. (8) and (9)",
        f"Two pairs of opposing springs are four. Preloaded, all four act: 4 K, at least {2 * nominal:.0f} "
        f"N·m/rad. Eq. (8) has 2 K, at least {nominal:.0f} N·m/rad, so two act at a time or K counts a "
        f"pair. The measured {k_s:.0f} N·m/rad speak for 2 K; preload is not mentioned.",
    )  # fmt: skip
    radius = spring_radius(1690.5, claims.SPRING_RATE, claims.ARM)
    yield PaperFinding(
        "silent", "Eq. (9)",
        f"The spring radius r_s is not printed. K_s = 1690.5 N·m/rad needs {1e3 * radius:.1f} mm; the "
        f"measured K_s is {100 * (1 - k_s / 1690.5):.1f} % below it.",
    )  # fmt: skip


def _lag(hz: float, b_s: float, k_s: float) -> float:
    return math.degrees(math.atan(2.0 * math.pi * hz * b_s / k_s))


def findings() -> tuple[PaperFinding, ...]:
    """Return all of them, in the order of the paper."""
    return (*circuit(), *equations(), *identification(), *moving_output(), *prototype())

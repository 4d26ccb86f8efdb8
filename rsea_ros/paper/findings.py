"""Where the paper contradicts itself, is silent, or can be read in two ways, each with its number.

`found` is only what two statements of the paper make impossible together; what it admits, what it says of
another machine, or what rests on an estimate of ours is none.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rsea_ros.design.mechanism import spring_radius
from rsea_ros.documents.units import STANDARD_GRAVITY
from rsea_ros.model import transfer
from rsea_ros.model.rig import END_NAMES, Quantity
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper import formulas
from rsea_ros.paper.formulas import PaperFinding
from rsea_ros.paper.rival_models import largest_gap, readings, resonance_hz


def circuit() -> Iterator[PaperFinding]:
    platform = load_rig("paper_high_impedance")
    k_s, j_sc = formulas.table_2("K_s"), formulas.table_2("J_sc")
    spin = platform["rotor.reflected_inertia"] / platform["gear.ratio"]
    inner = transfer.inner_inertia(platform), j_sc - spin
    forward, backward = (float(transfer.undamped_band(k_s, j)) for j in inner)
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
        f"or {backward:.1f} Hz for the {transfer.pure_torque_bandwidth(k_s, j_sc):.1f} Hz of Eq. (7).",
    )  # fmt: skip


def equations() -> Iterator[PaperFinding]:
    k_s, j_sc, b_s = (formulas.table_2(n) for n in ("K_s", "J_sc", "b_s"))
    eq_6 = formulas.eq_6_distal_per_proximal(k_s, j_sc, b_s)
    peak_hz, peak_db = transfer.resonance_peak(eq_6)
    lumped = transfer.pure_torque_bandwidth(k_s, formulas.table_2("J_m") + j_sc)
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
        f"{transfer.pure_torque_bandwidth(k_s, j_sc):.1f} Hz: the strongest number for the unlumped model, "
        "and not printed.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "Eq. (7)",
        "Undamped; the paper says that it ignores some subtleties. With Table 2's b_s = 3 N·m·s/rad |Eq. "
        f"(6)| peaks at {peak_db:+.2f} dB ({peak_hz:.1f} Hz), never reaches +3 dB and falls below −3 dB at "
        f"{transfer.flat_band(eq_6):.1f} Hz; its phase passes −10° at "
        f"{transfer.flat_band(eq_6, 3.0, 10.0):.1f} Hz.",
    )  # fmt: skip
    nominal = formulas.eq_9_spring_stiffness(formulas.SPRING_RATE, formulas.ARM, 0.0)
    yield PaperFinding(
        "unclear", "3.1, Eqs. (8) and (9)",
        f"Two pairs of opposing springs are four. Preloaded, all four act: 4 K, at least {2 * nominal:.0f} "
        f"N·m/rad. Eq. (8) has 2 K, at least {nominal:.0f} N·m/rad, so two act at a time or K counts a "
        f"pair. The measured {k_s:.0f} N·m/rad speak for 2 K; preload is not mentioned.",
    )  # fmt: skip
    radius = spring_radius(1690.5, formulas.SPRING_RATE, formulas.ARM)
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


def identification() -> Iterator[PaperFinding]:
    c_0, _, c_2 = formulas.EQ_10
    k_s = formulas.table_2("K_s")
    yield PaperFinding(
        "found", "Eq. (10)",
        f"The same K_s/J_eff is {c_0} in the numerator and {c_2} in the denominator, "
        f"{100 * (1 - c_0 / c_2):.1f} % apart: a gain of {c_0 / c_2:.3f} at rest where Eq. (4) has 1.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "Eq. (10)",
        "The paper says that it averages the two. That hides a torque constant that is off, or friction; "
        "an amplitude series or the drive current would decide.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "3.2.1",
        "Only K_s/J_eff and b_eff/J_eff can be had from T_d/T_m. The absolute values rest on the measured "
        f"K_s: J_eff is {k_s / c_0:.3f} or {k_s / c_2:.3f} kg·m² by the one or the other K_s/J_eff, and "
        f"with the nominal K_s {1690.5 / (0.5 * (c_0 + c_2)):.3f} kg·m².",
    )  # fmt: skip
    bound = formulas.TORQUE_CONSTANT * formulas.NO_LOAD_CURRENT / formulas.NO_LOAD_SPEED
    yield PaperFinding(
        "silent", "Table 2, b_m",
        "23.088 N·m·s/rad cannot be viscous drag: at the no-load speed of 33.1 rpm it would take "
        f"{23.088 * formulas.NO_LOAD_SPEED:.0f} N·m, the maker's no-load current of 1.65 A makes "
        f"{bound * formulas.NO_LOAD_SPEED:.0f} N·m, at most {bound:.1f} N·m·s/rad. Most of it is likely dry "
        "friction, linearised at the test's amplitude; the paper names static friction only as the reason "
        "for the added noise.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "3.2.1",
        f"280 Hz with excitation to 140 Hz is exactly Nyquist. The hold's half sample, {0.5e3 / 280:.3f} "
        f"ms, is {180 * 19 / 280:.0f}° at 19 Hz and {180 * 53 / 280:.0f}° at 53 Hz; nothing is said of how "
        "command and measurement were aligned.",
    )  # fmt: skip
    yield PaperFinding(
        "found", "3.2.1, 3.2.2",
        "The standard deviation of a noise in torque is printed as 10 N and 30 N. We take N·m.",
    )  # fmt: skip
    over = math.erfc(44.2 / 30.0 / math.sqrt(2.0))
    yield PaperFinding(
        "silent", "3.2.2",
        f"Noise of 30 N·m is above the continuous torque of 44.2 N·m {100 * over:.0f} % of the time. That "
        "limit is thermal, so the test is possible; whether the drive clipped is not said.",
    )  # fmt: skip


def moving_output() -> Iterator[PaperFinding]:
    rig = load_rig("paper_moving_output")
    at = np.array([10.0, 19.0, 33.0])
    gains = 20.0 * np.log10(np.abs(transfer.end_response(rig, at)))
    _, moving, grounded = readings(rig).values()
    gap_hz, gap = largest_gap(rig, grounded)
    stiffness = formulas.PENDULUM_MASS * STANDARD_GRAVITY * formulas.PENDULUM_LENGTH
    yield PaperFinding(
        "unclear", "3.2.2, Figs. 16 and 18",
        "The lumped model of Fig. 18 can be read in two ways: only the parts within the inner line "
        "combined, its loads moving, or the motor pushing against the ground, as in Fig. 3. The first "
        "gives the torque of the unlumped model within 0.3 dB below 1 Hz, within 4 dB beside the "
        f"pendulum's notch at 1.33 Hz, and 2.3 dB more at 2 Hz, the second up to {gap:.1f} dB more, at "
        f"{gap_hz:.2f} Hz. What decides is the resonance: {resonance_hz(rig):.1f} Hz unlumped, "
        f"{resonance_hz(moving):.1f} Hz lumped with moving loads.",
    )  # fmt: skip
    yield PaperFinding(
        "found", "3.2.2, 19 Hz",
        "“Around 19 Hz the experimental phase becomes out of sync” is put down to a very small output. The "
        f"paper's unlumped model with Table 2 has its resonance there, at {resonance_hz(rig):.1f} Hz: "
        f"{_db(gains[1])} at 19 Hz against {_db(gains[0])} at 10 Hz. The torque is largest where it is said "
        "to be lost. A resonance a little off turns the phase too, and so does a delay: "
        f"{360 * 19 / 280:.0f}° for one sample.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "3.2.2, 33 Hz",
        "The “resonance around 33 Hz” is in neither model, as the paper says: the unlumped one is smooth "
        f"there, {_db(gains[2])}. A structural resonance (the effect `structural_resonance`) can be fitted "
        "to it.",
    )  # fmt: skip
    yield PaperFinding(
        "unclear", "3.2.2, Table 2, K_ld",
        f"5.8 kg at 0.114 m make m g l = {stiffness:.2f} N·m/rad; Table 2 has 7, which the paper says it "
        "tuned. The pendulum was “approximated by changing K_ld and b_s”; b_s is the spring's damping, "
        "b_ld may be meant.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "Table 2, 10⁸",
        "A fixed end is modelled by 10⁸ in inertia, damping and stiffness. Against a clamped end that "
        f"changes T_d/T_m by {clamp_error():.0e} at most: it does no harm.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "3.2.2",
        "“Much better” is not quantified: no fit, no coherence, no data set held out. The numbers for a "
        "simulated bench stand beside Fig. 18.",
    )  # fmt: skip


def prototype() -> Iterator[PaperFinding]:
    k_s, j_sc, torque = formulas.PROTOTYPE_STIFFNESS, formulas.PROTOTYPE_INERTIA, formulas.KNEE_TORQUE
    yield PaperFinding(
        "found", "4.1 and Eq. (8)",
        f"By Eq. (8) a mechanism of {k_s:.0f} N·m/rad carries at most K_s/2 = {k_s / 2:.0f} N·m, at 45°: "
        f"less than the {torque:.0f} N·m asked for.",
    )  # fmt: skip
    yield PaperFinding(
        "silent", "4.1 and 3.1.2",
        f"{torque:.0f} N·m on {k_s:.0f} N·m/rad, taken as linear, deflect {torque / k_s:.2f} rad, "
        f"{math.degrees(torque / k_s):.0f}°. The 5° of section 3.1.2 are said of the test platform; of the "
        f"prototype no deflection is stated. 5° would need {2 * torque / math.sin(math.radians(10.0)):.0f} "
        "N·m/rad.",
    )  # fmt: skip
    rig = load_rig("prototype_knee")
    inner = (transfer.inner_inertia(replace(rig, train=train)) for train in formulas.PROTOTYPE_TRAINS)
    backward, forward = (float(transfer.undamped_band(k_s, j)) for j in inner)
    yield PaperFinding(
        "unclear", "4.1 and Eqs. (5) to (7)",
        "Neither the rotor's inertia nor which spline of the harmonic drive is held is printed. With our "
        f"estimate of J_m = {rig['rotor.reflected_inertia']:.1f} kg·m² the rotor's spin is "
        f"{rig['rotor.reflected_inertia'] / rig['gear.ratio'] / j_sc:.0f} times J_sc: {backward:.1f} Hz "
        f"with the circular spline held (n = −160), {forward:.1f} Hz with the flexspline held (n = +161), "
        f"instead of {transfer.pure_torque_bandwidth(k_s, j_sc):.1f} Hz.",
    )  # fmt: skip
    radius = spring_radius(k_s, formulas.PROTOTYPE_RATE, formulas.PROTOTYPE_ARM)
    yield PaperFinding(
        "silent", "4.1",
        f"Neither r_s ({1e3 * radius:.1f} mm by Eq. (9)), nor damping, nor the body in the ADAMS run are "
        "printed.",
    )  # fmt: skip


def clamp_error() -> float:
    """Return the largest relative change of T_d / T_m, 0.1 to 140 Hz, by Table 2's 1e8 for a clamp."""
    rig = load_rig("paper_high_impedance")
    values = {
        f"{end}.{key}": Quantity(1e8) for end in END_NAMES for key in ("inertia", "damping", "stiffness")
    }
    loose = replace(rig, clamped=frozenset(), quantities={**rig.quantities, **values})
    hz = np.geomspace(0.1, 140.0, 200)
    clamped, free = (transfer.end_response(r, hz) for r in (rig, loose))
    return float(np.max(np.abs(free / clamped - 1.0)))


def _db(value: float) -> str:
    return f"{value:.1f} dB".replace("-", "−")

"""The paper recomputed: one HTML page with its tables, and paper.json with every number beside ours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Any

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import inner_inertia, pure_torque_bandwidth
from rsea_ros.paper import figures
from rsea_ros.paper.bands import TOLERANCES, Arrangement, Bands, Limit, arrangements, bands, limits
from rsea_ros.paper.findings import findings
from rsea_ros.paper.formulas import PROTOTYPE_TRAINS, TABLE_2, PaperClaim, PaperFinding, claims
from rsea_ros.paper.rival_models import MovingOutput, lumped_rig as lumped_model
from rsea_ros.report import page as html, words
from rsea_ros.report.result_files import pick, strict

CONTINUOUS = {"paper_high_impedance": 44.2, "prototype_knee": 67.0}
"""N m, continuous torque of the two motors (sections 3.1.1 and 4.1)."""


@dataclass(frozen=True)
class PaperTests:
    """The simulated tests: Fig. 15's response, and the moving outputs by name, the paper's first."""

    high_impedance: FrequencyResponse
    moving: Mapping[str, MovingOutput]


def actuator_bands() -> dict[str, Bands]:
    """Return the bands of test platform and prototype."""
    knee = load_rig("prototype_knee")
    rigs = {"Test platform": load_rig("paper_high_impedance")}
    for train in PROTOTYPE_TRAINS:
        rigs[f"Prototype, {words.train(train)}"] = replace(knee, train=train)
    return {title: bands(rig, CONTINUOUS[rig.name]) for title, rig in rigs.items()}


def paper_report(tests: PaperTests) -> str:
    """Return the page."""
    first = next(iter(tests.moving.values()))
    rig = load_rig("paper_moving_output")
    blocks: list[html.Block] = [
        html.key_numbers(_keys()), claims_table(claims()), findings_list(findings()),
        html.section(
            "The equations as printed, and where the equations of motion differ", html.equation(EQUATIONS)
        ),
        _table_1(), table_2(_rig_values()),
        *figures.figure_9(), figures.figure_15(tests.high_impedance), figures.figure_18(first),
        figures.figure_18_as_printed(), moving_table(tests.moving), figures.figure_20(),
        bands_table(actuator_bands()), arrangements_table(arrangements(rig), limits(rig)),
    ]  # fmt: skip
    unlumped, lumped = (100.0 * rival.held_out[0].explained for rival in first.rivals)
    title = (
        f"A moving output separates the models: unlumped {unlumped:.2f} % of a simulated bench's torque, "
        f"lumped {lumped:.0f} %. Eq. (7) leaves out the rotor's spin"
    )
    return html.page(title, _KICKER, blocks, _FOOTER)


_KICKER = (
    "“Experimental validation of unlumped model and its design implications for rotary series elastic "
    "actuators”, recomputed"
)
_FOOTER = [
    "Benches are simulated by the unlumped model: the test is whether data can decide, not nature. Values "
    "drawn from the rigs' spread, sensors' noise, bags written and read back.",
    "Models: rsea_ros/model; what they take for exact: docs/physics.md; derivation: docs/derivation.md. All "
    "values in SI.",
    "rsea paper",
]


def _keys() -> list[tuple[str, str]]:
    recomputed = [c for c in claims() if c.status == "found"]
    platform, backward, forward = actuator_bands().values()
    rig = load_rig("paper_high_impedance")
    lumped = pure_torque_bandwidth(rig["spring.stiffness"], inner_inertia(lumped_model(rig)))
    senses = f"{backward.eq_7_spin:.1f} or {forward.eq_7_spin:.1f}"
    return [
        (f"{sum(c.agrees for c in recomputed)} of {len(recomputed)}", "numbers to the last digit"),
        (str(sum(f.status == "found" for f in findings())), "contradictions"),
        (f"{lumped:.2f}, {platform.eq_7:.1f} Hz", "platform: lumped, unlumped"),
        (f"{backward.eq_7:.1f} → {senses} Hz", "prototype, with the rotor's spin"),
    ]


_DRAWINGS = {
    "general": "Fig. 6: between two loads. Z_m = b_m and the rotor, Z_s = b_s + K_s/s",
    "lumped": "Fig. 7: both ends clamped. The branches of the loads are open (the paper's text: "
    "short-circuited; the figure itself we have not seen)",
    "epicyclic": "Fig. 8: the epicyclic train as a three-port. Mu_1 = 502, Mu_2 = 1 with our direction of "
    "ω_h (paper: −1; its polarity dots we have not seen)",
}


def _rig_values() -> dict[str, float]:
    rig = load_rig("paper_moving_output")
    names = {
        "J_m": "rotor.reflected_inertia", "J_sc": "chassis.inertia", "b_s": "spring.damping",
        "b_m": "rotor.reflected_damping", "b_ld": "housing_end.damping", "K_ld": "housing_end.stiffness",
        "K_s": "spring.stiffness",
    }  # fmt: skip
    values = {symbol: rig[name] for symbol, name in names.items()}
    return {**values, "J_od": 0.010, "J_ld": rig["housing_end.inertia"] - 0.010}


def paper_json(tests: PaperTests) -> dict[str, Any]:
    """Return the result file. hz: null where a band has no edge."""
    rig = load_rig("paper_moving_output")
    return {
        "schema": 1,
        "claims": [{**pick(c), **pick(c, "difference agrees")} for c in claims()],
        "findings": strict(findings()),
        "table_2": {name: {"printed": printed, "unit": unit} for name, (printed, unit) in TABLE_2.items()},
        "bands": {name: _bands(b) for name, b in actuator_bands().items()},
        "arrangements": strict(arrangements(rig)),
        "limits": strict(limits(rig)),
        "moving_output": {
            n: {r.name: strict(r.held_out) for r in test.rivals} for n, test in tests.moving.items()
        },
    }


def _bands(b: Bands) -> dict[str, Any]:
    spin = "eq_7_with_spin_hz=eq_7_spin eq_7_with_spin_hz_90_percent_of_rotor_inertia=spin_range"
    return {
        **pick(b, f"eq_7_hz=eq_7 {spin}"),
        "tolerances_db_deg": strict(TOLERANCES),
        "exact": strict(b.rows),
        **pick(b, "spring_limit"),
        "motor_limit": [{"hz": f, "torque": t} for f, t in b.motor_limit.items()],
    }


EQUATIONS = """\
(1)   T_d/T_m = K_s / (J_eff s² + b_eff s + K_s)                         lumped
(2)   T_p/T_m = (J_eff s² + b_s s + K_s) / (J_eff s² + b_eff s + K_s)    lumped
(3)   T_d/T_p = K_s / (J_eff s² + b_s s + K_s)                           lumped
(4)   T_d/T_m = K_s / den,                                               the same function as (1)
      den = (J_rotor N² + J_sc) s² + (b_rotor N² + b_s) s + K_s
(5)   T_p/T_m = (J_sc s² + b_s s + K_s) / den                            exact: J_sc + n J_r
(6)   T_d/T_p = K_s / (J_sc s² + b_s s + K_s)                            exact: J_sc + n J_r
(7)   bandwidth = √(0.292 K_s / J_sc) / 2π                               +3 dB, undamped
(8)   T = 2 K (R² + r_s²/3) sin θ cos θ                                  at most K_s/2, at 45°
(9)   K_s = 2 K (R² + r_s²/3) (2 cos² θ − 1)                             slope of (8)
(10)  1560.436 / (s² + 27.267 s + 1638.783)                              0.952 at rest, not 1"""

TABLE_1 = (
    ("Stiffness", "K/s", "Capacitance", "1/(C s), C = 1/K"),
    ("Rotary inertia", "J s", "Inductance", "L s, L = J"),
    ("Damping", "B", "Resistance", "R = B"),
    ("Gears", "N²", "Transformer", "Mu²"),
)


def claims_table(claims: Sequence[PaperClaim]) -> html.Html:
    """Return printed beside our numbers; only results of the paper's own numbers are counted."""
    recomputed = [c for c in claims if c.status == "found"]
    agree = sum(c.agrees for c in recomputed)
    shown = html.listed(
        claims,
        ("Where", lambda c: c.where),
        ("What", lambda c: c.what),
        ("#Printed", lambda c: c.printed),
        ("#Ours", lambda c: words.number(c.ours, 5)),
        ("", lambda c: words.unit(c.unit)),
        (
            "#Difference",
            lambda c: "to the last digit" if c.agrees else f"{words.signed_text(100 * c.difference, 2)} %",
        ),
        ("", lambda c: c.status),
        ("Ours comes from", lambda c: c.how),
    )
    return html.section(
        f"{agree} of the {len(recomputed)} numbers that others of the paper make come out to the last digit",
        shown,
        caption="found: the paper's numbers alone make it, and only these count. silent: one that is needed "
        "is not printed. unclear: tuned by the paper, or only bounded by other sources.",
    )


def findings_list(findings: Sequence[PaperFinding]) -> html.Html:
    """Return where the paper contradicts itself or is silent."""
    counts = {status: sum(f.status == status for f in findings) for status in ("found", "silent", "unclear")}
    title = (
        f"{counts['found']} contradictions, {counts['unclear']} statements with two readings, "
        f"{counts['silent']} things left unsaid"
    )
    columns = ("", lambda f: html.named(f.where, f.status)), ("", lambda f: f.text)
    return html.section(title, html.listed(findings, *columns))


def _table_1() -> html.Html:
    """Return Table 1 and the drawings."""
    return html.section(
        "Table 1 and Figs. 6 to 8: the same machine as a circuit",
        html.table(["Mechanical", "Impedance", "Electrical", "Impedance"], TABLE_1),
        *(html.Html(f"<h3>{escape(of)}</h3>{figures.circuit(n)}") for n, of in _DRAWINGS.items()),
        caption="Torque is voltage, velocity is current.",
    )


def table_2(rig_values: Mapping[str, float]) -> html.Html:
    """Return Table 2 beside the rigs' values."""

    def used(name: str) -> str:
        if name in rig_values:
            return words.number(rig_values[name], 4)
        return "clamped, exact" if TABLE_2[name][0] == "1e8" else "behind the clamp"

    shown = html.listed(
        TABLE_2,
        ("Parameter", str),
        ("#Printed", lambda n: TABLE_2[n][0]),
        ("", lambda n: words.unit(TABLE_2[n][1])),
        ("#In our rigs", used),
    )
    caption = "The paper's proximal end (lp) is the one fixed to the frame; units without the per-radian."
    return html.section("Table 2, as printed and as simulated here", shown, caption=caption)


def bands_table(actuators: Mapping[str, Bands]) -> html.Html:
    """Return Eq. (7) and the exact bands of the actuators."""
    tolerances = [f"#±{db:g} dB" + (f", ±{deg:g}°" if deg < 90 else "") for db, deg in TOLERANCES]
    parts, none = [], [""] * (len(tolerances) - 1)
    for name, b in actuators.items():
        rows = [
            ["Eq. (7) as printed", f"{b.eq_7:.1f}", *none],
            ["Eq. (7) with the rotor's spin", f"{b.eq_7_spin:.1f}", *none],
            ["the same over 90 % of J_m", " to ".join(map(words.hertz, b.spin_range)), *none],
            *([what, *map(words.hertz, hz)] for what, hz in b.rows.items()),
        ]
        motor = ", ".join(f"{t:.2g} N·m at {f:.3g} Hz" for f, t in b.motor_limit.items())
        limits = f"Amplitude: {b.spring_limit:.0f} N·m at 5° of the spring; from the motor {motor}."
        body = html.table(["|T_d/T_p| within, Hz", *tolerances], rows)
        parts += [html.Html(f"<h3>{escape(name)}</h3>"), body, html.paragraph(limits, "caption under")]
    return html.section(
        "Up to where each is a pure torque source depends on the tolerance, the sensor and the rotor's spin",
        *parts,
        caption="Exact: roots of polynomials in the frequency. Motor: continuous torque, both ends clamped. "
        "J_m within the rig's spread: Table 2's for the platform, our estimate for the prototype. Which "
        "spline of the prototype's drive is held is not printed: n = −160 or +161, never +160.",
    )


NAMES = {"chassis": "chassis (T-RSEA)", "housing": "housing (RT-RSEA)"}


def arrangements_table(rows: Sequence[Arrangement], limits: Sequence[Limit]) -> html.Html:
    """Return transfer functions and limits of all arrangements."""

    def at(limit: Limit) -> str:
        shown = (words.number(v, 1) if v < 1e4 else f"{v:.0e}" for v in limit.values)
        return " → ".join(shown) if limit.of else ""

    shown = html.listed(
        rows,
        ("Beside the spring", lambda r: NAMES[r.beside_spring]),
        ("Train", lambda r: words.train(r.train)),
        ("#n", lambda r: words.signed_text(r.ratio, 0)),
        ("#J_out, kg·m²", lambda r: f"{r.outer:.4f}"),
        ("#J_in, kg·m²", lambda r: words.signed_text(r.inner, 5)),
        ("#±3 dB, Hz", lambda r: words.hertz(r.band)),
    )
    reached = html.listed(
        limits,
        ("Limit", lambda x: x.what),
        ("of", lambda x: x.of.split(",")[0]),
        ("at", at),
        ("#largest difference, 0.5 to 140 Hz", lambda x: " → ".join(f"{e:.1e}" for e in x.errors)),
    )
    return html.section(
        "T-RSEA and RT-RSEA, every train, lumped and unlumped: one table",
        html.equation(
            "den = J_out s² + (b_m + b_s) s + K_s\nJ_out = J_sc + n² J_r      J_in = J_sc + n J_r "
            "(lumped: J_out)      J_r = J_m/N²\nT_d/T_m = (b_s s + K_s)/den      "
            "T_p/T_m = (J_in s² + b_s s + K_s)/den"
        ),
        shown,
        html.Html("<h3>Limits</h3>"),
        reached,
        caption="Both ends clamped, the platform's values, J_sc the inertia of the part beside the spring. "
        "An RT-RSEA is held by its gear's output: the rotor turns 1 − n times for one turn of the housing, "
        "so its spin changes sign, and with it which inertia beside the spring gives the widest band.",
    )


def moving_table(tests: Mapping[str, MovingOutput]) -> html.Html:
    """Return how much of the held-out torque each model explains, for every test and sensor."""
    rows = []
    for name, model, j in (
        (n, r.name, j) for n, test in tests.items() for r in test.rivals for j in r.held_out
    ):
        end = "spring end" if j.sensor == "spring_end" else "housing end (never fitted)"
        off = f"none: off by {j.rms_error / j.rms:.0f} times"
        share = f"{100 * j.explained:.2f} %" if j.explained > 0.0 else off
        rows.append([name.replace("_", " "), model, end, share, f"{j.rms_error:.3f}", f"{j.rms:.2f}"])
    head = [
        "Bench",
        "Model",
        "Sensor",
        "#Variance explained, held out",
        "#RMS error, N·m",
        "#RMS torque, N·m",
    ]
    return html.section(
        "With both ends moving a sensor at the distal end alone cannot tell the models apart; one at the "
        "other end can",
        html.table(head, rows),
        caption="Fitted to the first half of the spring end's record, tested on the second half, and on "
        "the other sensor, which no fit has seen. The lumped model is fitted with loose priors. The benches "
        "are unlumped by construction.",
    )

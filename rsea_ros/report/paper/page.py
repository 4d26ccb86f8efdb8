"""The paper recomputed: one HTML page, and paper.json with every number beside ours."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import inner_inertia, pure_torque_bandwidth
from rsea_ros.paper.bands import TOLERANCES, Bands, arrangements, bands, limits
from rsea_ros.paper.claims import PROTOTYPE_TRAINS, TABLE_2, claims
from rsea_ros.paper.findings import findings
from rsea_ros.paper.rival_models import MovingOutput, lumped_rig as lumped_model
from rsea_ros.report import words
from rsea_ros.report.page import Block, key_numbers, page
from rsea_ros.report.paper import figures, tables
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
    blocks: list[Block] = [
        key_numbers(_keys()), tables.claims_table(claims()), tables.findings_list(findings()),
        tables.equations_section(), tables.table_1(_drawings()), tables.table_2(_rig_values()),
        *figures.figure_9(), figures.figure_15(tests.high_impedance), figures.figure_18(first),
        figures.figure_18_as_printed(), tables.moving_table(tests.moving), figures.figure_20(),
        tables.bands_table(actuator_bands()), tables.arrangements_table(arrangements(rig), limits(rig)),
    ]  # fmt: skip
    return page(_title(first), _KICKER, blocks, _FOOTER)


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


def _title(test: MovingOutput) -> str:
    unlumped, lumped = (100.0 * rival.held_out[0].explained for rival in test.rivals)
    return (
        f"A moving output separates the models: unlumped {unlumped:.2f} % of a simulated bench's torque, "
        f"lumped {lumped:.0f} %. Eq. (7) leaves out the rotor's spin"
    )


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


def _drawings() -> list[tuple[str, str]]:
    return [
        ("Fig. 6: between two loads. Z_m = b_m and the rotor, Z_s = b_s + K_s/s", figures.circuit("general")),
        (
            "Fig. 7: both ends clamped. The branches of the loads are open (the paper's text: "
            "short-circuited; the figure itself we have not seen)",
            figures.circuit("lumped"),
        ),
        (
            "Fig. 8: the epicyclic train as a three-port. Mu_1 = 502, Mu_2 = 1 with our direction of ω_h "
            "(paper: −1; its polarity dots we have not seen)",
            figures.circuit("epicyclic"),
        ),
    ]


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
        "exact": {row.what: strict(row.hz) for row in b.rows},
        **pick(b, "spring_limit"),
        "motor_limit": [{"hz": f, "torque": t} for f, t in b.motor_limit.items()],
    }

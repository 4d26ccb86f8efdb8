"""Joints commanded by positions, identified in their loop: values, gains, and what is not determined."""

from dataclasses import replace

import pytest

from rsea_ros import simulate
from rsea_ros.checks.check import check_record
from rsea_ros.identification.excitation import JOINT, excitation
from rsea_ros.identification.identify import identify
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.remark_words import remark_sentences

TRUE = {
    "rotor.reflected_inertia": 0.03, "rotor.reflected_damping": 0.35, "spring_end.gravity": 0.6,
    "controller.k_p": 22.0,
}  # fmt: skip


def run(rig):
    targets = excitation("chirp", replace(JOINT, duration=15.0))
    return simulate(rig, targets, JOINT.rate, seed=4)


def doubted(rig, *names):
    """Return a rig of which some values are doubted."""
    spread = {n: replace(rig.quantities[n], spread=0.3) for n in names}
    return replace(rig, quantities={**rig.quantities, **spread})


def value(result, name):
    """Return an estimate and its one sigma."""
    estimate = next(p for p in result.parameters if p.name == name)
    return estimate.value, (estimate.ci95[1] - estimate.ci95[0]) / 3.92


@pytest.fixture(scope="module")
def stiff():
    """Return a joint with a rigid shaft and a known rotor inertia."""
    rig = load_rig("pd_joint")
    kept = {n: q for n, q in rig.quantities.items() if n.split(".")[0] != "spring"}
    known = frozenset({"gear.ratio", "spring_end.inertia"})
    return replace(rig, quantities=kept, rigid_spring=True, known=known)


def test_position_and_current_determine_the_values_and_a_doubted_gain(stiff):
    nominal = doubted(stiff, "controller.k_p")
    result = identify([run(stiff.with_values(TRUE))], nominal)
    assert result.verdict == "adequate"
    for name, true in TRUE.items():
        estimate, sigma = value(result, name)
        assert abs(estimate - true) < 4.0 * sigma + 0.002 * true
        assert sigma < 0.05 * true


def test_without_a_current_only_ratios_to_the_gains_are_determined(stiff):
    free = ("controller.k_p", "controller.k_d", "spring_end.inertia", "controller.torque_limit")
    nominal = replace(doubted(stiff, *free), known=frozenset({"gear.ratio"}))
    whole = run(stiff.with_values({n: v for n, v in TRUE.items() if n != "controller.k_p"}))
    only = replace(whole, channels={n: whole[n] for n in ("reference", "position")})
    result = identify([only], nominal)
    assert any("controller.k_p" in s and "identifiable" in s for s in remark_sentences(result.remarks))
    assert any("loop's gains" in s for s in remark_sentences(result.remarks))
    estimate, sigma = value(result, "controller.k_p")
    assert sigma > 0.1 * estimate


def test_the_checks_mention_targets_and_not_commands(stiff):
    record = run(stiff)
    findings = check_record(record, stiff)
    assert findings.light != "red"
    assert {f.unit for f in findings.of("excitation")} == {"rad"}
    assert "command" not in {f.channel for f in findings.findings}
    without = replace(record, channels={"position": record["position"]})
    assert [f.channel for f in check_record(without, stiff).findings] == ["reference"]

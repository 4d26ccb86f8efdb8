"""One file that RSEA_EFFECTS names is an effect everywhere: nothing else knows effects by their names."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from effect_bench import RIG, command
from runs import trying

from rsea_ros.cli.export import exporter
from rsea_ros.control.compensation import compensation
from rsea_ros.control.law import responses, sample_rig
from rsea_ros.control.uncertainty import lag_responses
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.naming.conclusion import undetermined_play
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.identification.identify import identify
from rsea_ros.identification.unknowns import start_vector, unknowns_of_effect
from rsea_ros.laws.choice import fitted_base
from rsea_ros.model.observer.assemble import without_delay
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.plugins import TARGETS, in_extras
from rsea_ros.report.diagnosis.figures import part_of

PADDLE = '''
"""Torque of a paddle in oil: between dry and viscous friction.

    T = -coefficient * sqrt(|w|) * sign(w)

Source: this test.
"""

import math

from rsea_ros.compiler import njit
from rsea_ros.effects._friction import PRESLIDING, against, mean_friction
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import GEAR_TORQUE, GEAR_VELOCITY, Port


@njit(inline="always")
def level(p, w):
    return p[0] * math.sqrt(abs(w))


@compiled
def apply(s, p, x):
    x[0] = mean_friction(s, level(p, s[GEAR_VELOCITY]), x[0], p[1])
    s[GEAR_TORQUE] -= x[0]


def guesses(defaults, view):
    return [{**defaults[0], "coefficient": share * (view.largest_command() or 1.0)} for share in (0.1, 0.3)]


EFFECT = Effect(
    name="paddle",
    port=Port.GEAR,
    parameters=(
        Parameter("coefficient", "N m", null=0.0, low=0.0, high=200.0, typical=8.0, reason="of the paddle"),
        PRESLIDING,
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=None, passive=True),
    function=apply,
    states=1,
    reads=(GEAR_VELOCITY,),
    guesses=guesses,
    tags=("friction",),
    compensation=against(level, creep=1),
    part="support",
    about="a paddle in oil",
    equation="T = -coefficient · √|ω| · sign(ω), smooth below creep_velocity",
)
'''
ANOTHER_NAME = '''
"""The effect {old} under another name."""

from dataclasses import replace

from rsea_ros.effects.{old} import EFFECT as _KNOWN

EFFECT = replace(_KNOWN, name="{new}")
'''
SIZE = {"coefficient": 8.0, "creep_velocity": 2e-3}


@pytest.fixture(scope="module", autouse=True)
def outside(tmp_path_factory):
    folder = tmp_path_factory.mktemp("effects")
    (folder / "paddle.py").write_text(PADDLE)
    for old, new in (("command_delay", "late_bus"), ("backlash", "worn_key")):
        (folder / f"{new}.py").write_text(ANOTHER_NAME.format(old=old, new=new))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RSEA_EFFECTS", str(folder))
        yield


@pytest.fixture(scope="module")
def record():
    return synthesize(with_paddle(), command(280.0, 10.0), seed=3)


def with_paddle():
    return RIG.with_effect("paddle", **SIZE)


def test_an_outside_effect_is_simulated_and_identified(record):
    guessed = RIG.with_effect("paddle", **(SIZE | {"coefficient": 3.0}))
    identified = identify([record], guessed)
    sizes = {p.name: p.value for p in identified.parameters}
    assert sizes["paddle.coefficient"] == pytest.approx(8.0, rel=0.1)
    assert set(catalogue()) > {"paddle", "late_bus", "worn_key", "coulomb_friction"}


def test_a_diagnosis_names_an_outside_effect(record):
    settings = trying("paddle", "coulomb_friction", "damping_drift", max_causes=1)
    diagnosis = diagnose([record], RIG, settings=settings)
    assert [cause.name for cause in diagnosis.causes] == ["paddle"]
    assert diagnosis.causes[0].parameters["coefficient"].value == pytest.approx(8.0, rel=0.1)
    assert part_of(effect_named("paddle")) == "support"


def test_a_law_is_searched_beside_an_outside_effect(record):
    base = fitted_base([record], with_paddle())
    assert base.solution.values["paddle.coefficient"] == pytest.approx(8.0, rel=0.1)


@pytest.mark.parametrize("target", ["mjcf", *in_extras(TARGETS)])
def test_an_export_says_what_becomes_of_an_outside_effect(target):
    rig = load_rig("pendulum" if target in ("bam", "isaac") else "paper_moving_output")
    exported = exporter(target)(rig.with_effect("paddle", **SIZE))
    assert ("paddle" in exported.leaves_out) == (target != "fmu") == ("paddle" not in exported.says), target


def test_the_controller_compensates_an_outside_effect_by_the_law_of_the_step():
    mean = 8.0 * np.mean(np.sqrt(np.linspace(0.19, 0.21, 20001)))
    assert compensation(with_paddle()).friction(0.19, 0.21) == pytest.approx(mean, rel=1e-3)
    assert compensation(with_paddle(), ()).friction(0.19, 0.21) == 0.0
    assert compensation(RIG.with_effect("worn_key", gap=3e-3)).gap == 3e-3, "crossed"


def test_a_joint_reports_play_of_another_name_that_its_data_do_not_show():
    gap, _ = unknowns_of_effect(effect_named("worn_key"), {"gap": 2e-3})
    problem = SimpleNamespace(unknowns=(gap,))
    trial = SimpleNamespace(name="worn_key", problem=problem, theta=start_vector((gap,)))
    rejected = SimpleNamespace(name="worn_key", gain_holdout=0.004)
    last = SimpleNamespace(problem=SimpleNamespace(rig=SimpleNamespace(loop="pd")))
    (remark,) = undetermined_play(SimpleNamespace(trials=(trial,), last=last), (), (rejected,))
    assert remark.code == "play_undetermined" and remark.values == pytest.approx((2e-3, 0.004))


def test_a_delay_of_another_name_is_treated_as_a_delay():
    rig = RIG.with_effect("late_bus", delay=4e-3)
    assert without_delay(rig) == (RIG.with_effects(), 4e-3)
    hz, plant = np.array([10.0]), sample_rig(RIG, 280.0)
    response, path = lag_responses(rig, plant, hz)
    assert path[0] == pytest.approx(np.exp(-2j * math.pi * 10.0 * 4e-3))
    np.testing.assert_array_equal(response, responses(plant, hz))

"""What a designed run says: sentences, figures, tables and experiment.json, of numbers that are given."""

import json
import math
import re
from dataclasses import dataclass
from types import SimpleNamespace as Of

import numpy as np
import pytest

from rsea_ros.experiment.hypothesis import NOTHING
from rsea_ros.report import experiment as said
from rsea_ros.report.figures import figure as fig

RATE = 200.0
T = np.arange(2000) / RATE
COMMAND = 4.0 + 12.0 * np.sin(2.0 * np.pi * 5.0 * T)
NAMES = ("backlash", "coulomb_friction")


@dataclass(frozen=True)
class Shape:
    kind: str
    bias: float
    low: float = 0.512
    high: float = 41.96
    hold: float = 0.254


def proposal(kind: str = "multisine", bias: float = 0.0, names=NAMES, **more: object) -> Of:
    shape = Shape(kind, bias)
    base = {
        "shape": shape,
        "command": COMMAND,
        "rate": RATE,
        "duration": 10.0,
        "names": names,
        "peaks": Of(expected={"torque": 15.0, "velocity": 0.5}, at_level={"torque": 17.96, "velocity": 0.75}),
        "worst": ("backlash", "coulomb_friction", 7.25),
        "decided": 0.914,
        "sharpened": math.log(4.0),
        "table": np.array([[0.0, 7.25], [12_345.0, 0.0]]),
        "tried": 31,
        "resolved": 0.9,
    }
    return Of(**(base | more))


def cause(name: str, probability: float, count: int = 1) -> Of:
    return Of(name=name, probability=probability, cause_indices=tuple(range(count)), theta=np.zeros(3),
              problem=Of(rig=Of(name="paper")))  # fmt: skip


ASKED = Of(limits=Of(finite_limits=lambda: {"torque": 20.0}))
APART = (Of(what="the torque with a lever", separation=40.0), Of(what="the angle by hand", separation=9.0))
PROOF = Of(
    bound=Of(
        true="backlash", rival="hard_stop", frequency=np.array([0.2, 3.0, 119.6]), duration=59.6, most=1.234
    ),
    apart=APART,
)


def advice(p, *hypotheses, proofs=(), excluded=None) -> Of:
    return Of(proposal=p, hypotheses=hypotheses, proofs=proofs, excluded=excluded or {}, asked=ASKED)


TWO = cause("backlash", 0.7), cause("coulomb_friction", 0.3)
SHAPE = "multisine 0.51 to 42 Hz, 10 s, up to 18 N·m"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (proposal(), SHAPE),
        (proposal("chirp", 0.021), "chirp 0.51 to 42 Hz around 4.0 N·m, 10 s, up to 18 N·m"),
        (proposal("chirp", 0.019), "chirp 0.51 to 42 Hz, 10 s, up to 18 N·m"),
        (proposal("steps"), "steps of 0.25 s, 10 s, up to 18 N·m"),
    ],
)
def test_the_shape_of_a_run(given, words) -> None:
    assert said.shape_words(given) == words


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (advice(None, *TWO), "No run within the limits separates backlash and Coulomb friction"),
        (
            advice(proposal(), *TWO),
            "The next run is expected to decide between backlash and Coulomb friction in 91 % "
            f"of cases: {SHAPE}",
        ),
        (
            advice(proposal(), cause("backlash", 1.0)),
            f"The next run narrows the interval of backlash 4 times: {SHAPE}",
        ),
        (
            advice(proposal(), cause("backlash", 1.0, 2)),
            f"The next run narrows the intervals of backlash 2 times on average: {SHAPE}",
        ),
        (
            advice(proposal(sharpened=2.0 * math.log(1.009)), cause("backlash", 1.0, 2)),
            f"No run within the limits narrows the intervals of backlash; the best: {SHAPE}",
        ),
        (
            advice(proposal(), cause(NOTHING, 1.0)),
            "No cause is in doubt; a run can only narrow the intervals of the "
            f"rig, and this one does most: {SHAPE}",
        ),
        (
            advice(proposal(), cause("backlash", 1.0, 0)),
            f"The next run narrows the intervals of backlash 1.59 times on average: {SHAPE}",
        ),
    ],
)
def test_the_answer_in_a_sentence(given, words) -> None:
    assert said.verdict(given) == words


def test_why_no_run_separates_a_pair() -> None:
    assert said.proof_words(PROOF) == (
        "backlash and hard stop: no run of 60 s with a spectrum in 0.2 to 120 Hz within the limits separates "
        "them by more than S = 1.2 (6 makes odds of twenty to one). Measure separately: the torque with a "
        "lever; or the angle by hand."
    )


def test_what_is_possible_and_what_it_demands() -> None:
    rows = said.possible_rows(advice(None, *TWO, excluded={"hard_stop": 0.0004}))
    assert rows == [
        ("backlash", "probability 0.700 among these"),
        ("Coulomb friction", "probability 0.300 among these"),
        ("hard stop", "excluded by the records: probability 0.0004"),
    ]
    assert said.possible_rows(advice(None, cause(NOTHING, 1.0))) == [("no cause at all", "no rival given")]
    torque, velocity = said.limit_rows(proposal(), {"torque": 20.0})
    assert torque == ("torque", "15", "17.96", "20", "N·m") and velocity[1:4] == ("0.5", "0.75", "none")


def test_the_page_of_a_design_shows_what_it_has() -> None:
    page = said.advice_page(advice(proposal(), *TWO, proofs=(PROOF,)))
    for words in ("10 s", "18 N·m", "7.25", "S of backlash over Coulomb friction, the worst pair", "91 %",
                  "expected to be decided", "Causes that the run separates", "1e+04", "Demands on the bench",
                  "Not separable by any run", "The next experiment · paper", "Still possible"):  # fmt: skip
        assert words in page
    alone = said.advice_page(advice(proposal(names=("backlash",), worst=None), cause("backlash", 1.0)))
    absent = ("expected to be decided", "worst pair", "Causes that the run separates", "Not separable")
    assert not any(words in alone for words in absent)
    assert "Demands" not in said.advice_page(advice(None, *TWO))


def test_the_figures_show_the_command_and_its_density() -> None:
    drawn = said.command_figure(proposal())
    assert drawn.title == f"The run: {SHAPE}" and drawn.data[0]["y"][:3] == pytest.approx(
        COMMAND[:3], abs=1e-3
    )
    assert (
        drawn.data[0]["x"][1] == pytest.approx(1.0 / RATE)
        and drawn.layout["xaxis"]["title"]["text"] == "time, s"
    )
    f, density = said.density_of(COMMAND, RATE)
    assert f[np.argmax(density)] == pytest.approx(5.0, rel=0.05)
    one = said.spectrum_figure([("run", proposal())])
    several = said.spectrum_figure([(f"run {k}", proposal()) for k in range(4)])
    assert (one.title, several.title) == ("Where the run puts its power", "Where the runs put their power")
    looks = [(trace["line"]["color"], trace["line"]["dash"]) for trace in several.data]
    assert looks == [(fig.AFTER, "solid"), (fig.BEFORE, "dash"), (fig.QUIET, "dot"), (fig.AFTER, "dashdot")]
    assert said.spectrum_figure([("a", proposal()), ("b", proposal())]).title == several.title
    low, high = one.layout["yaxis"]["range"]
    top = math.log10(max(density))
    assert (low, high) == pytest.approx((top - 3.0, top + 0.3), abs=1e-3) and one.height == 320


def rounds(*probabilities: dict[str, float]) -> list[Of]:
    return [Of(weighing=Of(probability=p, left=1.1), proposal=proposal() if k else None)
            for k, p in enumerate(probabilities)]  # fmt: skip


def test_the_probabilities_after_each_run() -> None:
    outcome = Of(
        rounds=rounds(
            {"backlash": 0.5, "hard_stop": 0.49, "ft_bias": 0.01}, {"backlash": 0.9, "hard_stop": 0.02}
        )
    )
    drawn = said.probability_figure(outcome)
    assert [trace["y"] for trace in drawn.data] == [[0.5, 0.9], [0.49, 0.02]]
    assert [trace["line"]["color"] for trace in drawn.data] == [fig.AFTER, fig.BEFORE]
    axis = drawn.layout["xaxis"]
    assert axis["ticktext"] == ["first records", "after run 1"] and axis["range"] == [-0.2, 1.2]
    assert said.run_count(outcome) == ("1", "run")
    assert said.run_count(Of(rounds=rounds({}, {}, {}))) == ("2", "runs") and said.run_count(
        Of(rounds=[])
    ) == ("0", "runs")
    assert said.known_causes(Of(probability={"backlash": 0.01, "hard_stop": 0.989, "ft_bias": 0.001})) == (
        "known: hard stop 0.99, backlash 0.01"
    )


def test_the_causes_that_no_run_tells_apart() -> None:
    weighing = Of(probability={"backlash": 0.6, "hard_stop": 0.4})
    outcome = Of(shared=Of(names=("backlash", "hard_stop"), torque=33.3), weighing=weighing)
    head = "backlash (0.60) or hard stop (0.40): no run within the limits shows which"
    assert said.shared_words(outcome) == f"{head}; it takes at least about 33 N·m"
    outcome.shared.torque = None
    assert said.shared_words(outcome, " so far") == f"{head} so far"


def test_experiment_json_says_the_same() -> None:
    document = json.loads(json.dumps(said.advice_json(advice(proposal(), *TWO, proofs=(PROOF,)))))
    assert document["causes"] == {"backlash": 0.7, "coulomb_friction": 0.3} and document["limits"] == {
        "torque": 20.0
    }
    assert document["schema"] == 1 and document["sentence"].endswith(SHAPE) and document["excluded"] == {}
    run, (proof,) = document["run"], document["no_run_separates"]
    assert [(p["true"], p["rival"], p["separation"]) for p in run["separations"]] == [
        ("backlash", "coulomb_friction", 7.25),
        ("coulomb_friction", "backlash", 12345.0),
    ]
    assert run["peaks_expected"]["torque"] == 15.0 and run["peaks_at_level"]["torque"] == 17.96
    assert (run["duration_s"], run["rate_hz"], run["decided"], run["shapes_judged"]) == (
        10.0,
        200.0,
        0.914,
        31,
    )
    assert run["narrowed_nats"] == pytest.approx(math.log(4.0))
    assert proof["causes"] == ["backlash", "hard_stop"] and proof["band_hz"] == [0.2, 119.6]
    assert (proof["at_most"], proof["duration_s"]) == (1.234, 59.6) and "lever" in proof["sentence"]
    assert proof["measure_apart"][1] == {"what": "the angle by hand", "separation": 9.0}
    assert said.advice_json(advice(None, *TWO))["run"] is None
    assert re.fullmatch(r"0\.9\d+", str(document["limits_hold_with_probability"]))

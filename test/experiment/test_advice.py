"""A proof that no run separates two models stands on the larger of both bounds, and on linear laws alone."""

from types import SimpleNamespace

import pytest

from rsea_ros.experiment import advice
from rsea_ros.experiment.advice import HOPELESS, proofs_of


def hypothesis(name, *effects):
    rig = SimpleNamespace(effects=[SimpleNamespace(name=e) for e in effects])
    return SimpleNamespace(name=name, problem=SimpleNamespace(rig=rig))


@pytest.mark.parametrize(
    ("forth", "back", "proven"),
    [
        (0.3, 0.1, ("play", "lag")),
        (0.1, 0.3, ("lag", "play")),
        (0.99 * HOPELESS, 0.0, ("play", "lag")),
        (HOPELESS, 0.0, None),
        (0.0, HOPELESS, None),
    ],
)
def test_the_larger_bound_counts(monkeypatch, forth, back, proven):
    def bound(true, rival, limits, seconds, noise, rate, run):
        assert (limits, noise, rate) == ("limits", {"ft": 0.1}, 280.0)
        return SimpleNamespace(most=forth if true.name == "play" else back)

    monkeypatch.setattr(advice, "bound", bound)
    monkeypatch.setattr(advice, "noise_by_channel", lambda hypotheses, measured: measured)
    monkeypatch.setattr(advice, "measurements_apart", lambda b, *both: [(b.most, *(h.name for h in both))])
    pair = hypothesis("play", "ft_bias"), hypothesis("lag")
    asked = SimpleNamespace(limits="limits", rate=280.0)
    proofs = proofs_of(pair, [("play", "lag")], asked, {"ft": 0.1})
    if proven is None:
        assert proofs == ()
    else:
        ((larger, apart, _),) = [tuple(vars(p).values()) for p in proofs]
        assert larger.most == max(forth, back) and apart == ((max(forth, back), *proven),)


@pytest.mark.parametrize(
    ("effects", "is_linear"), [((), True), (("viscoelastic_spring",), True), (("coulomb_friction",), False)]
)
def test_a_proof_says_whether_all_laws_are_linear(monkeypatch, effects, is_linear):
    monkeypatch.setattr(advice, "bound", lambda *a: SimpleNamespace(most=0.0))
    monkeypatch.setattr(advice, "noise_by_channel", lambda hypotheses, measured: {})
    monkeypatch.setattr(advice, "measurements_apart", lambda b, true, rival: [])
    pair = hypothesis("a", "viscoelastic_spring"), hypothesis("b", *effects)
    (proof,) = proofs_of(pair, [("a", "b")], SimpleNamespace(limits=None, rate=1.0), {})
    assert tuple(vars(proof).values())[-1] is is_linear

"""The criteria: when a candidate is accepted, which of several, and the verdict.

A candidate is preferred when it is surely better on the validation blocks, to which neither model was fitted,
and when that matters. Sure: the block bootstrap of the difference of the losses lies above zero at 95 %, each
parameter paid for by the loss that a useless one would gain (Akaike, IEEE TAC 19, 1974). It matters: the
residual of some channel falls by more than a few percent, or a response that noise hides is no longer missed.
It is accepted when, besides, it takes away enough (`refusal`). The verdict compares the test blocks with the
noise. All numbers are in DiagnosisSettings.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.candidate import Candidate
from rsea_ros.diagnosis.result import Reason, Status, Verdict
from rsea_ros.diagnosis.score import Score, bootstrap_means, tempered_deviance
from rsea_ros.diagnosis.settings import DEFAULT, AcceptanceSettings, DiagnosisSettings, FloorSettings
from rsea_ros.identification.result import silent_channels
from rsea_ros.records.record import Fault


@dataclass(frozen=True)
class Preference:
    """Whether a model is surely better than another, and whether that matters."""

    sure: bool
    matters: bool

    @property
    def better(self) -> bool:
        """Return whether the model is to be preferred."""
        return self.sure and self.matters


def preference(
    model: Score, other: Score, extra_parameters: int = 0, rule: AcceptanceSettings = DEFAULT.acceptance
) -> Preference:
    """Compare a model with another by their scores. extra_parameters: how many more the model has."""
    difference = other.loss(other) - model.loss(other)
    price = rule.price * extra_parameters / len(difference)
    means = bootstrap_means(difference - price, rule.resamples)
    shows_response = model.missed < 0.5 * other.missed  # sees most of it
    return Preference(
        sure=bool(np.quantile(means, rule.doubt) > 0.0),
        matters=max(falls(model, other), default=0.0) > rule.matters or shows_response,
    )


def falls(model: Score, other: Score) -> list[float]:
    """Return by how much the residual of each channel falls from another model to this one, relatively."""
    return [1.0 - model.ratio(n) / max(other.ratio(n), 1e-12) for n in model.sums]


def refusal(model: Candidate, current: Candidate, settings: DiagnosisSettings = DEFAULT) -> Reason | None:
    """Return why a model may not take the place of the current one; None where it may.

    An effect at a bound imitates another one. A pair, and one more cause beside several that leave much,
    are in doubt: they must take away more, and from the worst channel.
    """
    rule = settings.acceptance
    if model.is_at_bound:
        return "at_bound"
    over_current = preference(
        model.validation, current.validation, model.parameters - current.parameters, rule
    )
    if not over_current.better:
        return "too_small" if over_current.sure else "not_sure"
    if likelier_by(model, current, settings.floor.far) < 0.0:
        return "leaves_priors"
    if worst_ratio(model) < settings.floor.only_noise:
        return None
    is_one_more = len(model.causes) == len(current.causes) + 1
    is_late = len(current.causes) >= rule.causes_in_doubt and is_far_from_floor(model, settings)
    if not is_one_more or is_late:
        is_enough = worst_ratio(model) < (1.0 - rule.fall_in_doubt) * worst_ratio(current)
    else:
        is_enough = max(falls(model.validation, current.validation)) > rule.fall
    return None if is_enough else "too_small"


def break_tie(
    models: Sequence[Candidate], current: Score, settings: DiagnosisSettings = DEFAULT
) -> Candidate | None:
    """Return the model to accept.

    The best is the likeliest, the cost of leaving known values included. The simplest is accepted of all that
    are neither surely and materially worse, nor so far from known values that keeping them pays for the
    best's unknowns; of equals, the likeliest, each unknown paid for (an optional one, as the time in which
    a drift settles, does not count in `size`).
    """
    if not models:
        return None
    far = settings.floor.far
    least = min(models, key=lambda m: float(m.validation.loss(current).sum()))
    best = max(models, key=lambda m: likelier_by(m, least, far))

    def contends(m: Candidate) -> bool:
        if best.size > m.size and keeps_known_values(best, m, settings):
            return False
        over = preference(best.validation, m.validation, rule=settings.acceptance)
        return not over.better or is_nearly_as_good(m, best, settings)

    contenders = [m for m in models if m is best or contends(m)]

    def worth(m: Candidate) -> float:
        return likelier_by(m, best, far) - settings.acceptance.price * m.parameters

    return min(contenders, key=lambda m: (m.size, -worth(m)))


def is_nearly_as_good(model: Candidate, best: Candidate, settings: DiagnosisSettings = DEFAULT) -> bool:
    """Return whether a simpler model does nearly as well as the best, which is far from the floor.

    The best one's residual is not noise, and more parameters always fit a little of it.
    """
    if not is_far_from_floor(best, settings):
        return False
    room = 1.0 + settings.acceptance.room * (best.size - model.size)
    return _loss(model, best) < room**2 * _loss(best, best)


def is_equally_good(model: Candidate, other: Candidate, settings: DiagnosisSettings = DEFAULT) -> bool:
    """Return whether a model loses no more than another on the validation blocks, within a tenth."""
    return _loss(model, other) < (1.0 + settings.acceptance.room) * _loss(other, other)


def costs_priors_less(model: Candidate, other: Candidate, settings: DiagnosisSettings = DEFAULT) -> bool:
    """Return whether a model that does as well as another leaves the known values clearly less."""
    return model.prior_cost + loss_excess(model, other) < other.prior_cost - settings.acceptance.prior_gain


def keeps_known_values(model: Candidate, other: Candidate, settings: DiagnosisSettings = DEFAULT) -> bool:
    """Return whether a model keeps the known values so much better that its further unknowns are paid for."""
    rule = settings.acceptance
    price = rule.prior_gain + rule.price * max(model.parameters - other.parameters, 0)
    spared = other.prior_cost - model.prior_cost
    return min(spared, likelier_by(model, other, settings.floor.far)) > price


def is_far_from_floor(model: Candidate, settings: DiagnosisSettings = DEFAULT) -> bool:
    """Return whether a model is far from the noise floor in its worst channel."""
    return worst_ratio(model) >= settings.floor.far


def worst_ratio(model: Candidate) -> float:
    """Return the RMS of the residual over the noise in the worst channel."""
    return max(model.validation.ratio(n) for n in model.validation.sums)


def likelier_by(model: Candidate, other: Candidate, far: float) -> float:
    """Return twice the log of the odds of a model against another.

    far: RMS of the residual over the noise, in the worst channel of both, from which the data are tempered.
    """
    gained = tempered_deviance(model.validation, other.validation, far)
    return gained + other.prior_cost - model.prior_cost


def loss_excess(model: Candidate, best: Candidate) -> float:
    """Return how much more a model loses than the best on the validation blocks, in the best's units."""
    return _loss(model, best) - _loss(best, best)


def _loss(model: Candidate, against: Candidate) -> float:
    return float(model.validation.loss(against.validation).sum())


def verdict_of(
    scores: Sequence[Score], statuses: Sequence[Status | None] = (), levels: FloorSettings = DEFAULT.floor,
    faults: Sequence[Fault] = (),
) -> Verdict:  # fmt: skip
    """Return the verdict of models, from the nominal one to the one with all causes.

    scores: on the test blocks, one a model. statuses: of the cause that each model adds to the one before,
    None for one that is not named. faults: of the data. Where a sensor measures nothing, something is wrong
    that no effect explains (docs/decisions/0063-a-sensor-that-measures-nothing.md).
    `nothing_wrong` and `explained`: the residual is at the noise floor, without causes and with causes that
    are all confirmed. `partly_explained`: causes are named, but not so. `unexplained`: none is named.
    """
    first, last = scores[0], scores[-1]
    if not any(statuses):
        is_fine = is_at_floor(first, levels) and not silent_channels(faults)
        return "nothing_wrong" if is_fine else "unexplained"
    is_whole = is_at_floor(last, levels) and all(status == "confirmed" for status in statuses)
    return "explained" if is_whole else "partly_explained"


def is_at_floor(test: Score, levels: FloorSettings = DEFAULT.floor) -> bool:
    """Return whether every channel is at its noise floor."""
    return all(test.ratio(n) <= levels.reached for n in test.sums)

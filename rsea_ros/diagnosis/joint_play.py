"""What a joint's log says of play in its gear, where play is no cause: people ask for it by name."""

from __future__ import annotations

from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.selection import Selection, Trial
from rsea_ros.effects.catalogue import effect_named


def play_not_told(selection: Selection, result: Diagnosis) -> tuple[str, ...]:
    """Return the sentence for a joint in a position loop whose play these data do not show."""
    if result.baseline_rig.loop is None or any(_is_play(cause.name) for cause in result.causes):
        return ()
    trials = [trial for trial in selection.trials if _is_play(trial.name)]
    gains = {rejected.name: rejected.gain_holdout for rejected in result.rejected}
    if not trials or trials[-1].name not in gains:
        return ()
    gap, change = 1e3 * _gap(trials[-1]), -100.0 * gains[trials[-1].name]
    return (
        f"These data cannot determine the play in the gear: with {gap:.2g} mrad, which fits best, the "
        f"residual of data that took no part changes by {change:+.1f} %.",
    )


def _is_play(name: str) -> bool:
    return "play" in effect_named(name).tags


def _gap(trial: Trial) -> float:
    """Return the gap of a trial with play, rad."""
    main = f"{trial.name}.{effect_named(trial.name).main.name}"
    unknowns = zip(trial.problem.unknowns, trial.theta, strict=True)
    return next(u.outer(float(value)) for u, value in unknowns if u.name == main)

"""What a joint's log says of play in its gear, where play is no cause: people ask for it by name."""

from __future__ import annotations

from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.selection import Selection

PLAY = "backlash"
_GAP = f"{PLAY}.gap"


def play_not_told(selection: Selection, result: Diagnosis) -> tuple[str, ...]:
    """Return the sentence for a joint in a position loop whose play these data do not show."""
    named = {cause.name for cause in result.causes}
    trials = [trial for trial in selection.trials if trial.name == PLAY]
    gains = [rejected.gain_holdout for rejected in result.rejected if rejected.name == PLAY]
    if result.baseline_rig.loop is None or PLAY in named or not (trials and gains):
        return ()
    unknowns = zip(trials[-1].problem.unknowns, trials[-1].theta, strict=True)
    gap = next(u.outer(float(value)) for u, value in unknowns if u.name == _GAP)
    return (
        f"These data cannot determine the play in the gear: with {1e3 * gap:.2g} mrad, which fits best, the "
        f"residual of data that took no part changes by {-100.0 * gains[-1]:+.1f} %.",
    )

"""Settings of the search: when a candidate is accepted, and which candidates are fitted how far."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.diagnosis.settings.number import flat, number


@dataclass(frozen=True)
class AcceptanceSettings:
    """When a candidate is better than another on the validation blocks."""

    doubt: float = number(
        0.025, "1", "quantile of the bootstrap of the gain that must lie above zero", "95 %, two-sided"
    )
    resamples: int = number(
        1000, "1", "draws of every bootstrap over blocks",
        "25 of them lie beyond the quantile: it is known to a fifth",
    )  # fmt: skip
    price: float = number(
        2.0, "1", "loss that each parameter must bring", "what a useless one gains (Akaike 1974)"
    )
    matters: float = number(
        0.02, "1", "fall of some channel's residual below which a gain does not matter", flat("0.005", "0.1")
    )
    response_left: float = number(
        0.5, "1", "share of a missed response (coherence^2) below which seeing it matters by itself"
    )
    fall: float = number(
        0.05, "1", "fall of some channel's residual that one more cause must bring",
        f"{flat('0.03', '0.3')}; several small causes overlap on a real machine",
    )  # fmt: skip
    fall_in_doubt: float = number(
        0.3, "1", "fall of the worst channel for a pair, a replacement, or a third cause that leaves much",
        f"{flat('0.1', '0.5')}; these fit whatever is left, so they must bring six times as much",
    )  # fmt: skip
    causes_in_doubt: int = number(2, "1", "causes from which one more counts as doubtful while far")
    room: float = number(
        0.1, "1", "how much larger the residual of a simpler model may be while far, for each number it saves"
    )
    prior_gain: float = number(
        1.0, "1", "fall of the prior's cost that decides between equals", "odds of 1.6"
    )
    near_bound: float = number(
        1e-6, "1", "share of its span within which a value is at its bound", "rounding of the fit"
    )


@dataclass(frozen=True)
class ForwardSettings:
    """Which effects a forward step fits, and how thoroughly."""

    piece_fits: int = number(
        9, "1", "effects that are fitted to the pieces after the screening", flat("3", "15")
    )
    full_fits: int = number(
        3, "1", "effects of each closeness that are fitted to all training blocks", flat("1", "6")
    )
    behind_first: float = number(4.0, "1", "of the best cost on pieces: how close the first of them must be")
    behind_next: float = number(1.1, "1", "of the best cost on pieces: how close the others must be")
    undecided: float = number(
        0.1, "1", "of what the chosen effect brings: how much less another may bring and still be fitted on",
        "as `room`: so much a simpler law may lose beside a larger one",
    )  # fmt: skip
    hope_one: float = number(
        0.98, "1", "of the current cost on pieces: no hope above it, while far", flat("0.8", "1")
    )
    hope_two: float = number(0.9, "1", "the same for two effects")
    hope_on_angle: float = number(0.5, "1", "the same for an effect simulated on the measured rotor angle")
    moved: float = number(0.02, "1", "change of what a channel leaves, from which a fit is repeated")
    alike: float = number(0.02, "1", "of the loss: a rival so close is refused for its size, not its fit")
    paired: int = number(3, "1", "effects with which pairs begin, and partners that each is tried with")
    paired_fits: int = number(2, "1", "pairs that are fitted to all training blocks")
    smaller_guess: float = number(
        0.1, "1", "share of a first guess that is tried where two linear steps from it led uphill",
        "a tenth of a typical size is nearly linear; without it mild effects were lost (effect_coverage.py)",
    )  # fmt: skip
    screening_steps: int = number(2, "1", "Gauss-Newton steps of an effect's screening, with old derivatives")
    screening_part: float = number(
        0.3, "1", "share of such a step that is tried where the whole one does not lower the cost"
    )
    bent_guesses: int = number(
        2, "1", "guesses that are fitted on after those steps, where derivatives change on the way",
        "the better of two after the steps is not always the better in the end (effect_coverage.py)",
    )  # fmt: skip
    bent_steps: int = number(4, "1", "steps of that fit")
    clear: float = number(
        0.5, "1", "of the current cost on pieces: where an effect leaves less, none is fitted on"
    )
    nearer: float = number(
        0.5, "1", "of the prior's cost of the chosen effect: how near to the rig another keeps its values",
        "the second of a pair is sought beside those, where one effect fits only far from the rig",
    )  # fmt: skip
    causes_beside_a_pair: int = number(
        1, "1", "causes beside which pairs are tried", "beside more of them, a pair fits whatever is left"
    )
    replacements: int = number(2, "1", "steps that may replace a cause, beside those that add one")


@dataclass(frozen=True)
class FitSettings:
    """How far candidates are fitted."""

    first_iterations: int = number(25, "1", "Gauss-Newton steps of the nominal model's first fit")
    iterations: int = number(12, "1", "steps of a fit that begins near its end")
    present_iterations: int = number(5, "1", "steps of the present model's fit to the short pieces")
    piece_iterations: int = number(12, "1", "steps of an effect's fit to the short pieces")
    full_iterations: int = number(6, "1", "steps of an effect's first fit to all training blocks")
    gain: float = number(2e-4, "1", "relative fall of the cost, at the noise, below which a fit is done")
    farthest: float = number(
        20.0, "1", "times the noise up to which that fall grows with the residual",
        "small falls of a residual far above the noise mean nothing",
    )  # fmt: skip
    final_gain: float = number(
        1e-6, "1", "the same for the models that are tested", "far below the doubt of a parameter"
    )

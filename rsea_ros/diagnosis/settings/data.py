"""Settings of the data: blocks of a record, the short pieces, and the levels of a residual."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.diagnosis.settings.number import flat, number
from rsea_ros.identification.result import AT_NOISE


@dataclass(frozen=True)
class BlockSettings:
    """The blocks of a record, and the coherence over them that shows a missed response (coherence.py)."""

    longest: float = number(
        1.0, "s", "length of a block", "longer than a bench's memory: blocks are independent"
    )
    shortest: float = number(
        0.25, "s", "length of a block below which short records have fewer blocks",
        "every part of a short sweep is in training, validation and test",
    )  # fmt: skip
    enough: int = number(
        120, "1", "blocks; a record with fewer of the longest is cut into shorter ones",
        "a quarter of them, 30, test: enough for a bootstrap over blocks",
    )  # fmt: skip
    false_alarm: float = number(
        0.01, "1", "probability that noise alone passes for a missed response in any line of a record",
        "sets the least coherence^2 by the number of blocks (Carter 1987)",
    )  # fmt: skip
    response_clear: float = number(
        0.3, "1", "coherence^2 of residual and command above which a response is missed, however small",
        "with 16 blocks noise alone reaches 0.26 in one line of a hundred",
    )  # fmt: skip
    response_share: float = number(
        0.1, "1", "share of the simulated response up to which an error of it is the simulation's own"
    )
    response_blocks: int = number(
        16, "1", "blocks without faulty samples below which no response counts as missed",
        "of fewer, noise alone is as coherent as a response",
    )  # fmt: skip


@dataclass(frozen=True)
class PieceSettings:
    """The short pieces of the training blocks on which effects are screened."""

    run_up: float = number(
        0.5, "s", "simulated and not compared before a piece", "the measured state decays within it"
    )
    enough: float = number(14.0, "s", "data in all pieces, half of them spread evenly, half at the worst")


@dataclass(frozen=True)
class StretchSettings:
    """The stretches of a long record to which models are fitted and on which they are tested."""

    enough: float = number(
        200.0, "s", "of all records that are simulated, run-ups included; longer records are cut",
        "10 min at 280 Hz are diagnosed within a minute; more data narrow an interval by half at most",
    )  # fmt: skip
    samples: int = number(
        170_000, "1", "samples of the fastest channel that are used, at one per command",
        "160 s at 1 kHz and a little are diagnosed within 1.5 GB",
    )  # fmt: skip
    blocks: int = number(
        16, "1", "blocks in a row at least, a multiple of four", "every one holds all sets in their shares"
    )
    run_up: float = number(
        4.0, "s", "simulated and not compared before a stretch, at least", "friction and play settle in it"
    )
    decays: float = number(
        4.0, "1", "time constants of the rig's slowest motion that a run-up lasts at least",
        "after 3 a sound rig with two swinging ends is at its floor; slots are as long, so there are fewer",
    )  # fmt: skip


@dataclass(frozen=True)
class FloorSettings:
    """Levels of a residual: RMS over the noise of its channel."""

    only_noise: float = number(
        1.04,
        "1",
        "below it in every channel the search ends",
        "4 standard deviations of a white residual at 80 s of 280 Hz (noise_level.py)",
    )
    reached: float = number(
        AT_NOISE, "1", "up to it on the test blocks a channel has reached its floor",
        "at 1.05 a record with nothing wrong is unexplained; no change up to 1.4 (docs/settings.md)",
    )  # fmt: skip
    misfit: float = number(
        1.5, "1", "above it a channel misfits: causes must take half of that away", flat("1.2", "3")
    )
    large_misfit: float = number(3.0, "1", "above it a channel misfits much: causes may explain it alone")
    share_left: float = number(0.5, "1", "of a misfit: what may be left where causes are named")
    far: float = number(
        5.0, "1", "from it on, in the worst channel, a model is far from the floor",
        "the residual is not noise there: priors mean little, and more parameters always gain a little",
    )  # fmt: skip

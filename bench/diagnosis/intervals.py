"""How often identify's 95 % intervals hold the truth, on records of the second bench with something wrong."""

from collections.abc import Callable, Iterator, Sequence
from typing import Annotated

import numpy as np
from independent.bench import drawn_bench, record_run

from bench.diagnosis.cases import RIG, RIG_VALUES
from bench.results import Row
from rsea_ros.identification.identify import identify
from rsea_ros.identification.result import Identification
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

SYMBOLS = dict(zip(RIG_VALUES, ("J_m", "b_m", "K_s", "b_s"), strict=True))
CLOCKS = {"ft": "ft", "command": "command", "position": "joint", "velocity": "joint", "motor_torque": "joint"}
"""Channels whose stamps come in one message."""

Spoil = Callable[[Record, np.random.Generator], Record]


def jitter(clocks: Sequence[str], by: float = 3e-4) -> Spoil:
    """Return a function that shifts every stamp of these clocks by up to `by` s."""

    def spoil(record: Record, rng: np.random.Generator) -> Record:
        off = {c: rng.uniform(-by, by, len(record["command"])) for c in clocks}
        changed = {n: c for n, c in record.channels.items() if CLOCKS[n] in clocks}
        return record.with_channels(
            **{n: Channel(c.t + off[CLOCKS[n]][: len(c)], c.y.copy()) for n, c in changed.items()}
        )

    return spoil


SCENARIOS: dict[str, tuple[dict[str, float], Spoil | None]] = {
    "white noise": ({}, None),
    "sensor stamps off by 0.3 ms": ({}, jitter(("ft", "joint"))),
    "command stamps off by 0.3 ms": ({}, jitter(("command",))),
    "all stamps off by 0.3 ms": ({}, jitter(("command", "ft", "joint"))),
    **{f"Coulomb friction {torque:g} N·m": ({"coulomb": torque}, None) for torque in (0.02, 0.1, 0.3)},
    "motor constant 10 % off": ({"torque_gain": 1.1}, None),
    "command delay 2 ms": ({"delay": 2e-3}, None),
}


def outcome(name: str, seed: int, duration: float) -> tuple[Identification, dict[str, float]]:
    """Identify one record; return the result and the true values by name."""
    hidden, spoil = SCENARIOS[name]
    bench = drawn_bench(np.random.default_rng(seed)).with_values(**hidden)
    excitation = ("chirp_noise", "multisine", "white_noise")[seed % 3]
    record = record_run(bench, seed, excitation, duration)
    record = spoil(record, np.random.default_rng(seed + 10_000)) if spoil else record
    plant = bench.plant._asdict()
    return identify([record], load_rig(RIG)), {n: plant[alias] for n, alias in RIG_VALUES.items()}


def main(
    *, seeds: int = 100, first: int = 0, duration: float = 20.0,
    scenarios: Annotated[tuple[str, ...], SCENARIOS] = tuple(SCENARIOS),
) -> Iterator[Row]:  # fmt: skip
    """Print the share of truths inside by parameter, and the medians of K_s's half width and the residual.

    seeds: records a scenario
    first: first seed
    duration: s, of a record
    """
    for name in scenarios:
        inside, widths, ratios = dict.fromkeys(RIG_VALUES, 0), [], []
        for seed in range(first, first + seeds):
            result, true = outcome(name, seed, duration)
            found = {p.name: p for p in result.parameters if p.name in true}
            for n, p in found.items():
                inside[n] += p.ci95[0] <= true[n] <= p.ci95[1]
            k_s = found["spring.stiffness"]
            widths.append(50.0 * (k_s.ci95[1] - k_s.ci95[0]) / k_s.value)
            ratios.append(max(v / result.noise_rms[n] for n, v in result.residual_rms.items()))
        shares = {SYMBOLS[n]: f"{100.0 * count / seeds:.0f}" for n, count in inside.items()}
        shares |= {"half-width of K_s, %": f"{np.median(widths):.3g}"}
        yield Row(name, "", shares | {"residual over noise": f"{np.median(ratios):.2f}"})

"""Causes and faults of the data as series of their own, from what each recording names."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from rsea_ros.records.record import FloatArray
from rsea_ros.trends.series import BoolArray, Series, Table

NULLS: Mapping[str, float] = {"gain": 1.0}
"""Value at which a cause vanishes, by its parameter's name; 0 for the others."""
ENDLESS = frozenset({"stiffness", "limit", "angle", "frequency"})
"""Parameters that grow without an end where the cause vanishes: no zero stands for its absence."""
_LIKELY = 0.5
"""Probability from which a name counts that has rivals."""
_BEST = 0.1
"""Quantile of the recordings, by how small a size they show."""
_LEAST_GAIN = 0.05
"""Gain below which a diagnosis names no cause (diagnosis/settings.py, acceptance.fall)."""


@dataclass(frozen=True)
class Naming:
    """A cause or fault in a joint's recordings, sorted by time, each array of shape (n,).

    row: places in the table of recordings. named: which name it. limit: size below which it would not have
    been named, NaN where unknown. parameter, unit, size: of the cause's main parameter; empty for a fault.
    """

    joint: str
    about: str
    kind: Literal["cause", "fault"]
    row: np.ndarray
    time_s: FloatArray
    named: BoolArray
    parameter: str = ""
    unit: str = ""
    size: FloatArray | None = None
    sd: FloatArray | None = None
    status: str = ""
    limit: float = float("nan")


def namings(recordings: Table) -> Iterator[Naming]:
    """Yield for each joint every cause and fault that its recordings name at least once."""
    joint = np.asarray(recordings["joint"], str)
    time_s = np.asarray(recordings["time_s"], float)
    done = np.asarray(recordings["outcome"], str) == "done"
    for name in np.unique(joint):
        rows = np.flatnonzero((joint == name) & np.isfinite(time_s))
        rows = rows[np.argsort(time_s[rows], kind="stable")]
        yield from _faults(str(name), rows, time_s, recordings["faults"])
        yield from _causes(str(name), rows[done[rows]], time_s, recordings["causes"])


def _faults(joint: str, rows: np.ndarray, time_s: FloatArray, faults: npt.NDArray[Any]) -> Iterator[Naming]:
    held = (faults[i] if faults[i] is not None else () for i in rows)
    kinds = [{str(f["kind"] if isinstance(f, Mapping) else f) for f in every} for every in held]
    for kind in sorted(set().union(*kinds)):
        yield Naming(joint, kind, "fault", rows, time_s[rows], np.array([kind in k for k in kinds]))


def _causes(joint: str, rows: np.ndarray, time_s: FloatArray, causes: npt.NDArray[Any]) -> Iterator[Naming]:
    bare: Mapping[str, Any] = {"status": "confirmed", "probability": 1.0, "gain": float("nan"), "sizes": ()}
    of_rows = [causes[i] if causes[i] is not None else () for i in rows]
    stated = [[c if isinstance(c, Mapping) else {"name": str(c), **bare} for c in row] for row in of_rows]
    of_row = [
        {c["name"]: c for c in row if c["status"] != "one_of" or float(c["probability"]) >= _LIKELY}
        for row in stated
    ]
    for name in sorted(set().union(*of_row)):
        of_recording = [row.get(name) for row in of_row]
        yield _cause(joint, str(name), rows, time_s[rows], of_recording)


def _cause(
    joint: str,
    name: str,
    rows: np.ndarray,
    time_s: FloatArray,
    of_recording: Sequence[Mapping[str, Any] | None],
) -> Naming:
    main = next((c["sizes"][0] for c in of_recording if c is not None and len(c["sizes"])), None)
    named = np.array([c is not None for c in of_recording])
    statuses = [c["status"] for c in of_recording if c is not None]
    status = max(set(statuses), key=statuses.count)
    if main is None:
        return Naming(joint, name, "cause", rows, time_s, named, status=status)
    null = NULLS.get(main["name"], 0.0)
    sizes = np.array([_size(c, main["name"]) if c is not None else (np.nan,) * 3 for c in of_recording])
    size, sd = sizes[:, 0] - null, (sizes[:, 2] - sizes[:, 1]) / 3.92
    gain = np.array([float(c["gain"]) if c is not None else np.nan for c in of_recording])
    limit = np.nan if main["name"] in ENDLESS else _limit(np.abs(size), gain)
    return Naming(
        joint, name, "cause", rows, time_s, named, main["name"], str(main["unit"]), size, sd, status, limit
    )


def _size(cause: Mapping[str, Any], parameter: str) -> tuple[float, float, float]:
    for s in cause["sizes"]:
        if s["name"] == parameter:
            return float(s["value"]), float(s["low"]), float(s["high"])
    return (float("nan"),) * 3


def _limit(size: FloatArray, gain: FloatArray) -> float:
    """Return the detection limit: the size that would have had the least gain that is named.

    A cause of size s leaves a residual of sqrt(noise² + (k s)²) where it is not modelled; k from its gain, in
    the recordings that show it best, since a gain beside other causes means less. At most the least named
    size.
    """
    usable = np.isfinite(size) & (gain > _LEAST_GAIN) & (gain < 1.0)
    if not np.any(usable):
        return float("nan")
    of_noise = np.sqrt(1.0 / (1.0 - gain[usable]) ** 2 - 1.0)
    least = np.sqrt(1.0 / (1.0 - _LEAST_GAIN) ** 2 - 1.0)
    smallest = np.quantile(size[usable] / of_noise, _BEST) * least
    return float(min(smallest, np.quantile(size[usable], _BEST)))


def temperatures(history: Table, recordings: Table) -> FloatArray:
    """Return the temperature of each recording of a joint, °C, as the history has it; NaN where unknown."""
    keys = zip(history["joint"], history["recording"], strict=True)
    known = dict(zip(keys, np.asarray(history["temperature"], float), strict=True))
    asked = zip(recordings["joint"], recordings["recording"], strict=True)
    return np.array([known.get(key, np.nan) for key in asked], dtype=float)


def size_series(naming: Naming, recordings: Table, temperature: FloatArray) -> Series | None:
    """Return the sizes of a cause in the recordings that name it, less its null; None without a size.

    temperature: of all recordings, °C, in the order of the table.
    """
    if naming.size is None or naming.sd is None:
        return None
    rows = naming.row[naming.named]
    determined = np.isfinite(naming.size) & np.isfinite(naming.sd)
    return Series(
        naming.joint,
        f"{naming.about}.{naming.parameter}",
        naming.unit,
        naming.time_s[naming.named],
        naming.size[naming.named],
        np.maximum(naming.sd, 1e-9)[naming.named],
        determined[naming.named],
        temperature[rows],
        np.asarray(recordings["recording"])[rows],
        np.asarray(recordings["artefacts"])[rows],
    )

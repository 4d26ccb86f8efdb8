"""The checks of a record as another verb carries them on, and which channels are usable."""

from dataclasses import replace

import numpy as np

from rsea_ros.checks.check import check_record
from rsea_ros.checks.expected import is_still
from rsea_ros.checks.finding import Findings, missing_command, unused_sentence
from rsea_ros.checks.rig_findings import at_rates
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import list_names
from rsea_ros.errors import IdentificationError
from rsea_ros.model.extent import check_pace
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import COMMANDS, FAULT_KINDS, UNITS, Channel, Record
from rsea_ros.records.stamps import repair_stamps

_FEWEST = 0.1
"""Of a channel's stamps: where fewer rise the clock stood, and the messages were not each sent ten times."""
SHORTEST = 4.0
"""s of commands: four blocks of every set (diagnosis/data_split.py) of a quarter of a second each."""


def check_diagnosable(record: Record) -> None:
    """Raise IdentificationError for a record without commands, too short, without motion or in reverse."""
    driving = record.driving
    if driving is None:
        have = ", ".join(record.channels) or "nothing"
        raise IdentificationError(
            f"{record.source}: no command, expected the torques that drove the run beside {have}: "
            f"{missing_command(record)}"
        )
    for name, channel in record.channels.items():
        if len(channel) < 2 or _rises_rarely(channel):
            raise IdentificationError(
                f"{record.source}: {name}: {len(channel)} samples, expected rising stamps: "
                "stamp each message when its value takes effect or was measured"
            )
    check_pace(record)
    length = float(np.ptp(driving.t))
    if length < SHORTEST:
        raise IdentificationError(
            f"{record.source}: {length:.3g} s of commands, expected {SHORTEST:g} s or more"
        )
    measured = [c for n, c in record.channels.items() if n not in COMMANDS]
    if not measured:
        left_out = "; ".join(f"{f.channel}: {FAULT_KINDS[f.kind]}" for f in record.faults)
        reason = f" ({left_out})" if left_out else ""
        raise IdentificationError(
            f"{record.source}: no measurement beside the command{reason}, expected one of ft, position and "
            "velocity, stamped by the command's clock"
        )
    if all(c.is_still for c in measured):
        raise IdentificationError(
            f"{record.source}: every measured channel holds one value, expected motion: "
            "is the drive enabled, are the sensors alive?"
        )
    require_motion(record)


def require_motion(record: Record) -> None:
    """Raise IdentificationError for a record in which the command never changes and nothing moves."""
    command = record.driving
    if command is None or not len(command) or not command.is_still or not is_still(record):
        return
    unit = UNITS["command" if "command" in record else "reference"]
    raise IdentificationError(
        f"{record.source}: the command stays at {command.y[0]:g} {plain(unit)} and nothing moves, "
        "expected a run in which the command excites the machine"
    )


def _rises_rarely(channel: Channel) -> bool:
    """Return whether most stamps neither rise nor repeat the one before, or hardly any differ."""
    step = np.diff(channel.t)
    rising = np.count_nonzero(step > 0.0)
    return bool(rising < np.count_nonzero(step < 0.0) or rising < _FEWEST * len(channel))


_AGAIN = ("missing_topic", "frozen_samples", "dropped_samples", "duplicate_stamps", "clock_jump", "outliers",
          "clipping", "nan", "coarse_steps", "early_torque", "held_samples", "interpolated",
          "mixed_rows", "pause", "rounded_stamps")  # fmt: skip
"""Faults that the diagnosis finds and masks itself."""


def with_check_faults(record: Record, rig: Rig, axis: str = "torque.z", *, masks: bool) -> Record:
    """Return the record with the faults that the checks find, for the result.

    axis: of the wrench that `ft` was read from. masks: see with_faults.
    Raises IdentificationError where nothing moves, with masks for every record that cannot be diagnosed.
    """
    if masks:
        check_diagnosable(record)
    check_pace(record)
    require_motion(record)
    return with_faults(note_unused(record, rig), check_record(record, rig, axis), masks=masks)


def note_unused(record: Record, rig: Rig) -> Record:
    """Return the record with a note of the channels that its rig makes no use of."""
    sentence = unused_sentence(record, rig)
    return replace(record, notes=(*record.notes, sentence)) if sentence else record


def with_faults(record: Record, findings: Findings, *, masks: bool) -> Record:
    """Return a record with the faults that were found; a dead channel is left out.

    masks: the next stage finds, masks and reports faulty samples itself, and moves an early torque, but fits
    no rates of clocks: drifts are taken out here. For any other stage it is the other way round.

    Raises IdentificationError where no channel is left that measures anything.
    """
    dead = {f.channel for f in findings.faults if f.kind == "dead_channel"}
    channels = {n: c for n, c in record.channels.items() if n not in dead}
    if not set(channels) - {*COMMANDS}:
        raise IdentificationError(
            f"{record.source}: no sensor answers to the machine ({_reasons(record, findings)}), expected one "
            "that does: rsea check shows each"
        )
    again = _AGAIN if masks else ()
    kept = (*record.faults, *(f for f in findings.faults if f.kind not in again and f not in record.faults))
    record = replace(record, channels=channels, faults=kept)
    record = _without_late(record, findings)
    record = _with_even_clocks(record, findings) if masks else record
    return record if masks else _sound(repair_stamps(record)[0], findings)


def _without_late(record: Record, findings: Findings) -> Record:
    """Return the record without the channels that the others convict of stamps too late for any fit.

    A lag of part of a record, or of 50 ms and more, is no effect of a bench: a torque constant of 0.245
    stood in for one that grew. Where nothing else is measured they stay.
    """
    late = {f.channel for f in findings.of("clock_offset") if f.light == "red"} - {*COMMANDS}
    if not record.channels.keys() - late - {*COMMANDS}:
        return record
    faults = tuple(
        replace(f, detail=f"left out, {f.detail}") if f.kind == "clock_offset" and f.channel in late else f
        for f in record.faults
    )
    kept = {n: c for n, c in record.channels.items() if n not in late}
    return replace(record, channels=kept, faults=faults)


def _with_even_clocks(record: Record, findings: Findings) -> Record:
    """Return the record without the drifts of its sensors' clocks that the findings are sure of."""
    drifts = {f.channel: f.value for f in findings.of("clock_drift") if f.light == "amber"}
    rates = {n: 1e-6 * ppm for n, ppm in drifts.items() if n in record and ppm is not None}
    if not rates or "command" not in record:
        return record
    faults = tuple(
        replace(f, detail=f"taken out, {f.detail}") if f.kind == "clock_drift" and f.channel in rates else f
        for f in record.faults
    )
    return at_rates(replace(record, faults=faults), rates)


def _sound(record: Record, findings: Findings) -> Record:
    """Return the record without the samples that must not count; commands stay, and what a fit refuses."""
    sound = {}
    for name, channel in record.channels.items():
        if name in COMMANDS:
            continue
        bad, masked = ~np.isfinite(channel.y), findings.masked.get(name)
        bad = bad | masked if masked is not None and len(masked) == len(bad) else bad
        if bad.any():
            sound[name] = Channel(channel.t[~bad], channel.y[~bad])
    return record.with_channels(**sound)


def _reasons(record: Record, findings: Findings) -> str:
    """Return why nothing answers: faults of the driver, then the channels of each reason."""
    channels: dict[str, list[str]] = {}
    for f in findings.faults:
        if f.kind == "dead_channel":
            channels.setdefault(f.detail or f.kind, []).append(f.channel)
    driver = [f"{f.channel} latched a fault, {f.detail}" for f in record.faults if f.kind == "device_fault"]
    return "; ".join([*driver, *(f"{list_names(names)}: {why}" for why, names in channels.items())])

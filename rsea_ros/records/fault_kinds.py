"""The kinds of faults of the data with their meanings, used by the code and the docs."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

FAULT_KINDS: Mapping[str, str] = MappingProxyType(
    {
        "checksum_mismatch": "a checksum of the file does not fit: some value may be wrong",
        "cut_off": "the file breaks off, or a journal was left beside it",
        "damaged_chunks": "chunks left out: checksum, size or compression do not fit, or they break off",
        "damaged_file": "a file of the bag left out: it cannot be read at all",
        "unnamed_file": "a file beside those that metadata.yaml names, left out",
        "damaged_messages": "messages left out: they do not fit their type, or nothing declares them",
        "damaged_metadata": "metadata.yaml is not understood, its counts are not compared",
        "damaged_records": "stretches of the file that are not records",
        "data_after_end": "records after the end of the data; they are used",
        "empty_fields": "a field is empty in some of the messages",
        "missing_messages": "fewer messages than the file's statistics or metadata.yaml say",
        "surplus_messages": "more messages than the file's statistics or metadata.yaml say",
        "unknown_records": "records of a kind that the format does not define, left out",
        "zero_stamps": "header stamps that are zero; the log time replaces them",
        "missing_values": "cells of a table that are empty or not a number, left out",
        "rows_left_out": "rows of a table with another number of cells, left out",
        "coarse_stamps": "stamps of a clock coarser than the samples, which are dated evenly between them",
        "rounded_stamps": "stamps rounded to a step of which the sample period is no multiple",
        "clock_jump": "the clock of the stamps jumped; the jump is removed",
        "clock_offset": "the clock of a channel differs from the command's",
        "clock_drift": "the clock of a channel runs faster or slower than the command's",
        "early_torque": "each motor torque has the stamp of its command; it is read just after that stamp",
        "dropped_samples": "samples are missing: the stamps have gaps",
        "mixed_rows": "the clock stepped back and the log was sorted by it: rows of two times, left out",
        "partly_recorded": "a channel starts later or ends earlier than the run",
        "duplicate_stamps": "stamps repeat; the first sample of each is kept",
        "out_of_order": "samples out of order in the log, sorted by their stamps",
        "stray_stamps": "samples left out because their stamps are wrong",
        "commands_left_out": "commands that the excitation did not send in time",
        "device_fault": "the driver latched a fault: the torque was zero until it was cleared",
        "late_commands": "commands that did not act at their stamps",
        "limited_commands": "commands that the driver reduced to its limits",
        "lost_cycles": "cycles of the bench that did not run, or that the device did not answer",
        "lost_messages": "messages that the middleware lost before the recorder",
        "refused_commands": "commands that the bench refused",
        "watchdog_trips": "the torque went to zero because no command came in time",
        "clipping": "samples at the limit of the sensor's range",
        "dead_channel": "a sensor that does not respond to the machine; no result uses it",
        "sign": "a channel has the opposite sign to the rig",
        "scale": "a channel has another unit than the rig",
        "offset": "a zero is off: of the F/T torque beyond any of the run, of the position beyond its motion",
        "angle_jumps": "an angle jumps: it is wrapped at a turn, or the encoder began to count anew",
        "no_excitation": "the command never changes: the data show nothing of the machine",
        "standstill": "the machine stands still for a while although the command goes on",
        "smoothing": "a channel was averaged before it was logged",
        "wrong_rig": "the record does not fit the rig",
        "coarse_steps": "values in much larger steps than those of the rig's sensor",
        "held_samples": "the log repeats the values of a slow sensor; the repeats are left out",
        "frozen_samples": "samples that repeat while the machine moves",
        "missing_topic": "a channel of the rig's sensors is missing",
        "nan": "values that are not a number",
        "outliers": "samples far from their neighbours",
    }
)
"""Kinds of faults of the data: of the file, of the stamps, of the run (/diagnostics), of the values."""

MASKED = frozenset({"nan", "outliers", "clipping", "frozen_samples"})
"""Kinds of faults whose samples stay in the record and are masked."""

"""Bags to records: topics to channels, header stamps to seconds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from msg_adapters import bags
from msg_adapters.cdr import VALUES, Block
from msg_adapters.contents import Contents, Messages
from msg_adapters.decoding import DIAGNOSTICS, Decoded, is_inferred, tell_health
from msg_adapters.topic_map import FIELDS, READ, ROLES, TYPES, TopicMap, sign_and_index
from rsea_ros.documents.wording import brief, did_you_mean, list_names
from rsea_ros.errors import BagError
from rsea_ros.records.record import COMMANDS, IMPORTED, Channel, Fault, FloatArray, IntArray, Record
from rsea_ros.records.stamp_order import far_apart, in_order, stray_fault
from rsea_ros.records.stamps import repair_stamps

_MOST_NAMED = 20
"""Topics or joints that a message lists."""

_NEEDED = ((("torque_command",), ("desired_position",)), (("joint_states", "ft"), ("deflection",)))
"""Roles of which one must have messages, and others that do as well."""

LATEST = 2**62
"""The highest log time that is believed, ns: the year 2116. Differences of stamps stay within 64 bits."""


@dataclass(frozen=True)
class FieldSamples:
    """One field of one topic: stamps in ns and values, both (n,); `where` is file, topic and field."""

    where: str
    stamps: IntArray
    values: FloatArray


def _check_finite(series: FieldSamples) -> None:
    """Raises BagError for a value that is not finite."""
    bad = np.flatnonzero(~np.isfinite(series.values))
    if bad.size:
        at, stamp = bad[0], int(series.stamps[bad[0]])
        raise BagError(
            f"{series.where}[{at}] is {series.values[at]} at {stamp // 10**9}.{stamp % 10**9:09d} s,"
            f" expected a finite number ({bad.size} of {series.values.size} are not)"
        )


def _on_the_clock_of_the_command(
    series: Mapping[str, FieldSamples], report: Contents
) -> dict[str, FieldSamples]:
    """Leave out channels without a moment in common with the command: their stamps come from another clock.

    A simulation from the command's first stamp to their last would go through all the years between.
    """
    if (command := series.get("command")) is None:
        return dict(series)
    kept = {}
    for name, one in series.items():
        ahead = int(one.stamps.min()) - int(command.stamps.min())
        if one.stamps.min() <= command.stamps.max() and command.stamps.min() <= one.stamps.max():
            kept[name] = one
        else:
            detail = "left out: no moment in common with the command, its stamps are from another clock"
            report.faults.append(Fault("clock_offset", name, 1.0, detail, ahead * 1e-9, "s"))
    return kept


def read_record(
    paths: bags.BagPath | Sequence[bags.BagPath], *, topics: TopicMap | None = None, strict: bool = True
) -> Record:
    """Read one bag, or several files of one run, as a record; other topics are ignored.

    Stamps are those of the message headers; a zero one is replaced by the log time, with a note.
    Samples out of order are sorted by their stamps. Damaged messages are left out. The record's faults list
    all damage, and the faults in the bag's /diagnostics.
    strict: refuse records to which no model can be fitted (missing command or measurement, NaN in the
    command), and correct the stamps (records/stamps.py). Otherwise gaps, jumps of the clock and repeats are
    returned unchanged, as NaN of a measurement always is.
    Raises BagError with file, topic, field, value and expectation.
    """
    topics = topics or TopicMap()
    source = str(paths) if isinstance(paths, bags.BagPath) else ", ".join(map(str, paths))
    try:
        contents = bags.read_contents(paths, {DIAGNOSTICS, *(topics.topic(role) for role in ROLES)})
        return record_from(contents, source, topics, strict=strict)
    except MemoryError:
        raise BagError(
            f"{source}: needs more memory than this process may have: split it, or record fewer topics"
        ) from None


def record_from(contents: Contents, source: str, topics: TopicMap, *, strict: bool = True) -> Record:
    """Make a record of serialised messages, wherever they came from; see read_record."""
    _require(source, contents, topics, strict)
    report = replace(contents, notes=list(contents.notes), faults=list(contents.faults))
    series: dict[str, FieldSamples] = {}
    roles = [role for role in ROLES if role != "ft" or not is_inferred(contents, topics)]
    if len(roles) < len(ROLES):
        made = f"{topics.topic('ft')}: no sensor's, the stiffness of a rig times {topics.topic('deflection')}"
        report.notes.append(f"{made}; left out")
    for role in roles:
        messages = contents.topics.get(topics.topic(role))
        if messages is not None and messages.raw:
            series.update(_series(source, role, messages, topics, report))
    if strict:
        for name, one in series.items():
            if name in COMMANDS:
                _check_finite(one)
            if repeats := len(one.stamps) - len(np.unique(one.stamps)):
                repeated = f"{repeats} of {len(one.stamps)} stamps repeat"
                report.notes.append(f"{one.where}: {repeated}, the first of each kept")
    series = _on_the_clock_of_the_command(series, report)
    if strict and "command" not in series and "reference" not in series:
        raise BagError(f"{source}: the command's messages hold no effort, expected the torque in N·m")
    if not set(series) - ({"command", "reference"} if strict else set()):
        raise BagError(
            f"{source}: no measurement is left{report.remarks()}, expected joint states or F/T with values, "
            "stamped by the command's clock"
        )
    tell_health(contents, report, topics.namespace)
    return _record(series, source, report, strict)


def _record(series: Mapping[str, FieldSamples], source: str, report: Contents, strict: bool) -> Record:
    epoch = min(int(one.stamps.min()) for one in series.values())
    channels: dict[str, Channel] = {}
    for name, one in series.items():
        t = np.asarray((one.stamps - epoch) * 1e-9, np.float64)
        ordered, faults = in_order(Channel(t, one.values), name)
        channels[name] = ordered
        report.faults += faults
    record = Record(channels, source, epoch, tuple(dict.fromkeys(report.notes)), tuple(report.faults))
    if not strict:
        return record
    repaired, faults = repair_stamps(record)
    return replace(repaired, faults=(*record.faults, *faults))


def _require(source: str, contents: Contents, topics: TopicMap, strict: bool) -> None:
    """Refuse a bag without the topics that a record needs, or with others' types under their names."""
    filled = set()
    for role in ROLES:
        messages = contents.topics.get(topics.topic(role), Messages(TYPES[role]))
        if messages.msgtype not in READ[role]:
            expected = list_names(READ[role], "or")
            raise BagError(
                f"{source}: {topics.topic(role)} is {brief(messages.msgtype)}, expected {expected}"
            )
        if messages.raw:
            filled.add(role)
    for role in sorted(topics.required):
        if (topic := topics.topic(role)) not in contents.topics:
            near = did_you_mean(topic, contents.topics)
            raise BagError(
                f"{source}: no topic {brief(topic)} for {role}{near}; the bag holds {_topics_text(contents)}"
            )
    for roles, others in _NEEDED if strict else [(ROLES, ())]:
        if not filled.intersection((*roles, *others)):
            wanted = " or ".join(topics.topic(role) for role in roles)
            raise BagError(
                f"{source}: no message on {wanted}; the bag holds {_topics_text(contents)}"
                f"{contents.remarks()}; {_remedy(contents, roles)}"
            )


def _remedy(contents: Contents, roles: Sequence[str]) -> str:
    """Return what may be done about a topic without messages, in the words of the bag's origin."""
    if not any(note.startswith(IMPORTED) for note in contents.notes):
        return "record one, or name its topic with --topic or --namespace"
    if "torque_command" in roles:
        return "map the commanded torque or current as `command`; the measured one will do where no other is"
    return "name a measurement's column in the import map"


def _topics_text(contents: Contents) -> str:
    topics = sorted(contents.topics.items())[:_MOST_NAMED]
    return ", ".join(f"{brief(name)} ({brief(m.msgtype)})" for name, m in topics) or "no topic at all"


def _series(
    source: str, role: str, messages: Messages, topics: TopicMap, report: Contents
) -> dict[str, FieldSamples]:
    """Decode one topic: channel -> series. A field that no message fills is left out."""
    topic = topics.topic(role)
    where = f"{source}: {topic}"
    decoded = Decoded(messages, messages.msgtype, tuple(FIELDS[role].values()))
    decoded_blocks = decoded.blocks(topic, where, report)
    element = _one_joint(where, decoded_blocks, role, topics, report)
    for block in decoded_blocks:
        decoded.take(block, {f: _column(block, f, topics, element) for f in decoded.values})
    decoded.tell_empty(topic, report)
    stamps = _with_log_times(topic, where, decoded, messages.log_times, report)
    series = {}
    for channel, field in FIELDS[role].items():
        filled = decoded.filled[field]
        one = FieldSamples(f"{where} {field}", stamps[filled], decoded.values[field][filled])
        if np.isnan(one.values).all():
            if one.values.size:
                report.notes.append(f"{one.where}: not a number in every message, taken as not measured")
            continue
        stray = far_apart(one.stamps)
        if stray.any():
            report.faults.append(stray_fault(stray, channel))
            one = FieldSamples(one.where, one.stamps[~stray], one.values[~stray])
        series[channel] = one
    return series


def _one_joint(where: str, blocks: Sequence[Block], role: str, topics: TopicMap, report: Contents) -> int:
    """Return which of several numbers without names counts: that of the map, or the only one ever used.

    0 where they have names. Raises BagError where several count, or none.
    """
    layouts = [block.layout for block in blocks if "wrench" not in block.layout.fields]
    names, joint = tuple(dict.fromkeys(name for layout in layouts for name in layout.names)), topics.joint
    count = max([n for layout in layouts for _, n in layout.fields.values()], default=1)
    listed = ", ".join(map(brief, names[:_MOST_NAMED]))
    if joint is not None and names and joint not in names:
        raise BagError(f"{where}: no joint {joint!r}, the messages hold {listed}")
    if joint is None and names and (joints := max(count, len(names))) > 1:
        raise BagError(f"{where}: {joints} joints ({listed}), expected one; name it with --joint")
    if names:
        return 0
    chosen = topics.element(role)
    if chosen is None and count > 1:
        parts = [block.field(name) for block in blocks for name in block.layout.fields]
        used = sorted({at for part in parts for at in np.flatnonzero((part != 0.0).any(axis=0)).tolist()})
        if len(used) != 1:
            topic = f"{role}={topics.topic(role)}"
            raise BagError(
                f"{where}: {count} numbers without names, expected which: --topic {topic}[0] to [{count - 1}]"
            )
        chosen = used[0]
        report.notes.append(f"{where}: [{chosen}] taken, the only one of {count} that is ever not zero")
    if chosen is not None and chosen >= count:
        raise BagError(f"{where}: {count} numbers without names, expected more than {chosen}")
    return chosen or 0


def _column(block: Block, field: str, topics: TopicMap, element: int) -> FloatArray | None:
    """Return the field's value of each message, None where these messages do not hold it.

    element: which number counts where they have no names.
    """
    if field == "wrench":
        sign, index = sign_and_index(topics.axis)
        return sign * block.field(field)[:, index]
    names = block.layout.names
    if topics.joint is not None and names and topics.joint not in names:
        return None
    if block.layout.fields.keys() == {VALUES}:
        if field == "velocity":  # a number alone is the position of its role
            return None
        field = VALUES
    elif field not in block.layout.fields:  # of a DynamicJointState
        field = f"{topics.joint or names[0]}/{field}" if names else field
        return block.field(field)[:, 0] if field in block.layout.fields else None
    index = names.index(topics.joint) if topics.joint in names else 0 if names else element
    return block.field(field)[:, index] if index < block.layout.fields[field][1] else None


def _with_log_times(
    topic: str, where: str, decoded: Decoded, log_times: Sequence[int], report: Contents
) -> IntArray:
    """Put the log time where the header stamp is zero, which means that nobody set it."""
    stamps: IntArray = decoded.stamps.copy()
    zero = np.flatnonzero((stamps == 0) & decoded.sound)
    unset = [row for row in zero.tolist() if log_times[row]]
    if unset and decoded.is_unstamped:
        report.notes.append(f"{where}: its messages have no stamps, log time taken")
    elif unset:
        detail = f"{len(unset)} of {len(stamps)} header stamps are zero, log time taken"
        report.notes.append(f"{where}: {detail}")
        report.tell("zero_stamps", topic, detail, len(unset), "messages", len(unset) / len(stamps))
    stamps[unset] = [min(log_times[row], LATEST) for row in unset]
    return stamps

"""What a verb has written, as text whose numbers may be compared: files, pages, figures, bags, tables.

Left out of the text: dates, hashes, versions and the temporary folder. Numbers of full precision are cut to
four digits, long lists of numbers and drawings are summed up.
"""

import base64
import gzip
import json
import math
import re
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from plotly.graph_objects import Figure
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

LONG = 8
"""Numbers of a list from which on it is summed up."""
TENTH = 10
"""Of the messages of a bag, one in so many is decoded: by pure Python, which is slow."""
NOTHING = 1e-9
"""A computed number below this is what rounding has left of 0."""
NUMBER = re.compile(r"(?<![\w.])[-−+]?(?:\d+\.?\d*|\.\d+)(?:e[-−+]?\d+)?", re.ASCII)
SECRETS = (
    (re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(\+00:00|Z)"), "DATE"),
    (re.compile(r"\b[0-9a-f]{64}\b|\b[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\b"), "SHA"),
    (re.compile(r"\b[0-9a-f]{12}(?=…)|\b[0-9a-f]{16}-[0-9a-f]{8}\b"), "SHA"),
    (re.compile(r"\b(rsea_ros|rsea law) \d+\.\d+\.\d+"), r"\1 VERSION"),
    (re.compile(r"\(choose from [^)]*\)"), "(choose from …)"),  # argparse quotes them as it likes
    (re.compile(r"version \"?\d+\.\d+\.\d+\"?"), "version VERSION"),
    (re.compile(r"\b\d(\.\d+)?e[-−]1\d\b"), "TINY"),
    (re.compile(r"\b\d+\.\d+ s( per| each|,)? elapsed"), "TIME"),
)
ALIGNED = re.compile(r"(?<=\S) {2,}")
SCRIPT = re.compile(r"<script([^>]*)>(.*?)</script>", re.DOTALL)
STYLE = re.compile(
    r"\.settings:|\.layout.*(font|margin|hoverlabel|standoff)[^:]*:|\.data.*\.(line|marker|font):|: title"
)
DRAWING = re.compile(r"<svg.*?</svg>", re.DOTALL)


def text_of(path: Path) -> str:
    """Return the text that stands for a file or for all files of a folder.

    The second bag of a folder and more have their name alone: what was fitted to them is in the results.
    """
    if path.is_dir() and (path / "metadata.yaml").exists():
        return f"--- {path.name}\n{_bag(path)}"
    if path.is_dir():
        more = sorted(path.glob("*.mcap"))[1:]
        return "\n".join(f"--- {p.name}" if p in more else text_of(p) for p in sorted(path.iterdir()))
    return f"--- {path.name}\n{_content(path)}"


def _content(path: Path) -> str:
    match path.suffix:
        case ".mcap" | ".db3":
            return _bag(path)
        case ".html":
            return page(path.read_text(encoding="utf-8"))
        case ".json" | ".jsonl":
            return "\n".join(as_json(line) for line in _documents(path.read_text(encoding="utf-8")))
        case ".csv":
            return _table(path)
        case ".fmu":
            with zipfile.ZipFile(path) as archive:
                return "\n".join(_member(archive, name) for name in sorted(archive.namelist()))
        case ".parquet" | ".lock":
            return "(binary)"
        case _:
            return rounded(path.read_text(encoding="utf-8"))


def _member(archive: zipfile.ZipFile, name: str) -> str:
    text = archive.read(name)
    return f"{name}\n{rounded(text.decode())}" if name.endswith((".xml", ".json", ".yaml")) else name


def _documents(text: str) -> Iterable[str]:
    try:
        json.loads(text)
    except ValueError:
        return text.splitlines()
    return [text]


def as_json(text: str) -> str:
    """Return a JSON document with short lines, if the text is one."""
    try:
        value = json.loads(text)
    except ValueError:
        return rounded(text)
    return plain("\n".join(_lines(value)))


def _lines(value: object, at: str = "") -> Iterator[str]:
    """Yield a line for each mapping or list of plain values."""
    match value:
        case list() if _numbers(value):
            yield f"{at}: {sums(value)}"
        case {"first": first, "slope": slope, "step": step, "data": str(data)}:
            yield f"{at}: {sums(_unpacked(first, slope, step, data))}"
        case dict() if value:
            flat = {k: v for k, v in value.items() if not isinstance(v, (dict, list)) or not v}
            if flat and not re.search(r"\.rejected\[\d\d", at):  # the best ten will do
                yield f"{at}: " + ", ".join(f"{k} {_plain(v)}" for k, v in flat.items())
            for key, each in value.items():
                if key not in flat:
                    yield from _lines(each, f"{at}.{key}")
        case list() if value:
            if all(not isinstance(v, (dict, list)) for v in value):
                yield f"{at}: " + ", ".join(_plain(v) for v in value)
            else:
                for k, each in enumerate(value):
                    yield from _lines(each, f"{at}[{k}]")
        case _:
            yield f"{at}: {_plain(value)}"


def _unpacked(first: float, slope: float, step: float, data: str) -> Iterable[float]:
    """Return the values of a packed trace as page.js does."""
    low, high = np.frombuffer(gzip.decompress(base64.b64decode(data)), np.uint8).reshape(2, -1).astype(float)
    whole = low + 256.0 * high
    return np.where(whole == 2.0**16 - 1.0, np.nan, first + slope * np.arange(len(whole)) + step * whole)


def _drawn(value: Any) -> Any:
    """Return a part of a figure with its packed traces as page.js unpacks them."""
    match value:
        case {"first": first, "slope": slope, "step": step, "data": str(data)}:
            return _unpacked(first, slope, step, data)
        case dict():
            return {key: _drawn(each) for key, each in value.items()}
        case list():
            return [_drawn(each) for each in value]
    return value


def _numbers(values: list[object]) -> bool:
    return len(values) > LONG and all(v is None or isinstance(v, (int, float)) for v in values)


def _plain(value: object) -> str:
    return short(value) if isinstance(value, float) else str(value)


def sums(values: Iterable[object]) -> str:
    """Return count, RMS, RMS of differences, least and largest of some numbers, and the count of gaps."""
    y = np.array([math.nan if v is None else v for v in values], dtype=float)
    told = y[np.isfinite(y)]
    if not len(told):
        return f"{len(y)} without a number"
    scale = float(np.abs(told).max())
    steps = np.diff(told) if len(told) > 1 else np.zeros(1)
    parts = [np.sqrt(np.mean(told**2)), np.sqrt(np.mean(steps**2)), told.min(), told.max()]
    words = " ".join(short(float(p) if abs(p) > NOTHING * scale else 0.0) for p in parts)
    return f"{len(y)}× {words}" + (f", {len(y) - len(told)} gaps" * (len(told) < len(y)))


def short(value: float) -> str:
    """Return a computed number with four digits."""
    return f"{value:.4g}" if abs(value) > NOTHING or not math.isfinite(value) else "0"


def rounded(text: str) -> str:
    """Return a text with its numbers of more than six digits behind the point cut."""
    return plain(re.sub(r"(?<![\w.])-?\d+\.\d{3,}(e-?\d+)?(?!\w)", lambda m: _cut(m.group()), text))


def _cut(word: str) -> str:
    return short(float(word)) if len(word.partition("e")[0].strip("-0.").replace(".", "")) > 5 else word


def plain(text: str) -> str:
    """Return a text without what differs from run to run, and without blanks that only align."""
    for pattern, word in SECRETS:
        text = pattern.sub(word, text)
    return "\n".join(line.rstrip() for line in ALIGNED.sub(" ", text).splitlines())


def page(html: str) -> str:
    """Return the words and tags of a page, its drawings and the sums of its figures."""
    html = html[html.index("<body") :] if "<body" in html else html
    html = re.sub(r"<nav>.*?</nav>", "", html, flags=re.DOTALL)  # the headings once more
    html = re.sub(r'(<div class="figure"[^>]*?) role="img" aria-label="[^"]*"', r"\1", html)
    seen = set[str]()
    html = SCRIPT.sub(lambda m: _figure(m[1], m[2], seen), html)
    html = DRAWING.sub(lambda m: _drawing(m.group()), html)
    html = re.sub(r"</td>\s*<td class='number'>", " # ", re.sub(r"</td>\s*<td>", " | ", html))
    html = re.sub(r"</(tr|td|li|p|h\d|div|span|section|table|tbody|thead|th|small|b|sub|i)>", "", html)
    return rounded(re.sub(r"\s*(<(section|h\d|p|tr|div|table|li|details)\b)", r"\n\1", html))


def _figure(attributes: str, content: str, seen: set[str]) -> str:
    """Return a figure without the lines of its style that an earlier figure of the page has too.

    Raises ValueError for a key, a colour or a mark that plotly does not know, which a browser passes over.
    """
    if "application/json" not in attributes:
        return ""
    Figure(**{key: _drawn(json.loads(content)[key]) for key in ("data", "layout")})
    lines = as_json(content).splitlines()
    new = [line for line in lines if line not in seen and not STYLE.match(line)]
    seen |= {line for line in lines if line.startswith((".layout", ".data")) and "×" not in line}
    return "\n(figure\n" + "\n".join(new) + "\n)\n"


def _drawing(svg: str) -> str:
    """Return the head of a drawing, its words, and the sum of its numbers."""
    words = re.findall(r">([^<>]+)<", svg)
    tags = re.findall(r"<(\w+)", svg)
    counts = ", ".join(f"{tags.count(t)} {t}" for t in sorted(set(tags)))
    numbers = [float(n) for n in re.findall(r"(?<![\w#.])-?\d+\.?\d*", re.sub(r">[^<>]+<", "><", svg))]
    return f"\n(drawing {counts}: {sums(numbers)}\n{' | '.join(words)[:900]})\n"


def _table(path: Path) -> str:
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    names = head.split(",")
    cells = [row.split(",") for row in rows]
    if len(rows) <= LONG:
        return rounded("\n".join([head, *rows]))
    columns = [[_number(c[k]) if k < len(c) else None for c in cells] for k in range(len(names))]
    return plain("\n".join(f"{n}: {sums(c)}" for n, c in zip(names, columns, strict=True)))


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _bag(path: Path) -> str:
    """Return the sums of every tenth message's numbers, topic by topic, read by another library."""
    lines = []
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        heard = {c.id: (list[int](), dict[str, list[float]]()) for c in reader.connections}
        for connection, stamp, raw in reader.messages():  # once for all topics: it parses all for each
            stamps, fields = heard[connection.id]
            if len(stamps) % TENTH == 0:
                for name, value in _fields(reader.deserialize(raw, connection.msgtype)):
                    fields.setdefault(name, []).append(value)
            stamps.append(stamp)
        for connection in sorted(reader.connections, key=lambda c: c.topic):
            stamps, fields = heard[connection.id]
            span = (stamps[-1] - stamps[0]) * 1e-9 if stamps else 0.0
            lines.append(f"{connection.topic} {connection.msgtype}: {len(stamps)} in {span:.6g} s")
            lines += [f"  {n}: {sums(v)}" for n, v in fields.items() if any(v)]
    return plain("\n".join(lines))


def _fields(message: object, at: str = "") -> Iterator[tuple[str, float]]:
    for name, value in vars(message).items():
        if name == "header" and not at:
            value = value.frame_id
        if isinstance(value, (int, float)):
            yield f"{at}{name}", float(value)
        elif isinstance(value, np.ndarray):
            yield from ((f"{at}{name}[{k}]", float(v)) for k, v in enumerate(value))
        elif hasattr(value, "__msgtype__"):
            yield from _fields(value, f"{at}{name}.")


def differences(stored: str, said: str, *, exact: bool = False, limit: int = 20) -> list[str]:
    """Return lines that differ in words, or in a number by more than rounding allows, up to a limit.

    exact: no number is computed, so none may differ.
    """
    before, now = stored.splitlines(), said.splitlines()
    apart = [(a, b) for a, b in zip(before, now, strict=False) if a != b and (exact or not _alike(a, b))]
    found = [f"  {a}\n→ {b}" for a, b in apart]
    if len(before) != len(now):
        found.append(f"  {len(before)} lines\n→ {len(now)} lines")
    return found[:limit]


CHAOTIC, SPREAD = re.compile("torque[_ ]ripple.*gain", re.IGNORECASE), 0.05
"""A controlled sine over cogging: the last bit of any number moves its error by 1.5 % (decision 290)."""


def _alike(a: str, b: str) -> bool:
    if NUMBER.split(a) != NUMBER.split(b):
        return False
    pairs = zip(NUMBER.findall(a), NUMBER.findall(b), strict=True)
    part = SPREAD if CHAOTIC.search(a) else 1e-3
    return all(x == y or abs(_value(x) - _value(y)) <= max(_room(x, part), _room(y, part)) for x, y in pairs)


def _value(word: str) -> float:
    return float(word.replace("−", "-"))


def _room(word: str, part: float) -> float:
    """Return how far a number may be off: a unit of its last digit, a part of it, a count below 1000 not."""
    digits, _, exponent = word.replace("−", "-").partition("e")
    if "." not in digits and not exponent:
        return 0.0 if len(digits.strip("-+")) < 4 else 1.0
    unit = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return max(1.01 * unit, part * abs(_value(word)))

"""Dates, names and findings of a fleet in plain English, and links to where they are shown."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from html import escape
from pathlib import Path
from urllib.parse import quote

import numpy as np

from rsea_extras.trends.result import Alarm, Change, Interval, Trend
from rsea_extras.trends.series import Table
from rsea_ros.extension.base import list_names
from rsea_ros.extension.page import DIAGNOSIS_JSON, IDENTIFICATION_JSON, REPORT, Html, words
from rsea_ros.extension.rigs import catalogue

_MOST = 3
"""Changes that a title names."""


def day(time_s: float, *, short: bool = False) -> str:
    """Return a date as `24 March 2025`, or short as `24 Mar 2025`."""
    t = datetime.fromtimestamp(time_s, timezone.utc)
    return f"{t.day} {t.strftime('%b' if short else '%B')} {t.year}"


def dates(*time_s: float) -> list[str]:
    """Return times as plotly reads them, UTC, to the minute."""
    stamps = np.round(np.array(time_s, float)).astype("datetime64[s]")
    return [str(s) for s in np.datetime_as_string(stamps, unit="m")]


def plural(number: int, noun: str) -> str:
    """Return a noun in the number of what is counted."""
    return noun if number == 1 else f"{noun}s"


def name(about: str) -> str:
    """Return the plain name of a parameter, a cause, or the size of one: `Coulomb friction torque`."""
    group, _, key = about.partition(".")
    if not key:
        return words.sentence(words.effect(about))
    if about in words.PARAMETERS or group not in catalogue():
        return words.parameter(about)
    plain, size = words.effect(group), key.replace("_", " ")
    return words.sentence(plain if size in plain else f"{plain} {size}")


def value(v: Interval, unit: str) -> str:
    """Return a value with its 95 % interval and unit, `3.90 ± 0.08 mrad`; a bare number in percent."""
    return words.measured_text(*v.times(100.0), "%") if unit == "1" else words.measured_text(*v, unit)


def percent(share: float) -> str:
    """Return a relative change as `−15 %`, small ones with two significant digits."""
    size = abs(100.0 * share)
    digits = 0 if size >= 9.95 else 1 if size >= 0.095 else 2
    text = words.minus(f"{100.0 * share:+.{digits}f} %")
    return "0 %" if float(f"{size:.{digits}f}") == 0.0 else text


def amount(share: float) -> str:
    """Return the size of a relative change, `15 %`; `less than 0.01 %` of one that would read as none."""
    text = percent(abs(share)).lstrip("+")
    return "less than 0.01 %" if share and text == "0 %" else text


def subject(about: str) -> str:
    """Return a plain name as the subject of a sentence: `Rotor damping, reflected,`."""
    plain = name(about)
    return f"{plain}," if "," in plain else plain


def about(alarm: Alarm) -> str:
    """Return an alarm in a few words, without the date."""
    a = alarm
    if a.kind == "fault":
        return f"{words.sentence(words.fault(a.about))} in the data"
    if a.kind == "cause":
        return f"{cause_name(a)}{f', {value(a.size, a.unit)}' if a.size is not None else ''}"
    if a.kind == "outlier":
        return f"{name(a.about)} {_beside(a)} the fleet"
    return f"{name(a.about)} {percent(a.relative)}" if math.isfinite(a.relative) else name(a.about)


def _beside(outlier: Alarm) -> str:
    return f"{amount(outlier.relative)} {'above' if outlier.relative > 0.0 else 'below'}"


def sentence(alarm: Alarm) -> str:
    """Return an alarm as a sentence, with its date."""
    a = alarm
    start = "the first recording" if a.from_first else "" if a.kind == "outlier" else day(a.since_s)
    up = a.size is not None and a.size.value > 0.0
    if a.kind == "outlier":
        return f"{subject(a.about)} is {_beside(a)} the median of the fleet"
    if a.kind == "fault":
        return f"{words.sentence(words.fault(a.about))} in the data since {start}"
    if a.kind == "cause":
        return f"{cause_name(a)} {beginning(a)}{size_now(a)}"
    if a.kind == "trend":
        way = "rising" if up else "falling"
        return f"{subject(a.about)} has been {way} since {start}: {percent(a.relative)} so far"
    return f"{subject(a.about)} {'rose' if up else 'fell'} by {amount(a.relative)} from {start} on"


def cause_name(cause: Alarm) -> str:
    """Return the name of a cause, beside which another may stand if the diagnoses do not exclude it."""
    return f"{name(cause.about)}{' or a look-alike' if cause.status == 'one_of' else ''}"


def beginning(cause: Alarm) -> str:
    """Return since when a joint has a cause, and whether it grows."""
    growth = cause.growth
    if cause.from_first:
        return f"from the first recording on{f', {growth}' if growth else ''}"
    return f"appeared about {day(cause.since_s)}{f' and is {growth}' if growth else ''}"


def size_now(cause: Alarm) -> str:
    """Return the size of a cause now as the end of a sentence, empty if it is unknown."""
    return f": now {value(cause.size, cause.unit)}" if cause.size is not None else ""


def doubt_of_date(alarm: Alarm) -> str:
    """Return between which dates it began, empty where that is not known."""
    if not math.isfinite(alarm.since_s):
        return ""
    if alarm.from_first:
        return f"before {day(alarm.since_s, short=True)}"
    first, last = day(alarm.earliest_s, short=True).split(), day(alarm.latest_s, short=True).split()
    while first and first[-1] == last[len(first) - 1]:
        first.pop()
    return f"{' '.join(first)} to {' '.join(last)}" if first else " ".join(last)


def undetermined_state(trend: Trend) -> str:
    """Return why a parameter has no trend, in a few words."""
    if not np.mean(trend.series.identifiable) > 0.5:
        return "not enough excitation"
    return "intervals too wide" if math.isfinite(trend.detectable) else "too few days"


def finding(trend: Trend) -> str:
    """Return the title of a parameter's figure."""
    silent = trend.silent_since_s
    return _finding(trend) + (f"; cannot be determined since {day(silent)}" if math.isfinite(silent) else "")


def _finding(trend: Trend) -> str:
    about, unit = trend.series.parameter, trend.series.unit
    if trend.state == "undetermined":
        return f"{name(about)}: {undetermined_state(trend)}"
    if trend.state == "steady":
        factor, shown = words.unit_factor(trend.detectable, unit)
        level = trend.now.value if trend.now is not None else 0.0
        share = f", {amount(trend.detectable / abs(level))}" if level else ""
        least = f"{words.number(trend.detectable * factor, 2)} {shown}".rstrip()
        return f"{subject(about)} is steady: no step above {least}{share}"
    if trend.state == "trending" and trend.per_year is not None:
        way, limit = "rising" if trend.per_year.value > 0.0 else "falling", trend.to_limit_s
        first, last = (day(t, short=True) for t in limit[1:]) if limit else ("", "")
        end = f", at its limit about {day(limit.value)} ({first} to {last})" if limit else ""
        return f"{subject(about)} is {way}: {percent(trend.relative)} since the first day{end}"
    return f"{subject(about)} {list_names([_movement_text(c, trend) for c in trend.changes[:_MOST]])}"


def _movement_text(change: Change, trend: Trend) -> str:
    way = "rose" if change.size.value > 0.0 else "fell"
    size = change.size.value / abs(trend.first.value) if trend.first and trend.first.value else math.nan
    how = f"{way} by {amount(size)}" if math.isfinite(size) else way
    at = day(change.since_s)
    return f"{how} on {at}" if change.kind == "step" else f"{how} from {at} on"


def latest_causes(joints: Sequence[str], recordings: Table) -> Mapping[str, str]:
    """Return the sure causes in each joint's latest finished recording as text, for joints with any.

    A joint whose recordings have no date has no latest one.
    """
    of, outcome = np.asarray(recordings["joint"], str), np.asarray(recordings["outcome"], str)
    time_s, latest = np.asarray(recordings["time_s"], float), {}
    for joint in joints:
        done = np.flatnonzero((of == joint) & (outcome == "done") & np.isfinite(time_s))
        causes = recordings["causes"][done[np.argmax(time_s[done])]] if done.size else ()
        sure = [words.effect(str(c["name"])) for c in causes if c["status"] in ("confirmed", "leading")]
        if sure:
            latest[joint] = list_names(sure)
    return latest


_RESULTS = (REPORT, DIAGNOSIS_JSON, IDENTIFICATION_JSON)
"""What shows a recording's diagnosis best, in this order."""


@dataclass(frozen=True)
class Links:
    """out: folder of the pages. store: folder that the paths of artefacts start from. pages: by joint."""

    out: Path
    store: Path
    pages: dict[str, str]

    def joint(self, name: str) -> Html:
        """Return a link to a joint's page."""
        return _link(self.pages[name], name) if name in self.pages else Html(escape(name))

    def recording(self, name: str, artefacts: str) -> Html:
        """Return a link to the results of a recording; its plain name where it left none."""
        if not artefacts:
            return Html(escape(name))
        return _link(Path(os.path.relpath(self._best(artefacts), self.out)).as_posix(), name)

    def lacks_page(self, artefacts: str) -> bool:
        """Return whether a recording was diagnosed without a page."""
        return bool(artefacts) and self._best(artefacts).name == DIAGNOSIS_JSON

    def _best(self, artefacts: str) -> Path:
        folder = self.store / artefacts
        return next((folder / f for f in _RESULTS if (folder / f).exists()), folder)


def _link(target: str, text: str) -> Html:
    return Html(f'<a href="{escape(quote(target))}">{escape(text)}</a>')


def page_names(joints: tuple[str, ...]) -> dict[str, str]:
    """Return the file name of each joint's page: letters, digits, - and _ stay, and no two are alike."""
    names: dict[str, str] = {}
    for joint in joints:
        plain = "".join(c if c.isascii() and (c.isalnum() or c in "-_") else "-" for c in joint)[:80]
        number, name = 1, f"joint-{plain}.html"
        while name.lower() in {n.lower() for n in names.values()}:
            number += 1
            name = f"joint-{plain}-{number}.html"
        names[joint] = name
    return names

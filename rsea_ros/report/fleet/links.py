"""Where pages and results lie, seen from a page."""

import os
from dataclasses import dataclass
from html import escape
from pathlib import Path
from urllib.parse import quote

from rsea_ros.report.page import Html
from rsea_ros.report.result_files import DIAGNOSIS_JSON, IDENTIFICATION_JSON, REPORT

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

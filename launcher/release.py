"""Name who maintains a release: launcher/release.py NAME EMAIL URL [VERSION] writes them into package.xml.

The package has no maintainer of its own: whoever releases it, to the build farm or a team, is one.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

MANIFEST = Path(__file__).resolve().parents[1] / "package.xml"
USAGE = "expected NAME EMAIL URL [VERSION], such as 'A. Name' a.name@lab.org https://lab.org/rsea_ros 0.2.0"


def main(words: Sequence[str], manifest: Path = MANIFEST) -> int:
    """Write name, address and place, and the version where it is given."""
    try:
        text = released(manifest.read_text(encoding="utf-8"), *words)
    except (TypeError, ValueError) as error:
        sys.stderr.write(f"release: {error if isinstance(error, ValueError) else USAGE}\n")
        return 2
    manifest.write_text(text, encoding="utf-8")
    return 0


def released(text: str, name: str, email: str, url: str, version: str = "") -> str:
    """Return a manifest with a maintainer and places. Raises ValueError for what REP 149 does not allow."""
    for what, value, form in (
        ("email", email, r"[^@\s]+@(?!example\.)[^@\s]+\.[^@\s]+"),
        ("url", url, r"https?://\S+"),
        ("version", version or "0.0.0", r"\d+\.\d+\.\d+"),
    ):
        if not re.fullmatch(form, value):
            raise ValueError(f"{what} {value!r}: {USAGE}")
    person = f"<maintainer email={quoteattr(email)}>{escape(name)}</maintainer>"
    kinds = "website", "repository"
    places = "".join(f'\n  <url type="{kind}">{escape(url)}</url>' for kind in kinds)
    text = re.sub(r"\n  <url .*</url>", "", text)
    text = re.sub(r"<maintainer .*</maintainer>", lambda found: person, text)
    text = re.sub(r"(\n  <license .*</license>)", lambda found: found[1] + places, text)
    return re.sub(r"<version>.*</version>", f"<version>{version}</version>", text) if version else text


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

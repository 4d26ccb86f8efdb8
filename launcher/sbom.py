"""Print what the locks install as a bill of materials, CycloneDX 1.6: launcher/sbom.py [NAME…] > sbom.json.

NAME: of a lock in requirements/; all of them unless named.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

LOCKS = Path(__file__).resolve().parents[1] / "requirements"
_PIN = re.compile(r"^([a-z0-9-]+)==(\S+?)(?: ; (.*?))? \\$")
_HASH = re.compile(r"--hash=sha256:([0-9a-f]{64})")


def main(names: Sequence[str]) -> int:
    """Print the bill of some locks."""
    files = [LOCKS / f"{name}.lock" for name in names] or sorted(LOCKS.glob("*.lock"))
    parts = {part["bom-ref"]: part for file in files for part in components(file)}
    bill = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": {"type": "application", "name": "rsea_ros"}},
        "components": [parts[ref] for ref in sorted(parts)],
    }
    print(json.dumps(bill, indent=1))
    return 0


def components(lock: Path) -> Iterator[dict[str, Any]]:
    """Yield the packages of a lock with the hashes of their files; a hash is that of one wheel."""
    for block in re.split(r"\n(?=[a-z0-9])", lock.read_text(encoding="utf-8")):
        if pin := _PIN.match(block.split("\n")[0]):
            name, version, marker = pin.groups()
            ref = f"pkg:pypi/{name}@{version}"
            part: dict[str, Any] = {"type": "library", "bom-ref": ref, "name": name, "version": version}
            part |= {"purl": ref, "properties": [{"name": "lock", "value": lock.stem}]}
            part["properties"] += [{"name": "marker", "value": marker}] if marker else []
            part["properties"] += [{"name": "wheel:sha256", "value": one} for one in _HASH.findall(block)]
            yield part


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

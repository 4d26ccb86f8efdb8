"""Where only what runs is installed, every verb says its help, or in one line which extra it needs."""

import subprocess
import sys

from rsea_ros.cli.main import verbs

LACKING = ("pyarrow", "duckdb", "fsspec", "dask", "distributed", "pythonfmu3", "rclpy", "pytest")
EXTRA = {"fleet": "rsea fleet: pyarrow, duckdb, fsspec, dask, distributed: not installed, expected for"}
SCRIPT = """
import sys
sys.modules.update(dict.fromkeys({lacking}))
from rsea_ros.cli.main import main
for verb in {verbs}:
    try:
        print(verb, main([verb, "--help"]))
    except SystemExit as end:
        print(verb, end.code)
"""


def test_every_verb_says_its_help_or_the_extra_that_it_needs():
    script = SCRIPT.format(lacking=LACKING, verbs=tuple(verbs()))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    ends = dict(line.rsplit(" ", 1) for line in done.stdout.splitlines() if line.rsplit(" ", 1)[0] in verbs())
    assert ends == {verb: "2" if verb in EXTRA else "0" for verb in verbs()}, done.stderr
    assert all(line.startswith(tuple(EXTRA.values())) for line in done.stderr.splitlines()), done.stderr

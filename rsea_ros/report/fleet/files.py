"""The pages of a fleet as files of one folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rsea_ros.outputs.new_files import Destination, NewFiles
from rsea_ros.report.fleet.joint_page import joint_page
from rsea_ros.report.fleet.links import Links, page_names
from rsea_ros.report.fleet.page import fleet_page
from rsea_ros.trends.alarms import alarms_of, by_joint
from rsea_ros.trends.fleet_trends import fleet_trends
from rsea_ros.trends.series import Table
from rsea_ros.trends.settings import DEFAULT, TrendSettings
from rsea_ros.trends.weeks import Steps, steps_over

INDEX = "index.html"


def write_fleet_report(
    history: Table,
    recordings: Table,
    out: Destination | Path | str,
    *,
    store: Path | str | None = None,
    settings: TrendSettings = DEFAULT,
) -> Path:
    """Write index.html and a page for each joint, and return the path of index.html.

    history, recordings: as of trends.fleet_trends. store: the folder that the paths in `artefacts` start
    from, `out` by default. Raises ParameterError for a table without its columns, OutputError for a name
    that is taken, OSError where something cannot be written.
    """
    fleet = fleet_trends(history, recordings, settings)
    alarms = alarms_of(fleet, recordings)
    steps, groups = _steps(recordings), by_joint(alarms)
    with NewFiles(out) as new:
        links = Links(new.folder, Path(store) if store is not None else new.folder, page_names(fleet.joints))
        for joint, name in links.pages.items():
            findings = groups.get(joint, [])
            new.write(name, joint_page(joint, fleet, findings, history, recordings, steps, links))
        return new.write(INDEX, fleet_page(fleet, alarms, recordings, steps, links))


def _steps(recordings: Table) -> Steps:
    time_s = np.asarray(recordings["time_s"], float)
    known = time_s[np.isfinite(time_s)]
    return steps_over(float(known.min()), float(known.max())) if known.size else steps_over(0.0, 0.0)

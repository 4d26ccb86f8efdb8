"""`rsea fleet`: many bags, joints and months: run, report, watch, sql."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

from rsea_ros.cli import _fleet_report, _fleet_run, _fleet_sql, _fleet_watch
from rsea_ros.cli._actions import Action, add_actions
from rsea_ros.fleet.fleet_error import need_extra

HELP = "process bags of many joints: store (run), reports (report), alarms (watch), queries (sql)"
EXAMPLE = "rsea fleet run recordings --map joints.yaml --out store && rsea fleet report store --out report"
ACTIONS: Mapping[str, Action] = {
    "run": Action("process new recordings, on all cores or a cluster", _fleet_run.add_run, _fleet_run.run),
    "report": Action(
        "write pages of the fleet and of each joint", _fleet_report.add_report, _fleet_report.run
    ),
    "watch": Action("run at intervals and report changes", _fleet_watch.add_watch, _fleet_watch.run),
    "sql": Action("query the store", _fleet_sql.add_sql, _fleet_sql.run),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions."""
    add_actions(parser, ACTIONS)


def run(args: argparse.Namespace) -> int:
    """Run the action."""
    need_extra()
    return ACTIONS[args.action].run(args)

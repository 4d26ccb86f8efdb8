"""`rsea predict`: a model on the commands of a bag that it has never seen."""

from __future__ import annotations

import argparse
import csv
import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from msg_adapters import read_record
from rsea_ros.cli._topics import add_topic_options, topic_map
from rsea_ros.model.prediction import Comparison, predict
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.identification_json import fault_json, numbers

HELP = "simulate a model on the commands of a bag and say how far off it is, as JSON"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("model", help="model.yaml, or any rig")
    parser.add_argument("bag", help="rosbag2 directory, .mcap or .db3")
    parser.add_argument(
        "--out", metavar="CSV", help="predicted channels: t in s, then a column a channel in SI units"
    )
    parser.add_argument("--json", action="store_true", help="JSON is what this verb prints anyway")
    add_topic_options(parser)


def run(args: argparse.Namespace) -> int:
    """Predict, print the errors, write the CSV."""
    record = read_record([args.bag], topics=topic_map(args), strict=False)
    comparisons = predict(load_rig(args.model), record)
    if args.out:
        _write_csv(comparisons, Path(args.out))
    errors = {
        n: numbers({"rms_error": c.rms_error, "fit_percent": c.fit_percent}) for n, c in comparisons.items()
    }
    faults = [fault_json(fault) for fault in record.faults]
    print(json.dumps({"channels": errors, "data": {"faults": faults}}, indent=2))
    return 0


def _write_csv(comparisons: Mapping[str, Comparison], path: Path) -> None:
    """Write one row a stamp of the first channel; other channels are interpolated to it."""
    t = next(iter(comparisons.values())).t
    columns = [np.interp(t, c.t, c.predicted) for c in comparisons.values()]
    aside = path.with_name(path.name + ".partial")
    with aside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["t", *comparisons])
        writer.writerows(np.column_stack([t, *columns]).tolist())
    os.replace(aside, path)

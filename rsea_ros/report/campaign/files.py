"""The files of a session of experiments: experiment.json, the runs' commands, model.yaml, report.html."""

from __future__ import annotations

from pathlib import Path

from rsea_ros.experiment.campaign import Campaign, CampaignOutcome
from rsea_ros.experiment.run_shape import run_text
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.new_files import NewFiles, check_free
from rsea_ros.report.campaign.json import campaign_json
from rsea_ros.report.campaign.page import campaign_page
from rsea_ros.report.file_names import EXPERIMENT_JSON, MODEL, REPORT
from rsea_ros.report.json_values import json_text, with_provenance
from rsea_ros.report.provenance import Provenance


def check_session_free(out: Path) -> None:
    """Refuse, before any run, a folder that holds files of a session: no run is played and then lost.

    Raises OutputError for the first of them.
    """
    check_free([*(out / name for name in (EXPERIMENT_JSON, MODEL, REPORT)), *sorted(out.glob("run-*"))])


def write_campaign(
    outcome: CampaignOutcome,
    campaign: Campaign,
    out: Path,
    notes: tuple[str, ...] = (),
    provenance: Provenance | None = None,
) -> Path:
    """Write the files beside the bags of the runs; return the report's path.

    model.yaml: the rig with the likeliest cause and the values of all records together.
    """
    best = outcome.weighing.hypotheses()[0]
    with NewFiles(out) as new:
        for k, r in enumerate(outcome.rounds, 1):
            if r.proposal is not None:
                new.write(f"run-{k}.csv", run_text(r.proposal.command, r.proposal.rate))
        new.write(EXPERIMENT_JSON, json_text(with_provenance(campaign_json(outcome, campaign), provenance)))
        new.write(MODEL, rig_text(best.rig))
        text = campaign_page(outcome, campaign.rig.name, campaign.asked.limits, notes, provenance)
        return new.write(REPORT, text)

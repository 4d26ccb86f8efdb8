"""A task that never ends: its recording is quarantined with the reason, and its worker goes on."""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from rsea_extras.fleet import analysis, task as time_limit
from rsea_extras.fleet.task import OutOfTime, limit_time
from rsea_ros.cli.main import main

MAP = "joints:\n  knee: {rig: paper_high_impedance}\n"


def endless(*_: object, **__: object) -> dict[str, str]:
    """Work for ever, and let no ordinary error end it."""
    while True:
        try:
            time.sleep(0.001)
        except Exception:
            continue


def has_ended() -> bool:
    try:
        with limit_time(0.05):
            endless()
    except OutOfTime:
        return True
    return False


def test_a_block_that_never_ends_is_ended_in_any_thread():
    assert has_ended()
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(has_ended).result(10.0)


def test_a_block_in_time_hears_nothing_of_its_limit():
    with limit_time(0.02):
        pass
    until = time.monotonic() + 0.05
    while time.monotonic() < until:
        pass


def test_a_worker_whose_call_never_returns_ends_itself(monkeypatch):
    ends: list[int] = []
    monkeypatch.setattr(time_limit, "GRACE", 0.02)
    monkeypatch.setattr(os, "_exit", ends.append)

    def hang() -> None:
        with pytest.raises(OutOfTime), limit_time(0.02):
            time.sleep(0.3)  # one call: the exception waits for its end

    with ThreadPoolExecutor(1) as pool:
        pool.submit(hang).result(10.0)
    assert ends == [70]


def test_an_endless_recording_is_quarantined_and_tried_again(folder, tmp_path, monkeypatch, capsys):
    (tmp_path / "joints.yaml").write_text(MAP)
    run = ["fleet", "run", str(folder / "run0.mcap"), "--map", str(tmp_path / "joints.yaml"), "--serial"]
    run += ["--out", str(tmp_path / "store"), "--time-limit", "0.001"]
    monkeypatch.setattr(analysis, "analyse", endless)
    assert main([*run, "--fail-on", "quarantined"]) == 1
    said = capsys.readouterr().out
    assert "run0.mcap: took more than 0.001 min: a larger --time-limit, then --again" in said
    assert main(run) == 0 and "nothing new, 1 in the store before" in capsys.readouterr().out
    monkeypatch.setattr(analysis, "analyse", lambda *_, **__: {})
    assert main([*run, "--again"]) == 0 and "1 done" in capsys.readouterr().out

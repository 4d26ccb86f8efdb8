"""How a supervisor starts: as a service at a path that is named, or for one driver at its stdin."""

from __future__ import annotations

import signal
import sys

import pytest

from rsea_ros.hardware import supervisor


@pytest.fixture
def calls(monkeypatch):
    """Return what was called: urgency, ignored signals, and whom it served."""
    made = []
    monkeypatch.setattr(supervisor, "hurry", lambda: made.append("hurry"))
    monkeypatch.setattr(supervisor.signal, "signal", lambda number, how: made.append((number, how)))
    monkeypatch.setattr(supervisor, "listen", lambda path: made.append(("listen", path)))
    monkeypatch.setattr(supervisor, "serve", lambda connection: made.append(("serve", connection)))
    monkeypatch.setattr(supervisor.socket, "socket", lambda **options: options)
    return made


def test_a_service_listens_at_its_path_and_outlives_the_terminal(calls, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["supervisor", "--listen", "/run/rsea", "more"])
    supervisor.main()
    assert calls == ["hurry", (signal.SIGHUP, signal.SIG_IGN), ("listen", "/run/rsea")]


def test_one_driver_is_served_whatever_the_terminal_says(calls, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["supervisor"])
    supervisor.main()
    deaf = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
    assert calls == ["hurry", *((number, signal.SIG_IGN) for number in deaf), ("serve", {"fileno": 0})]

"""A simulated bench in a child process: its addresses, and requests to it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from rsea_ros.errors import DeviceError

ROOT = Path(__file__).resolve().parents[3]


class RemoteBench:
    """Start `rsea bench`; leave the block, and it is gone.

    port, ft_port, page_port: where motor, RDT stream and calibration are. launch: what starts the driver.
    """

    def __init__(self, path: Path, *options: object) -> None:
        path = path.absolute()
        words = [str(o.absolute() if isinstance(o, Path) else o) for o in ("--port", path, *options)]
        self._process = self._begin(["bench", "--requests", *words])
        place = self._receive()
        self.port, self.ft_port, self.page_port = str(path), int(place["ft_port"]), int(place["page_port"])
        self.launch = str(place["launch"])
        self._more = {n: value for n, value in place.items() if n.startswith(("encoder", "can", "device"))}

    def _begin(self, words: list[str]) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "rsea_ros", *words], cwd=ROOT,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        )  # fmt: skip

    def __enter__(self) -> RemoteBench:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def parameters(self) -> dict[str, object]:
        """Return the parameters that a driver node needs to find it."""
        place = {"device": "dynamixel_netft", "port": self.port, **self._more}
        if "encoder_id" in place:
            return place | {"ft_host": ""}
        return place | {"ft_host": "127.0.0.1", "ft_port": self.ft_port, "ft_page_port": self.page_port}

    def hurry(self, priority: int = 50) -> bool:
        """Let it answer at SCHED_FIFO, as hardware with its own processors; return whether it may."""
        try:
            os.sched_setscheduler(self._process.pid, os.SCHED_FIFO, os.sched_param(priority))
        except PermissionError:
            return False
        return True

    def ask(self, do: str, **values: object) -> dict[str, Any]:
        """Send a request and return its answer. Raises DeviceError for an impossible request."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": do, **values}).encode() + b"\n")
        self._process.stdin.flush()
        answer = self._receive()
        if "error" in answer:
            raise DeviceError(f"bench: {answer['error']}")
        return answer

    def log(self, since: int = 0) -> dict[str, Any]:
        """Return the bench's log since an instant of the monotonic clock, ns."""
        result: dict[str, Any] = self.ask("log", since=since)["result"]
        return result

    def torque(self, motor: int = 0) -> tuple[int, bool]:
        """Return the goal in counts and whether torque is on, of a motor by its place on the line."""
        goal, on = self.ask("torque", motor=motor)["result"]
        return int(goal), bool(on)

    def stood_still(self, since: int) -> float:
        """Return for how long the bench itself was held up at most since an instant, ms."""
        pauses = self.ask("pauses", since=since)["result"]
        return max((length for _, length in pauses), default=0) / 1e6

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None and self._process.stdout is not None
        if self._process.poll() is None:
            self._process.stdin.close()
            try:
                self._process.wait(5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._process.stdout.close()

    def _receive(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise DeviceError(f"bench ended with status {self._process.wait()}, expected an answer")
        answer: dict[str, Any] = json.loads(line)
        return answer

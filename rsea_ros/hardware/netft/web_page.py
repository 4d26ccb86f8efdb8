"""A page of a local device: one request, one time limit, no redirect, no proxy."""

from __future__ import annotations

import io
import socket
import time
from http.client import HTTPException, HTTPResponse
from typing import Any, cast

from rsea_ros.documents.wording import quote
from rsea_ros.errors import DeviceError

LARGEST = 1 << 20
"""Bytes. The calibration of an F/T sensor has 4 kB."""


def get(host: str, port: int, path: str, limit: float) -> bytes:
    """Return the answer of a device to GET within a limit in s. Raises DeviceError."""
    address = f"http://{host}:{port}{path}"
    deadline = time.monotonic() + limit
    try:
        with socket.create_connection((host, port), timeout=limit) as connection:
            request = f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n"
            connection.sendall(request.encode("ascii"))
            return _answer(connection, deadline)
    except TimeoutError:
        raise DeviceError(f"F/T sensor {address}: no whole answer within {limit:g} s") from None
    except (OSError, HTTPException, ValueError) as error:
        reason = quote(str(error) or type(error).__name__, 120)[1:-1]
        raise DeviceError(f"F/T sensor {address}: {reason}, expected its calibration") from None


def _answer(connection: socket.socket, deadline: float) -> bytes:
    """Return the body of a response. Raises OSError, HTTPException, ValueError."""
    response = HTTPResponse(cast("socket.socket", _Source(connection, deadline)))
    response.begin()
    if response.status != 200:
        raise ValueError(f"status {response.status} {response.reason}")
    body = response.read(LARGEST + 1)
    if len(body) > LARGEST:
        raise ValueError(f"more than {LARGEST} bytes")
    if response.length:
        raise ValueError(f"{response.length} bytes are missing at its end")
    return body


class _Source(io.RawIOBase):
    """Bytes of a connection until a deadline; every wait is limited to the remaining time."""

    def __init__(self, connection: socket.socket, deadline: float) -> None:
        self._connection = connection
        self._deadline = deadline

    def makefile(self, mode: str) -> io.BufferedReader:
        """Return a file for HTTPResponse."""
        return io.BufferedReader(self)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left = self._deadline - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        self._connection.settimeout(left)
        return self._connection.recv_into(buffer)

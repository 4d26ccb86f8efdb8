"""The page of an F/T sensor over a real connection: whatever answers, one line within the time limit."""

from __future__ import annotations

import contextlib
import itertools
import math
import socket
import threading
import time

import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.netft import calibration, calibration as web_page

GOOD = (
    b"<?xml version='1.0'?><netft><cfgcpf>1000000</cfgcpf><cfgcpt>1000</cfgcpt>"
    b"<scfgfu>N</scfgfu><scfgtu>N-mm</scfgtu><comrdtrate>7000</comrdtrate></netft>"
)
HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\n"
LAUGHS = b"<!DOCTYPE l [<!ENTITY a0 'ha'>%s]><l>&a9;</l>" % b"".join(
    b"<!ENTITY a%d '%s'>" % (k, b"&a%d;" % (k - 1) * 10) for k in range(1, 10)
)


@contextlib.contextmanager
def serve(*parts, pause=0.0):
    """Serve one connection: parts of bytes with pauses between them; yield port and the request."""
    requests = []
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def run():
            connection, _ = listener.accept()
            with connection, contextlib.suppress(OSError):
                requests.append(connection.recv(4096))
                for part in itertools.chain(*parts):
                    connection.sendall(part)
                    time.sleep(pause)

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        yield listener.getsockname()[1], requests
        thread.join(5.0)


def whole(body, head=HEAD):
    return [head + b"Content-Length: %d\r\n\r\n" % len(body), body]


def test_a_sensor_that_answers_gives_its_calibration():
    with serve(whole(GOOD)) as (port, requests):
        read = calibration.fetch("127.0.0.1", port)
    assert (read.force, read.torque, read.rate) == (1e-6, 1e-6, 7000.0)
    assert requests[0].startswith(b"GET /netftapi2.xml HTTP/1.1\r\nHost: 127.0.0.1:")


@pytest.mark.parametrize(
    ("stated", "known"), [("8", "8"), ("0", "0"), ("", ""), ("&lt;b&gt;", ""), ("-1", ""), ("9" * 4, "")]
)
def test_the_number_of_its_low_pass_is_read(stated, known):
    page = GOOD.replace(b"</netft>", f"<setuserfilter>{stated}</setuserfilter></netft>".encode())
    assert calibration.parse(page).low_pass == known
    assert calibration.parse(GOOD).low_pass == ""


@pytest.mark.parametrize(
    ("field", "about_z"),
    [
        (b"<cfgmr>700;700;1700;30000;30000;30000</cfgmr>", 30.0),
        (b"<cfgmr>700, 700, 1700, 30000, 30000, 30000</cfgmr>", 30.0),
        (b"", math.inf),
        (b"<cfgmr>700;700</cfgmr>", math.inf),
        (b"<cfgmr>0;0;0;0;0;0</cfgmr>", math.inf),
    ],
)
def test_the_range_of_the_sensor_is_read_where_its_page_states_one(field, about_z):
    read = calibration.parse(GOOD.replace(b"</netft>", field + b"</netft>"))
    assert read.range[5] == pytest.approx(about_z)


def test_a_page_in_pieces_and_without_a_length_is_read():
    with serve([HEAD + b"\r\n", GOOD[:50], GOOD[50:]], pause=0.01) as (port, _):
        assert calibration.fetch("127.0.0.1", port).force == 1e-6
    chunks = [b"%x\r\n%s\r\n" % (len(part), part) for part in (GOOD[:50], GOOD[50:])]
    with serve([HEAD + b"Transfer-Encoding: chunked\r\n\r\n", *chunks, b"0\r\n\r\n"]) as (port, _):
        assert calibration.fetch("127.0.0.1", port).force == 1e-6


REFUSED = {
    "redirect": (
        [b"HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n"],
        "status 302 Found, expected its calibration",
    ),
    "missing": ([b"HTTP/1.1 404 Not Found\r\n\r\n"], "status 404 Not Found"),
    "closed": ([b""], "Remote end closed connection"),
    "cut": ([HEAD + b"Content-Length: 999\r\n\r\n", GOOD], r"\d+ bytes are missing at its end"),
    "bad chunks": ([HEAD + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n"], "expected its calibration"),
    "many headers": ([HEAD, b"X-A: b\r\n" * 1000], "got more than 100 headers"),
    "laughs": (whole(LAUGHS), "not XML .entity 'a0' declared"),
    "outside entity": (
        whole(b"<!DOCTYPE l [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><l>&a;</l>"),
        "not XML .entity 'a' declared",
    ),
    "empty": (whole(b""), "not XML .no element"),
    "other xml": (whole(b"<svg/>"), "scfgfu = '', expected one of N, kN"),
    "tiny": (whole(GOOD.replace(b"1000000", b"1e-300")), "cfgcpf = '1e-300', expected a number above 0"),
    "long": (whole(GOOD.replace(b"1000000", b"9" * 9999)), "cfgcpf = '9999"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_page_without_a_calibration_is_one_line(case):
    parts, message = REFUSED[case]
    with serve(parts) as (port, _), pytest.raises(DeviceError, match=message) as caught:
        calibration.fetch("127.0.0.1", port)
    assert f"http://127.0.0.1:{port}/netftapi2.xml" in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


DRIPPING = {
    "body": ([HEAD + b"\r\n"], b" "),
    "silence": ([b""], b""),
}


@pytest.mark.parametrize("case", DRIPPING)
def test_a_page_that_drips_ends_in_time(case):
    head, drop = DRIPPING[case]
    with serve(head, [drop] * 60, pause=0.02) as (port, _):
        started = time.monotonic()
        with pytest.raises(DeviceError, match=r"no whole answer within 0.2 s"):
            calibration.fetch("127.0.0.1", port, timeout=0.2)
        assert time.monotonic() - started < 1.0  # six times shorter than the dripping page takes


def test_an_endless_page_is_abandoned_at_the_size_limit(monkeypatch):
    monkeypatch.setattr(web_page, "LARGEST", 1000)
    with (
        serve([HEAD + b"\r\n"], itertools.repeat(b" " * 500)) as (port, _),
        pytest.raises(DeviceError, match="more than 1000 bytes"),
    ):
        calibration.fetch("127.0.0.1", port)


def test_a_sensor_that_does_not_answer_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(DeviceError, match=r"Connection refused"):
        calibration.fetch("127.0.0.1", port)

"""The page in a real browser: it draws, logs no error, contacts no other server, and releases the command."""

import time
from contextlib import closing

import pytest

from rsea_extras.watch.command import PATIENCE, RELEASE
from test.nodes.stalls import until
from test.report.browser import Browser

HIDDEN = "Object.defineProperty(document, 'hidden', {value: %s, configurable: true});" \
    "document.dispatchEvent(new Event('visibilitychange'))"  # fmt: skip
INK = """(() => { const c = document.getElementById('%s'); const d = c.getContext('2d')
  .getImageData(0, 0, c.width, c.height).data; let n = 0; for (let k = 3; k < d.length; k += 4) n += d[k] > 0;
  return n / (c.width * c.height); })()"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with closing(Browser(tmp_path_factory.mktemp("profile"))) as made:
        yield made


@pytest.fixture
def page(server, browser):
    """The page, live."""
    browser.errors.clear()
    browser.requests.clear()
    browser.open(*server.addresses)
    browser.until("typeof now === 'number' && now > 0.3")
    return browser


def text(page, name):
    return page.value(f"document.getElementById('{name}').innerText")


def await_torque(commander):
    until(lambda: (commander.torque(time.monotonic()) or 0.0) >= 0.5, 60.0)


def test_the_page_draws_without_an_error_and_contacts_only_its_server(page, server):
    page.until("document.querySelector('#health b')")
    assert page.value(INK % "torque") > 0.01 and page.value(INK % "flag") > 0.2
    assert text(page, "pure") == "pure torque" and "<b>plant" in text(page, "health")
    assert page.value("location.href") == f"http://localhost:{server.port}/", "the token left the address"
    for width in (1400, 400):
        page.size(width, 900)
        assert page.value("document.documentElement.scrollWidth") <= width
    assert all(address.startswith(f"http://localhost:{server.port}/") for address in page.requests)
    assert page.errors == []


@pytest.mark.parametrize(
    "leave",
    [HIDDEN % "true", "socket.close()", "document.getElementById('go').click()", "location = 'about:blank'"],
)
def test_the_torque_is_zero_when_the_page_is_left(page, commander, leave):
    page.until("!document.getElementById('go').disabled && !document.getElementById('command').hidden")
    page.value("document.getElementById('go').click()")
    await_torque(commander)
    page.value(leave)
    left, late = time.monotonic(), 0.0
    while commander.holder is not None:
        before = time.monotonic()
        time.sleep(0.002)
        late += time.monotonic() - before - 0.002  # by which this machine stood still
        assert time.monotonic() < left + PATIENCE + late
    time.sleep(RELEASE)
    assert commander.torque(time.monotonic() + RELEASE) in (0.0, None)


def test_the_page_never_requests_more_than_the_limit(page, commander):
    page.until("document.getElementById('amplitude').max === '10'")
    page.value("document.getElementById('amplitude').value = '10.5'; document.getElementById('go').click()")
    assert text(page, "go") == "Start" and not commander.active

"""The server of the page answers its own page only, bounds what it holds, and computes nothing for a mere request."""

import asyncio
import json
import re
import time
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from urllib.parse import urlparse

import pytest

pytest.importorskip("bokeh")

from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from tests.explore.serving import served


@pytest.fixture(scope="module")
def place():
    """Address of a page of the beam, split into its parts."""
    with served("impact-beam") as address:
        yield urlparse(address)


@pytest.fixture(scope="module")
def bounded():
    """Address of a server that allows three pages, and the number of its process."""
    three = "import chaosgym.explore.gate as gate; gate.MOST_PAGES = 3"
    with served("impact-beam", with_process=True, before=three) as both:
        yield both


@contextmanager
def answer(place, path=None, **headers):
    """Answer to GET of a path, that of the page by default."""
    asked = HTTPConnection("localhost", place.port, timeout=60)
    asked.request(
        "GET", place.path if path is None else path, headers={k.replace("_", "-"): v for k, v in headers.items()}
    )
    with closing(asked):
        yield asked.getresponse()


def token(page):
    """Token with which a page opens its websocket."""
    return re.search(r'"token":"([^"]+)"', page)[1]


async def greeting(place, origin, token):
    """First message of a websocket that a page of an origin opens."""
    request = HTTPRequest(f"ws://localhost:{place.port}{place.path}ws", headers={"Origin": origin} if origin else {})
    socket = await websocket_connect(request, subprotocols=["bokeh", token])
    said = [await socket.read_message() for _ in range(3)]
    socket.close()
    while await socket.read_message() is not None:
        pass  # until the other side has closed it too
    return said


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        (None, {}, 200),
        (None, {"Sec-Fetch-Site": "same-origin"}, 200),
        (None, {"Sec-Fetch-Site": "none"}, 200),
        (None, {"Sec-Fetch-Site": "cross-site"}, 403),
        (None, {"Sec-Fetch-Site": "same-site"}, 403),
        (None, {"Origin": "http://evil.example"}, 403),
        (None, {"Origin": "null"}, 403),
        (None, {"Host": "evil.example:5006"}, 403),
        ("/", {}, 403),
        ("/ws", {}, 403),
        ("/static/js/bokeh.min.js", {}, 403),
        ("PAGEautoload.js?bokeh-autoload-element=x", {"Origin": "http://evil.example"}, 403),
        ("PAGEautoload.js?bokeh-autoload-element=x", {}, 403),
        ("PAGEmetadata", {}, 403),
        ("PAGEstatic/../metadata", {}, 403),
        ("PAGE?bokeh-session-id=x", {}, 400),
        ("PAGE?machine=%ff", {}, 400),
        ("PAGEstatic/js/bokeh.min.js", {}, 200),
        ("/favicon.ico", {}, 204),
    ],
)
def test_only_its_own_page_is_answered(place, path, headers, status):
    """Without the secret, for other sites, by other names, and at Bokeh's further addresses: refused, with no token."""
    asked = None if path is None else path.replace("PAGE", place.path)
    with answer(place, asked, **headers) as found:
        assert found.status == status
        text = found.read().decode()
        assert found.headers["Access-Control-Allow-Origin"] is None
        assert found.headers["X-Frame-Options"] == "DENY"
        assert found.headers["Content-Security-Policy"] == "frame-ancestors 'none'"
        assert status in (200, 204) or ("token" not in text and text.count("\n") <= 1)


def test_the_secret_is_drawn_anew_and_long(place, bounded):
    """Two servers have two secrets of 128 bits."""
    assert urlparse(bounded[0]).path != place.path
    assert len(place.path) >= 22


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1"])
def test_both_names_of_this_computer_get_page_and_websocket(place, name):
    """Either name opens a page that works."""
    host = f"{name}:{place.port}"
    with answer(place, Host=host) as found:
        page = found.read().decode()
    said = asyncio.run(greeting(place._replace(netloc=host), f"http://{host}", token(page)))
    assert json.loads(said[0])["msgtype"] == "ACK"


def test_a_websocket_of_another_site_is_refused(place):
    """Even with a token of a session."""
    with answer(place) as found:
        page = found.read().decode()
    with pytest.raises(HTTPClientError, match="403"):
        asyncio.run(greeting(place, "http://evil.example", token(page)))


def _status(process, name):
    with open(f"/proc/{process}/status") as status:
        return int(re.search(rf"{name}:\s+(\d+)", status.read())[1])


def test_asking_for_pages_computes_nothing_and_they_are_bounded(bounded):
    """Where three pages are allowed, six requests give three; none begins to compute."""
    address, process = bounded
    place, threads, answered = urlparse(address), _status(process, "Threads"), []
    for _ in range(6):
        with answer(place) as found:
            answered.append(found.status)
            text = found.read().decode()
    assert answered == [200, 200, 200, 503, 503, 503]
    assert text == "3 pages are open; close one, and open this one again after half a minute\n"
    assert _status(process, "Threads") == threads, "no page computes that no browser has opened"


@pytest.mark.slow
def test_memory_of_closed_pages_is_given_back():
    """A second and a third dozen pages hold no more than the first, within a tenth.

    Pages without a browser are closed after four seconds here, and after half a minute otherwise.
    """
    soon = "check_unused_sessions_milliseconds=1000, unused_session_lifetime_milliseconds=3000"
    before = f"import bokeh.server.server as s, functools; s.Server = functools.partial(s.Server, {soon})"
    with served("impact-beam", with_process=True, before=before) as (address, process):
        place, held = urlparse(address), []
        for again in range(3):
            time.sleep(8.0 if again else 0.0)
            for _ in range(12):
                with answer(place) as found:
                    assert found.status == 200
                    found.read()
            held.append(_status(process, "VmRSS") / 1024)
        print([f"{one:.0f} MB" for one in held])
        assert held[-1] < 1.1 * held[0]

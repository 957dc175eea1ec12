"""The page in a real browser: it opens, a slider moves, the verdict follows, and nothing leaves this computer."""

import math
from base64 import b64decode
from http.client import HTTPConnection
from io import BytesIO
from urllib.parse import urlparse

import pytest
from matplotlib.image import imread

pytest.importorskip("bokeh")

from chaosgym.machines.machine_file import template
from tests.browser import CHROMIUM, Browser
from tests.explore.serving import SMALL, served

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

DEEP = """
const all = (root, want) => [...root.querySelectorAll('*')].flatMap(
    node => [...(node.matches(want) ? [node] : []), ...(node.shadowRoot ? all(node.shadowRoot, want) : [])]);
const middle = node => {
    const box = node.getBoundingClientRect();
    return [box.x + box.width / 2, box.y + box.height / 2];
};
"""
"""Elements inside of shadow roots, and where they are."""


def deep(expression):
    """A JavaScript expression that may look into shadow roots."""
    return f"(() => {{ {DEEP} return {expression} }})()"


HEADLINE = deep("all(document, 'h2').map(node => node.textContent).join()")


@pytest.fixture(scope="module")
def address():
    """Address of a page of the beam at 20 Hz."""
    with served("impact-beam", "--frequency-hz", "20", before=SMALL) as address:
        yield address


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """One browser for all pages; its user wants little motion, so that no picture is drawn over and over."""
    with Browser(tmp_path_factory.mktemp("profile")) as opened:
        opened.motion("reduce")
        yield opened


SPAN = "(({start, end}) => end - start)(Bokeh.documents[0].get_model_by_name('section').x_range)"
"""How much of the displacement [mm] the section shows."""


def test_a_slider_is_dragged_and_the_verdict_follows(address, browser):
    """At 20 Hz the beam is periodic; dragged to the right end, 30 Hz, it is chaotic, and so says the address."""
    browser.visit(address, width=1400)
    assert browser.wait(f"{HEADLINE}.includes('periodic, period 1 (certified')")
    frequency = "Bokeh.documents[0].get_model_by_name('excitation_frequency').value"
    assert browser.value(frequency) == 20.0
    assert browser.value(SPAN) > 1e-3, "one dot: what rounding moves is not magnified"
    beside = "Bokeh.documents[0].get_model_by_name('beside').text"
    assert "48 random starts" in browser.wait(f"{beside}.includes('run-up from 4 Hz') ? {beside} : ''")
    browser.drag(browser.value(deep("middle(all(document, '.noUi-handle')[0])")), 400.0)
    assert browser.wait(f"{HEADLINE}.includes('chaotic')")
    assert browser.wait(f"{beside}.includes('only beside a motion that repeats')"), "not those of another speed"
    assert browser.value(frequency) == 30.0
    assert browser.wait("location.search.startsWith('?machine=impact-beam')")
    assert browser.wait("!location.search.includes('excitation_frequency')"), "30 Hz is the default of the beam"
    python = browser.value("Bokeh.documents[0].get_model_by_name('python').value")
    assert "ImpactBeam(" in python
    assert "excitation_frequency" not in python
    check(browser.seen())


def test_the_impacts_are_heard(address, browser):
    """The button plays as many seconds of the contact force as it says, and no script complains."""
    browser.visit(address, width=1400)
    browser.wait(f"{HEADLINE}.includes('periodic')")
    browser.value(
        "(() => { const start = AudioBufferSourceNode.prototype.start; window.heard = [];"
        "AudioBufferSourceNode.prototype.start = function() {"
        "window.heard.push(Math.max(...this.buffer.getChannelData(0)), this.buffer.duration); start.call(this) } })()"
    )
    listen = "(() => { const button = all(document, 'button').find(b => b.textContent.includes('Listen'));"
    browser.click(browser.value(deep(f"{listen} button.scrollIntoView(); return middle(button) }})()")))
    assert browser.wait("window.heard.length === 2")
    loudest, seconds = browser.value("window.heard")
    assert loudest == pytest.approx(0.8, rel=1e-6)
    assert 0.05 < seconds < 2.0
    check(browser.seen())


def test_the_page_tells_what_is_calm_and_saves_itself(address, browser):
    """At 0.127 mm the beam is calm up to 10.61 Hz, and so says the page; its picture and command are files.

    Dragged to another speed, the page says how that one lies to what is calm.
    """
    browser.visit(address.partition("?")[0] + "?machine=impact-beam&excitation_frequency=10", width=1400)
    calm = "Bokeh.documents[0].get_model_by_name('calm').text"
    told = browser.wait(f"{calm}.includes('its own speed') ? {calm} : ''")
    assert "8.88 to 10.61 Hz" in told
    assert "its own speed, 10 Hz, is 6.1% from an end" in told
    browser.drag(browser.value(deep("middle(all(document, '.noUi-handle')[0])")), 400.0)
    assert browser.wait(f"{calm}.includes('its own speed, 30 Hz, is in none of these')")
    assert "impact-beam" in browser.value(deep("all(document, 'h1').map(node => node.textContent).join()"))
    browser.value(
        "(() => { window.saved = []; HTMLAnchorElement.prototype.click = function() {"
        "window.saved.push([this.download, this.href]) } })()"
    )
    for label in ("Save picture", "Save command"):
        button = f"(() => {{ const one = all(document, 'button').find(b => b.textContent.trim() === '{label}');"
        browser.click(browser.value(deep(f"{button} one.scrollIntoView(); return middle(one) }})()")))
    assert browser.wait("window.saved.length === 2")
    (picture, pixels), (commands, _) = browser.value("window.saved")
    assert picture.endswith(".png")
    image = imread(BytesIO(b64decode(pixels.split(",")[1])))
    assert min(image.shape[:2]) > 500
    assert image.std() > 0.01, "the picture is empty"
    assert commands.endswith(".txt")
    check(browser.seen())


def test_an_agent_plays_its_job(address, browser):
    """The button shows the machine at work: the speed moves by itself, and the page says where the job stands."""
    browser.visit(address, width=1400)
    browser.wait(f"{HEADLINE}.includes('periodic')")
    browser.click(browser.value(deep("middle(all(document, 'button').find(b => b.textContent.includes('agent')))")))
    told = deep(
        "all(document, 'div').map(node => node.textContent).find(text => /^step ([3-9]|..+) of 120/.test(text))"
    )
    assert "Hz" in browser.wait(told, 240.0)
    check(browser.seen())


def test_the_file_of_a_machine_is_dragged_too(browser, tmp_path):
    """The template has period 2 at 14 Hz and period 1 at 17 Hz; its file is in the address, and no agent plays it."""
    path = tmp_path / "my-machine.toml"
    path.write_text(template())
    with served(str(path), before=SMALL) as address:
        browser.visit(address, width=1400)
        assert browser.wait(f"{HEADLINE}.includes('periodic, period 2 (certified')")
        browser.drag(browser.value(deep("middle(all(document, '.noUi-handle')[0])")), 60.0)
        assert browser.wait(f"{HEADLINE}.includes('periodic, period 1 (certified')")
        assert browser.wait("location.search.includes('my-machine.toml&speed=17')")
        assert browser.value("Bokeh.documents[0].get_model_by_name('play').visible") is False
        check(browser.seen())


MODEL = "Bokeh.documents[0].get_model_by_name"
LINK = f"(() => {{ const {{x, y}} = {MODEL}('moving line').data, i = x.length - 3; return [...x[i], ...y[i]] }})()"
"""Ends of the last link of a mechanism, which ring and bar of the force follow: across, then up."""

PICTURE = deep(
    "(() => { const view = Bokeh.index.find_one_by_id(Bokeh.documents[0].get_model_by_name('moving').id);"
    "return view.canvas_view.primary.canvas.toDataURL() })()"
)
"""What is on the canvas of the machine's picture."""

BUSY = """(() => {
const send = WebSocket.prototype.send, ask = window.requestAnimationFrame, busy = () => window.busy = performance.now()
WebSocket.prototype.send = function(...all) { busy(); send.call(this, ...all) }
window.requestAnimationFrame = draw => { busy(); return ask(draw) }
busy()
})()"""
"""Keeps when the page last drew or sent anything; the orbit diagram draws until it is full."""


def test_the_links_of_a_mechanism_move(browser):
    """A link moves and stays as long as it is; paused, nothing is drawn or sent, and a slider is followed still."""
    browser.visit("about:blank")  # the page before complains that its server has gone
    browser.motion("no-preference")
    with served("docs/machines/quick-return.toml", before=SMALL) as address:
        browser.visit(address, width=1400)
        assert browser.wait(f"{HEADLINE}.includes('periodic')")
        browser.wait(f"{MODEL}('moving line').data.x.length > 2")
        moved = f"(at => `${{at}}` != window.at && (window.at = `${{at}}`) && at)({LINK})"
        lengths = [math.dist(at[::2], at[1::2]) for at in (browser.wait(moved) for _ in range(4))]
        assert lengths == pytest.approx([0.15] * 4, rel=1e-5), "the link's length in the file"
        browser.wait(f"{PICTURE} != '{browser.value(PICTURE)}'")
        told = deep("all(document, 'div').map(node => node.textContent).find(text => /^Gap of/.test(text))")
        assert browser.value(told).startswith("Gap of 0.1 mm at the slot, drawn 240 times")
        assert "times slower" in browser.value(told)
        browser.click(browser.value(deep("middle(all(document, 'button').find(b => b.textContent == 'Pause'))")))
        assert browser.wait(f"!{MODEL}('pause').active")
        browser.value(BUSY)
        browser.wait("performance.now() - window.busy > 2000", 240.0)
        held, shown = browser.value(LINK), browser.value(PICTURE)
        browser.wait("performance.now() - window.busy > 3000")
        assert browser.value(LINK) == held
        assert browser.value(PICTURE) == shown
        browser.drag(browser.value(deep("middle(all(document, '.noUi-handle')[1])")), 60.0)
        browser.wait(f"{PICTURE} != '{shown}'")
        browser.wait(f"!{told}.includes('Gap of 0.1 mm')")
        assert browser.value(LINK) == held, "at the same moment"
        check(browser.seen())
    browser.motion("reduce")


def test_a_link_that_says_nonsense_is_answered_in_words(address, browser):
    """No error page: the reason."""
    browser.visit(address.partition("?")[0] + "?machine=engine")
    assert browser.wait(f"{HEADLINE}.includes('can\\'t be shown')")


def test_links_of_all_kinds_are_answered(address, browser):
    """A field without a machine is that of the machine served; a field that no machine has is told."""
    base = address.partition("?")[0]
    browser.visit(base + "?excitation_frequency=19.5", width=1400)
    assert browser.wait("location.search.includes('excitation_frequency=19.5')")
    browser.visit(base + "?clearence=1")
    assert browser.wait(f"{HEADLINE}.includes('can\\'t be shown')")


def test_the_page_stays_alive_while_a_link_is_computed(address, browser):
    """Forty modes, stiff stops and a cycle of a thousand seconds hold their own page, and no other."""
    base = address.partition("?")[0]
    hard = "?machine=impact-beam&n_modes=40&contact_stiffness=1e12&excitation_frequency=0.001"
    place = urlparse(base)
    for query in (hard, ""):
        asked = HTTPConnection("localhost", place.port, timeout=60)
        asked.request("GET", place.path + query)
        assert asked.getresponse().status == 200
        asked.close()


def test_the_page_fits(address, browser):
    """No scrolling sideways; the machine and two pictures beside each other, or one column; every handle has a name."""
    browser.visit(address, width=1280)
    browser.wait(f"{HEADLINE}.includes('periodic')")
    browser.wait(deep("all(document, '.noUi-handle').every(node => node.getAttribute('aria-label'))"))
    labels = browser.value(deep("all(document, '.noUi-handle').map(node => node.getAttribute('aria-label'))"))
    assert len(set(labels)) == 3
    assert browser.value("Bokeh.documents[0].get_model_by_name('pause').active") is False, "little motion is wanted"
    for width, columns in ((1280, 3), (400, 1)):
        browser.resize(width)
        places = deep("new Set(all(document, '.bk-Figure').map(n => Math.round(middle(n)[0] / 20))).size")
        browser.wait(f"{places} == {columns}", 10.0)
        whole, shown = browser.seen().width
        assert whole <= shown <= width


def test_closing_tabs_prints_nothing(tmp_path):
    """Tabs that are closed while the page computes leave the terminal as it was."""
    with (
        (tmp_path / "err").open("w") as errors,
        served("impact-beam", stderr=errors) as address,
        Browser(tmp_path / "profile") as browser,
    ):
        browser.visit(address, width=1400)
        browser.value("location.reload()")
    said = (tmp_path / "err").read_text()
    assert "Traceback" not in said
    assert [line for line in said.splitlines() if "compil" not in line and line not in ("", "Aborted.")] == []


def check(seen):
    """Nothing is asked of another computer, and no script complains."""
    hosts = {urlparse(url).hostname for url in seen.requests if not url.startswith(("data:", "blob:"))}
    assert hosts == {"localhost"}
    assert seen.complaints == []

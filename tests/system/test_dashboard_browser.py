"""The page in a real Chromium: what is drawn, what is said, how it comes back, and whom it asks."""

import contextlib
import pathlib
import re

import numpy as np
import pytest

from services.clock import WallClock
from services.dashboard.chromium import Chromium, find_chromium
from services.dashboard.control import Control
from services.dashboard.hub import Hub
from services.dashboard.rehearsal import Rehearsal, served
from services.dashboard.server import make_app
from services.dashboard.view import View
from services.errors import RefusalError
from tests.services.dashboard_kit import BLOCK, FACTS, RATE_HZ, chatter, event, force, report, state

pytestmark = [
    pytest.mark.system,
    pytest.mark.browser,
    pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this host (Debian: apt-get install chromium)"),
]
ROOT = pathlib.Path(__file__).resolve().parents[2]
LINE_HZ, AMPLITUDE_N, CHATTER_FROM = 652.0, 40.0, 300
VILE = "<img src=x onerror='window.broken = true'><script>window.broken = true</script>"


def heard(blocks=4000):
    """Quiet cutting, then chatter: every value is known."""
    said = []
    for n in range(blocks):
        time = (n * BLOCK + np.arange(BLOCK)) / RATE_HZ
        swing = AMPLITUDE_N if n >= CHATTER_FROM else 1.0
        wave = 60.0 + swing * np.sin(2 * np.pi * LINE_HZ * time)
        verdict = chatter(n) if n >= CHATTER_FROM else report(n)
        said.append([state(n, shift_requested_deg=2.76, shift_applied_deg=2.5), force(n, wave, 2.0 * wave), verdict])
    said[10].append(event(10, text=VILE))
    return said


@pytest.fixture(scope="module")
def story():
    return heard()


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    try:
        browser = Chromium(tmp_path_factory.mktemp("profile"))
    except RefusalError as error:
        pytest.skip(f"Chromium does not start here: {error.reason}")
    with browser:
        yield browser


class Page:
    """A server with a feed, and a tab that looks at it."""

    def __init__(self, chromium, story, *, port=0, tab=None, allow=False, origins=()):
        clock = WallClock()
        self.feed = Rehearsal(story, clock)
        self.hub = Hub(View(FACTS, clock), self.feed, clock)
        self.control = Control(self.hub) if allow else None
        self._stack = contextlib.ExitStack()
        app = make_app(self.hub, self.control, origins=origins)
        self.port = self._stack.enter_context(served(app, port))
        self.url = f"http://127.0.0.1:{self.port}/"
        self.tab = tab or chromium.tab()

    def look(self, *screen, at_s=None, **more):
        if at_s is not None:
            self.feed.play(at_s)
        self.tab.look(*(screen or (1280, 800)), **more)
        self.tab.open(self.url)
        self.tab.until("window.antiphase && antiphase.drawn > 3")
        return self.tab

    def text(self, name):
        return self.tab.value(f"document.getElementById('{name}').textContent")

    def stop(self):
        self._stack.close()


@pytest.fixture
def page(chromium, story):
    opened = []

    def make(**more):
        opened.append(Page(chromium, story, **more))
        return opened[-1]

    yield make
    for one in opened:
        one.tab.close()
        one.stop()


COLOURS = """(() => {
  const seen = (canvas) => {
    const { width, height } = canvas;
    const data = new Uint32Array(canvas.getContext('2d').getImageData(0, 0, width, height).data.buffer);
    return new Set(data).size;
  };
  return [...document.querySelectorAll('.plot')].map((plot) => [plot.id, seen(plot.querySelector('canvas'))]);
})()"""
SPECTRUM = """(() => {
  const box = document.getElementById('spectrogram').querySelector('canvas'), s = antiphase.spectrogram;
  const ratio = devicePixelRatio, top = (s.bins - 1) * s.binHz, high = box.height / ratio;
  const y = (hz) => high - 24 - (hz / top) * (high - 30);
  const x = 56 + 0.93 * (box.width / ratio - 98);
  return [652, 900].map((hz) => [...box.getContext('2d').getImageData(x * ratio, y(hz) * ratio, 1, 1).data]);
})()"""


def test_what_is_sent_is_drawn_and_said_and_nobody_else_is_asked(page):
    shown = page()
    tab = shown.look(at_s=8.0)
    said = tab.until(
        "document.getElementById('word').textContent === 'CHATTER' && Object.fromEntries("
        "[...document.querySelectorAll('[id]')].map((e) => [e.id, e.textContent])"
        ".concat([['tone', document.body.dataset.tone]]))"
    )
    assert (said["tone"], said["detail"]) == ("alarm", "regenerative at 652.0 Hz")
    assert (said["frequency"], said["indicator"], said["shift"]) == ("652.0", "40.0", "2.50")
    assert "requested 2.76°, limits 0.0…4.5°" in said["shift-note"]
    phase = 2 * np.radians(2.5) * LINE_HZ / 20.0 / np.pi
    assert said["phase"] == f"{phase:.2f} π"
    assert 10.0 < float(said["marked"]) <= shown.hub.view.marked_mm + 0.05
    traces = tab.value("Object.fromEntries(Object.entries(antiphase.traces.values).map(([k, v]) => [k, v.at(-40)]))")
    peaks = {"x1_max_n": 100.0, "x1_min_n": 20.0, "y1p_max_n": 200.0, "y1p_min_n": 40.0}
    for name, value in {**peaks, "indicator_n": 40.0, "limit_n": 5.0, "shift_applied_deg": 2.5}.items():
        assert traces[name] == pytest.approx(value, rel=0.01), name
    painted = dict(tab.value(COLOURS))
    assert len(painted) == 5
    assert min(painted.values()) > 10, painted
    (line, quiet) = tab.value(SPECTRUM)
    assert sum(abs(a - b) for a, b in zip(line[:3], quiet[:3], strict=True)) > 150
    assert VILE in shown.text("events")
    assert tab.value("window.broken") is None
    hosts = {re.match(r"(?:https?|wss?)://([^/]+)/", address) for address in tab.requests if address[:5] != "data:"}
    assert {match and match[1] for match in hosts} == {f"127.0.0.1:{shown.port}"}
    assert any(address.startswith("ws://") for address in tab.requests)
    assert tab.complaints == []


def test_it_says_stale_and_recovers(page):
    shown = page()
    tab = shown.look(at_s=1.0)
    assert tab.until("['STABLE', 'CHATTER'].includes(document.getElementById('word').textContent)")
    shown.feed.hold()
    assert tab.until("document.getElementById('word').textContent === 'STALE'")
    assert tab.value("document.body.dataset.tone") == "stale"
    assert tab.until("document.getElementById('age').textContent.endsWith(' s')")
    shown.feed.play(4.0)
    assert tab.until("document.getElementById('word').textContent === 'CHATTER'")


def test_it_comes_back_by_itself_when_the_server_does(page, chromium, story):
    first = page()
    tab = first.look(at_s=1.0)
    first.stop()
    assert tab.until("document.getElementById('link').dataset.link === 'down'")
    assert tab.until("document.getElementById('word').textContent === 'STALE'")
    second = page(port=first.port, tab=tab)
    second.feed.play(6.0)
    assert tab.until("document.getElementById('word').textContent === 'CHATTER'")
    assert tab.until("document.getElementById('link').dataset.link === 'up'")
    assert tab.value("antiphase.links") == 2
    assert tab.value("antiphase.traces.values.x1_max_n.filter((v) => v !== null).length") > 500
    assert tab.value("document.querySelectorAll('#events li').length") == 1


def test_a_late_joiner_has_the_past_with_the_first_frame(page):
    shown = page()
    shown.feed.play(12.0)
    shown.look()
    late = page(port=0)  # another server: the second tab of the first one is what counts
    late.tab.look(1280, 800)
    late.tab.open(shown.url)
    late.tab.until("window.antiphase && antiphase.frames > 0")
    assert late.tab.value("antiphase.traces.values.indicator_n.filter((v) => v !== null).length") > 1000
    assert late.tab.value("antiphase.spectrogram.kept.size") > 200
    assert late.tab.value("antiphase.newest") == 1


@pytest.mark.parametrize("dark", [False, True])
def test_on_a_phone_nothing_is_wider_than_the_screen(page, dark):
    shown = page()
    tab = shown.look(390, 844, at_s=8.0, phone=True, dark=dark)
    assert tab.value("document.documentElement.scrollWidth") <= 390
    wide = "[...document.querySelectorAll('body *')].filter((e) => e.getBoundingClientRect().right > 390.5 && "
    assert tab.value(f"{wide} !e.closest('.u-wrap')).map((e) => e.id || e.className || e.tagName)") == []
    word = tab.value("document.getElementById('word').getBoundingClientRect().toJSON()")
    assert word["height"] > 48
    assert word["bottom"] < 844 / 2
    ground = tab.value("getComputedStyle(document.body).backgroundColor")
    light = sum(map(int, re.findall(r"\d+", ground)[:3])) / 3
    assert (light < 60) is dark
    assert min(count for _, count in tab.value(COLOURS)) > 10


@pytest.mark.parametrize("size", [(1920, 1080), (1280, 800), (820, 1180)])
def test_nothing_overlaps(page, size):
    shown = page()
    tab = shown.look(*size, at_s=8.0)
    boxes = tab.value(
        "[...document.querySelectorAll('.card, .tile, .state, header')].filter((e) => e.offsetParent)"
        ".map((e) => [e.className, e.getBoundingClientRect().toJSON()])"
    )
    assert len(boxes) == 1 + 1 + 6 + 8
    for k, (name, a) in enumerate(boxes):
        assert a["right"] <= size[0] + 0.5, name
        for other, b in boxes[:k]:
            apart = a["right"] <= b["left"] + 0.5 or b["right"] <= a["left"] + 0.5
            assert apart or a["bottom"] <= b["top"] + 0.5 or b["bottom"] <= a["top"] + 0.5, (name, other)
    cut = "[...document.querySelectorAll('#word, .tile b')].filter((e) => e.scrollWidth > e.clientWidth + 1 && "
    assert tab.value(cut + "getComputedStyle(e).display !== 'inline').length") == 0


def test_nonsense_is_counted_on_the_page(page):
    shown = page()
    tab = shown.look(at_s=1.0)
    shown.hub.view.sieve.refuse("unreadable", "force: rubbish")
    shown.hub.view.sieve.refuse("from the past", "chatter is 9 s old")
    assert tab.until("document.getElementById('refused').textContent.includes('1 unreadable, 1 from the past')")


def test_buttons_are_there_only_with_permission_and_token(page):
    without = page()
    assert without.look(at_s=1.0).value("document.getElementById('control').hidden") is True
    shown = page(allow=True)
    tab = shown.look(at_s=1.0)
    assert tab.value("document.getElementById('control').hidden") is False
    assert tab.value("document.querySelectorAll('button').length") == 0
    tab.open("about:blank")
    tab.open(f"{shown.url}#token={shown.control.token}")
    assert tab.until("document.querySelectorAll('button').length") == 4
    assert shown.control.token not in tab.value("location.href")
    tab.value("document.querySelector('button.arm').click()")
    assert shown.feed.asked == []
    tab.value("document.querySelector('button.arm').click()")
    assert tab.until("document.getElementById('control-said').textContent.startsWith('asked to arm')")
    tab.value("document.querySelector('button.stop').click()")
    assert tab.until("document.getElementById('control-said').textContent.startsWith('asked to stop')")
    assert sorted(message.request for message in shown.feed.asked) == ["arm", "stop"]


def test_the_subscriber_in_the_readme_works_as_printed(page, tmp_path):
    (code,) = re.findall(r"```html\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert code.count("\n") <= 32
    (tmp_path / "listen.html").write_text(code)
    shown = page(origins=("null",))
    shown.feed.play(8.0)
    shown.tab.open(f"file://{tmp_path}/listen.html?at=127.0.0.1:{shown.port}")
    assert shown.tab.until("document.getElementById('said')?.textContent.startsWith('CHATTER')")
    said = shown.tab.value("document.getElementById('said').textContent")
    assert said.startswith("CHATTER (regenerative at 652.0 Hz), indicator 40 of 5 N, force along X1 at most")
    assert 99.0 < float(re.findall(r"at most ([\d.]+) N", said)[0]) <= 100.0
    assert shown.tab.complaints == []

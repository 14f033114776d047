"""Take pictures of the page: `python -m services.dashboard.screenshot [DIR]` draws the one in the README, and more."""

from __future__ import annotations

import pathlib
import sys
import tempfile
from typing import NamedTuple

from services.clock import WallClock
from services.config import load_case
from services.dashboard.chromium import Chromium
from services.dashboard.facts import Facts
from services.dashboard.hub import Hub
from services.dashboard.rehearsal import Rehearsal, rehearse, served
from services.dashboard.server import make_app
from services.dashboard.view import View
from services.messages import Message

README = pathlib.Path(__file__).resolve().parents[1] / "figures" / "readme"
CASE, SEED, LONG_S, ARM_S = "thesis-652", 1, 20.0, 3.6
CHATTER_S, CALM_S = 3.0, 13.5


class Look(NamedTuple):
    """One picture: name, screen, and the moment of the run (s)."""

    name: str
    width: int
    height: int
    at_s: float
    dark: bool = False
    phone: bool = False
    stale: bool = False


LOOKS = (
    Look("dashboard", 1200, 780, CALM_S),
    Look("dark", 1280, 800, CALM_S, dark=True),
    Look("chatter", 1440, 900, CHATTER_S),
    Look("chatter-dark", 1440, 900, CHATTER_S, dark=True),
    Look("stale", 1440, 900, CALM_S, stale=True),
    Look("phone", 390, 844, CALM_S, phone=True),
    Look("phone-dark", 390, 844, CHATTER_S, dark=True, phone=True),
    Look("tablet", 820, 1180, CALM_S),
    Look("television", 1920, 1080, CALM_S, dark=True),
)


def take(looks: tuple[Look, ...], folder: pathlib.Path) -> list[pathlib.Path]:
    """Take pictures into a folder and return where they are."""
    case, clock = load_case(CASE), WallClock()
    heard = rehearse(case, SEED, LONG_S, ARM_S, clock)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile, Chromium(pathlib.Path(profile)) as browser:
        return [_picture(browser, look, heard, Facts.of(case), folder) for look in looks]


def _picture(
    browser: Chromium, look: Look, heard: list[list[Message]], facts: Facts, folder: pathlib.Path
) -> pathlib.Path:
    clock = WallClock()
    feed = Rehearsal(heard, clock)
    hub = Hub(View(facts, clock), feed, clock)
    tab = browser.tab()
    tab.look(look.width, look.height, dark=look.dark, phone=look.phone, scale=2.0 if look.phone else 1.0)
    with served(make_app(hub)) as port:
        tab.open(f"http://127.0.0.1:{port}/")
        tab.until("window.antiphase && antiphase.frames > 2")
        feed.play(look.at_s)
        tab.until("antiphase.last.state.age_ms !== null && antiphase.drawn > 6")
        if look.stale:
            feed.hold()
            tab.until("document.body.dataset.tone === 'stale'")
        path = folder / f"{look.name}.png"
        path.write_bytes(tab.picture(whole=look.phone))
        tab.close()
    return path


def main(arguments: list[str]) -> None:
    """Take the picture of the README, or all of them into a folder."""
    folder = pathlib.Path(arguments[0]) if arguments else README
    folder.mkdir(parents=True, exist_ok=True)
    for path in take(LOOKS if arguments else LOOKS[:1], folder):
        sys.stdout.write(f"wrote {path}, {path.stat().st_size / 1e3:.0f} kB\n")


if __name__ == "__main__":
    main(sys.argv[1:])

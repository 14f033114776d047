"""A headless Chromium, driven over its debugging port: what takes the pictures of the page, and what tests it."""

from __future__ import annotations

import base64
import json
import pathlib
import shutil
import subprocess
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any, Self

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from services.clock import WallClock
from services.errors import RefusalError

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-default-apps", "--disable-sync", "--disable-dev-shm-usage", "--mute-audio",
    "--hide-scrollbars", "--no-proxy-server", "--remote-debugging-port=0",
)  # fmt: skip
PATIENCE_S = 20.0
CLOCK = WallClock()


def find_chromium() -> str | None:
    """Return where a Chromium is, None if there is none."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def until(holds: Callable[[], Any], what: str, seconds: float = PATIENCE_S) -> Any:
    """Return the first true answer, or refuse to wait any longer."""
    end = CLOCK.now() + seconds
    while CLOCK.now() < end:
        if answer := holds():
            return answer
        CLOCK.sleep_until(CLOCK.now() + 0.02)
    raise RefusalError(f"{what} did not happen within {seconds:g} s")


class Tab:
    """One page of the browser.

    Attributes
    ----------
    requests
        Every address that it asked for.
    complaints
        What its console said of errors.
    """

    def __init__(self, address: str, open_tabs: list[Tab]) -> None:
        self._open = open_tabs
        self._open.append(self)
        self._stack = ExitStack()
        self._link = self._stack.enter_context(
            connect(address, max_size=64 << 20, max_queue=None, ping_interval=None, close_timeout=0.5, proxy=None)
        )
        self._number = 0
        self.requests: list[str] = []
        self.complaints: list[str] = []
        for domain in ("Network", "Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Return what the browser answers; what it says meanwhile is noted."""
        self._number += 1
        self._link.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            said = json.loads(self._link.recv(PATIENCE_S))
            if said.get("id") == self._number:
                if "error" in said:
                    raise RuntimeError(f"{method}: {said['error']['message']}")
                return said["result"]
            self._note(said.get("method"), said.get("params", {}))

    def _note(self, method: str | None, said: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent":
            self.requests.append(said["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.requests.append(said["url"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(said["exceptionDetails"])[:2000])
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.complaints.append(f"{said['entry']['text']} {said['entry'].get('url', '')}")

    def open(self, url: str) -> None:
        """Go to an address."""
        self.call("Page.navigate", url=url)

    def value(self, expression: str) -> Any:
        """Return what an expression is on the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {json.dumps(answer['exceptionDetails'])[:500]}")
        return answer["result"].get("value")

    def until(self, expression: str, seconds: float = PATIENCE_S) -> Any:
        """Return the first true value of an expression."""
        return until(lambda: self.value(expression), expression, seconds)

    def look(self, width: int, height: int, *, dark: bool = False, phone: bool = False, scale: float = 1.0) -> None:
        """Choose the screen."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=phone
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        still = {"name": "prefers-reduced-motion", "value": "reduce"}
        self.call("Emulation.setEmulatedMedia", features=[scheme, still])

    def picture(self, whole: bool = False) -> bytes:
        """Return the screen, or the whole page, as PNG."""
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        return base64.b64decode(shot["data"])

    def close(self) -> None:
        """Close the page; twice does no harm."""
        if self not in self._open:
            return
        self._open.remove(self)
        with suppress(ConnectionClosed, TimeoutError):
            self.call("Page.close")
        self._stack.close()


class Chromium:
    """A browser with an empty profile; leaves nothing behind.

    Parameters
    ----------
    folder
        For the profile; whoever made it removes it.
    """

    def __init__(self, folder: pathlib.Path) -> None:
        program = find_chromium()
        if program is None:
            raise RefusalError("no Chromium on this host (Debian: apt-get install chromium)")
        self._folder = folder
        self._process = subprocess.Popen(
            [program, *FLAGS, f"--user-data-dir={folder}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        self._tabs: list[Tab] = []
        try:
            self._port = until(self._said_port, "the debugging port of Chromium")
        except BaseException:
            self.close()
            raise

    def _said_port(self) -> str | None:
        path = self._folder / "DevToolsActivePort"
        lines = path.read_text().splitlines() if path.exists() else []
        return lines[0] if len(lines) > 1 else None

    def tab(self) -> Tab:
        """Return a new empty page."""
        request = urllib.request.Request(f"http://127.0.0.1:{self._port}/json/new?about:blank", method="PUT")
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(request, timeout=PATIENCE_S) as answer:
            return Tab(json.load(answer)["webSocketDebuggerUrl"], self._tabs)

    def close(self) -> None:
        """End the browser."""
        while self._tabs:
            self._tabs[0].close()
        self._process.terminate()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

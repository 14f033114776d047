"""Reads the frames of a dashboard as a browser would, and counts them."""

from __future__ import annotations

import threading
from typing import Any

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from services.dashboard.frame import decode_frame

LOOK_S = 0.5


class FrameReader:
    """Reads one dashboard in a thread of its own until closed.

    Parameters
    ----------
    url
        Of the page.

    Attributes
    ----------
    frames
        How many came so far.
    """

    def __init__(self, url: str) -> None:
        self.frames = 0
        self._url = url.rstrip("/").replace("http://", "ws://") + "/ws"
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._read, name="frames", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while not self._closing.is_set():
            try:
                with connect(self._url, max_size=None) as socket:
                    self._listen(socket)
            except (WebSocketException, OSError):
                self._closing.wait(LOOK_S)  # as a page does: it comes back

    def _listen(self, socket: Any) -> None:
        """Take frames, and say of each that it was read."""
        while not self._closing.is_set():
            try:
                data = socket.recv(LOOK_S)
            except TimeoutError:
                continue
            self.frames += 1
            socket.send(str(decode_frame(data).header["frame"]))

    def close(self) -> None:
        """Stop reading."""
        self._closing.set()
        self._thread.join(3.0)

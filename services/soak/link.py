"""A TCP link to a router that can be cut, clogged and mended, as a switch or a cable is on a bad day."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable

HOST = "127.0.0.1"
_CHUNK = 1 << 16


class Link:
    """Carries bytes between whoever connects to `endpoint` and a router on this computer.

    Parameters
    ----------
    endpoint
        Of the router, `tcp/127.0.0.1:PORT`.

    Attributes
    ----------
    endpoint
        Where the link begins.
    """

    def __init__(self, endpoint: str) -> None:
        self._port = int(endpoint.rsplit(":", 1)[1])
        self._server = socket.create_server((HOST, 0))
        self.endpoint = f"tcp/{HOST}:{self._server.getsockname()[1]}"
        self._open: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._free = threading.Event()
        self._free.set()
        self._refuse = False
        self._spawn(self._accept)

    def _spawn(self, work: Callable[..., None], *arguments: socket.socket) -> None:
        thread = threading.Thread(target=work, args=arguments, name="link", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near = self._server.accept()[0]
                far = None if self._refuse else self._far()
                if far is None:
                    near.close()
                    continue
                self._open += [near, far]
                self._spawn(self._carry, near, far)
                self._spawn(self._carry, far, near)

    def _far(self) -> socket.socket | None:
        try:
            return socket.create_connection((HOST, self._port))
        except OSError:
            return None  # the router is down; whoever connects tries again

    def _carry(self, source: socket.socket, sink: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(_CHUNK):
                self._free.wait()
                sink.sendall(data)
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def cut(self) -> None:
        """Break every connection, and let no new one through."""
        self._refuse = True
        for end in self._open:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def clog(self) -> None:
        """Carry nothing on, and break nothing."""
        self._refuse = True
        self._free.clear()

    def mend(self) -> None:
        """Carry on."""
        self._refuse = False
        self._free.set()

    def close(self) -> None:
        """Break everything for good."""
        self.cut()
        self.mend()
        self._refuse = True
        with contextlib.suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        for thread in self._threads:
            thread.join(5.0)
        for end in self._open:
            end.close()

"""The thin server: pages, frames over WebSocket, state and metrics. It answers nobody but this host."""

from __future__ import annotations

import asyncio
import ipaddress
import pathlib
import socket
from collections.abc import AsyncGenerator, Sequence
from contextlib import asynccontextmanager, suppress
from urllib.parse import urlsplit

import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from services.dashboard.control import Control
from services.dashboard.exposition import Exposition
from services.dashboard.hub import FRAMES_PER_S, MOST_BROWSERS, PATIENCE_S, Browser, Hub
from services.errors import InputError, RefusalError

STATIC = pathlib.Path(__file__).resolve().parent / "static"
NAMES = ("localhost", "127.0.0.1", "::1")
HEADERS = (
    (b"content-security-policy", b"default-src 'self'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"cache-control", b"no-cache"),
)
REFUSED, BUSY = 1008, 1013


def check_host(host: str) -> str:
    """Return an address of this host, or say why no other is served."""
    name = "127.0.0.1" if host == "localhost" else host.strip("[]")
    try:
        if ipaddress.ip_address(name).is_loopback:
            return name
    except ValueError:
        pass
    raise InputError(
        "host", host, "an address of this host, such as 127.0.0.1: without TLS nobody else is served "
        "(from elsewhere: ssh -L 8080:127.0.0.1:8080 HOST)",
    )  # fmt: skip


def open_socket(host: str, port: int) -> socket.socket:
    """Return a socket that listens; port 0 takes a free one."""
    if not 0 <= port <= 65535:
        raise InputError("port", port, "in 0..65535")
    address = check_host(host)
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    try:
        return socket.create_server((address, port), family=family)
    except OSError as error:
        raise InputError("port", port, f"a free port of {address} ({error.strerror})") from error


class _Doors:
    """Lets in who names this host, so that no other page can look through a browser; adds the headers."""

    def __init__(self, app: ASGIApp, host: str, origins: Sequence[str]) -> None:
        self._app, self._hosts, self._origins = app, (*NAMES, host), origins

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        origin = headers.get(b"origin", b"").decode("latin-1")
        with suppress(ValueError):
            named = urlsplit("//" + headers.get(b"host", b"").decode("latin-1"))
            if named.hostname in self._hosts and (not origin or self._ours(origin, named.netloc)):
                await self._app(scope, receive, _with_headers(send))
                return
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": REFUSED})
        else:
            await PlainTextResponse("not for this name or origin", 403)(scope, receive, send)

    def _ours(self, origin: str, host: str) -> bool:
        return origin in self._origins or urlsplit(origin).netloc == host


def _with_headers(send: Send) -> Send:
    async def sender(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message["headers"], *HEADERS]
        await send(message)

    return sender


class _Json(Response):
    media_type = "application/json"

    def render(self, content: object) -> bytes:
        return msgspec.json.encode(content)


def make_app(hub: Hub, control: Control | None = None, host: str = "localhost", origins: Sequence[str] = ()) -> ASGIApp:
    """Return the application.

    Parameters
    ----------
    hub
        The picture.
    control
        Hands on requests; without it there is no route for them.
    host
        Another name under which this host may be called.
    origins
        Of other pages that may read the frames; `null` is that of a file.
    """
    exposition = Exposition(hub)

    async def page(_: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def state(_: Request) -> Response:
        return _Json(hub.state())

    async def metrics(_: Request) -> Response:
        return Response(exposition.text(), media_type="text/plain; version=0.0.4; charset=utf-8")

    async def frames(websocket: WebSocket) -> None:
        await _serve(hub, websocket)

    routes: list[BaseRoute] = [
        Route("/", page), Route("/api/state", state), Route("/metrics", metrics), WebSocketRoute("/ws", frames),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]  # fmt: skip
    if control is not None:
        routes.append(Route("/api/request", _asking(control), methods=["POST"]))
    return _Doors(Starlette(routes=routes, lifespan=_ticking(hub)), host, origins)


def _asking(control: Control):  # noqa: ANN202
    async def ask(request: Request) -> Response:
        if not control.admits(request.headers.get("authorization", "")):
            return _Json({"error": "the token is missing or wrong"}, 401)
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > 1000:
                return _Json({"error": "too long"}, 413)
        try:
            wanted = msgspec.json.decode(body)
            return _Json(control.ask(wanted.get("request") if isinstance(wanted, dict) else None))
        except (msgspec.DecodeError, InputError) as error:
            return _Json({"error": str(error)}, 400)
        except RefusalError as error:
            return _Json({"error": str(error)}, 409)

    return ask


def _ticking(hub: Hub):  # noqa: ANN202
    async def tick() -> None:
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            try:
                hub.tick()
            except Exception as error:  # the bus itself failed: the page goes on, and says so
                hub.view.sieve.refuse("unexpected", f"{type(error).__name__}: {error}")
            due = max(due + 1.0 / FRAMES_PER_S, loop.time())
            await asyncio.sleep(due - loop.time())

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncGenerator[None]:
        task = asyncio.create_task(tick())
        try:
            yield
        finally:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task

    return lifespan


async def _serve(hub: Hub, websocket: WebSocket) -> None:
    """Send frames to one browser as long as it reads them."""
    await websocket.accept()
    if len(hub.browsers) >= MOST_BROWSERS:
        await websocket.close(BUSY)
        return
    browser = Browser(hub.clock)
    hub.browsers.add(browser)
    reader = asyncio.create_task(_read(websocket, browser))
    try:
        browser.due.set()
        while not browser.gone:
            await browser.due.wait()
            browser.due.clear()
            if browser.hopeless():
                hub.dropped += 1
                break
            if not browser.gone and browser.ready():
                async with asyncio.timeout(PATIENCE_S):
                    await websocket.send_bytes(hub.frame(browser))
    except TimeoutError:
        hub.dropped += 1
    except (WebSocketDisconnect, RuntimeError):
        pass
    finally:
        hub.browsers.discard(browser)
        reader.cancel()
        with suppress(asyncio.CancelledError):
            await reader
        if not browser.gone and websocket.application_state is WebSocketState.CONNECTED:
            with suppress(RuntimeError, WebSocketDisconnect, TimeoutError):
                async with asyncio.timeout(1.0):
                    await websocket.close(BUSY)


async def _read(websocket: WebSocket, browser: Browser) -> None:
    """Take in what a browser says until it goes."""
    while not browser.gone:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            browser.gone = True
            browser.due.set()
        else:
            browser.heard(message.get("text") or "")


def configured(app: ASGIApp) -> uvicorn.Config:
    """Return how to serve: without compression, without log, and with patience for a few seconds only."""
    return uvicorn.Config(
        app,
        log_level="error",
        access_log=False,
        ws="websockets-sansio",
        ws_max_size=4096,
        ws_per_message_deflate=False,
        ws_ping_interval=PATIENCE_S,
        ws_ping_timeout=PATIENCE_S,
        timeout_graceful_shutdown=1,
        server_header=False,
    )


def serve(app: ASGIApp, listening: socket.socket) -> None:
    """Serve until SIGINT or SIGTERM."""
    uvicorn.Server(configured(app)).run(sockets=[listening])

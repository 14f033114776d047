"""Page and terminal on a real bus: they follow what is published, and a browser that sleeps holds nobody up."""

import json
import os
import pty
import re
import select
import signal
import socket
import subprocess
import threading
import urllib.request

import numpy as np
import pytest
from websockets.sync.client import connect

from services.dashboard.frame import decode_frame
from services.messages import ChatterReport, Event, ForceBlock, MachineState, OperatorRequest
from services.process import command_line
from services.wire import encode
from services.zenoh_bus import ZenohBus
from tests.services.dashboard_kit import block, chatter, event, force
from tests.system.kit import free_endpoint, processes, until

pytestmark = pytest.mark.system
CASE = "thesis-652"
NO_PROXY = urllib.request.build_opener(urllib.request.ProxyHandler({}))


@pytest.fixture
def bus():
    with ZenohBus.router("lathe-1", "tcp/127.0.0.1:0") as bus:
        bus.offer(MachineState, ForceBlock, ChatterReport, Event)
        yield bus


class Speaker:
    """Publishes block after block, as often as it is asked to."""

    def __init__(self, bus):
        self.bus, self.number = bus, 0

    def say(self):
        for message in block(self.number):
            self.bus.publish(message)
        self.number += 1
        return True


def get(url, path):
    with NO_PROXY.open(url + path, timeout=10.0) as answer:
        return answer.read()


def state_of(url):
    return json.loads(get(url, "api/state"))


def sleeper_at(url):
    """Open a WebSocket that will never be read."""
    port = int(url.rsplit(":", 1)[1].strip("/"))
    sleeper = socket.socket()
    sleeper.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    sleeper.connect(("127.0.0.1", port))
    sleeper.sendall(
        f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    return sleeper


def test_the_page_is_there_before_the_bus_follows_it_and_drops_who_does_not_read(tmp_path):
    endpoint = free_endpoint()
    with processes(tmp_path) as start:
        page = start("dashboard", CASE, "--connect", endpoint, "--port", "0", "--json", "--allow-control")
        assert until(lambda: "url" in page.said())
        url = page.said()["url"]
        assert until(lambda: b"NO DATA" in get(url, "api/state"))
        with sleeper_at(url), ZenohBus.router("lathe-1", endpoint) as bus:
            inbox, speaker = bus.subscribe(OperatorRequest), Speaker(bus)
            bus.publish(event(1, text="before anybody looked"))
            bus.announce("monitor")
            assert until(lambda: speaker.say() and state_of(url)["word"] == "STABLE")
            assert until(lambda: any(s["name"] == "monitor" and s["alive"] for s in state_of(url)["services"]))
            assert b'antiphase_service_alive{machine="lathe-1",service="monitor"} 1.0' in get(url, "metrics")
            speak_nonsense(bus, endpoint)
            assert until(lambda: state_of(url)["refused"].get("unreadable", 0) >= 4)
            assert until(lambda: speaker.say() and state_of(url)["word"] == "STABLE")
            ask(url, page.said()["control"].split("#token=")[1], "disarm")
            heard = []
            assert until(lambda: heard.extend(inbox.take()) or heard, 5.0)
            assert heard[0].message().request == "disarm"
            with connect(url.replace("http", "ws") + "ws", proxy=None) as browser:
                header = decode_frame(browser.recv(10.0)).header
                assert "before anybody looked" in [line["text"] for line in header["events"]]
            assert until(lambda: speaker.say() and state_of(url)["browsers_dropped"] == 1, 20.0)
            assert state_of(url)["browsers"] == 0
            assert until(lambda: speaker.say() and state_of(url)["word"] == "STABLE")
            assert until(lambda: state_of(url)["word"] == "STALE")
        assert page.stop(signal.SIGTERM) == 0, page.told()
    assert page.told() == ""


def speak_nonsense(bus, endpoint):
    """Everything that must not be believed: truncated, another version, huge, NaN, of another machine."""
    bus.publish_payload(ChatterReport, b'{"version": 9, "state": "chatter"}')
    bus.publish_payload(MachineState, encode(block(1)[0])[:-9])
    bus.publish_payload(ForceBlock, b"\xff" * 1000)
    bus.publish_payload(ChatterReport, b'"' + b"x" * (1 << 19) + b'"')
    bus.publish(force(10**6, np.full(90, np.nan)))
    with ZenohBus.client("lathe-2", endpoint) as other:
        other.publish(block(9, verdict=chatter)[2])


def ask(url, token, request):
    body, headers = json.dumps({"request": request}).encode(), {"Authorization": f"Bearer {token}"}
    with NO_PROXY.open(urllib.request.Request(url + "api/request", body, headers), timeout=10.0) as answer:
        assert json.loads(answer.read())["request"] == request


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (("dashboard", "--host", "0.0.0.0"), "host"),
        (("dashboard", "--port", "70000"), "port"),
        (("dashboard", "--connect", "nowhere"), "connect"),
        (("dashboard", "--machine", "a/b"), "machine"),
        (("dashboard", "--allow-origin", "*"), "allow-origin"),
        (("watch", "--wait-s", "0", "--once"), "wait-s"),
        (("watch",), "json"),
    ],
)
def test_wrong_use_names_the_field(arguments, field, capsys):
    from services.cli.app import main

    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--json"])
    assert ended.value.code == 2
    assert json.loads(capsys.readouterr().out)["error"]["field"] == field


def test_watch_once_is_one_object_or_an_honest_refusal(bus, capsys):
    from services.cli.app import main

    line = ["watch", CASE, "--once", "--json", "--connect", bus.endpoint, "--wait-s"]
    with pytest.raises(SystemExit) as ended:
        main([*line, "0.1"])
    assert ended.value.code == 3
    said = json.loads(capsys.readouterr().out)
    assert "nothing heard" in said["reason"]
    assert said["word"] == "NO DATA"
    speaker, done = Speaker(bus), threading.Event()
    talker = threading.Thread(target=lambda: until(lambda: speaker.say() and done.is_set()))
    talker.start()
    try:
        with pytest.raises(SystemExit) as ended:
            main([*line, "30"])
    finally:
        done.set()
        talker.join()
    assert ended.value.code == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["word"], said["stale"], said["linked"]) == ("STABLE", False, True)


def test_watch_leaves_the_terminal_as_it_was(bus):
    speaker = Speaker(bus)
    near, far = pty.openpty()
    line = command_line("watch", CASE, "--connect", bus.endpoint)
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"}
    watch = subprocess.Popen(line, stdin=far, stdout=far, stderr=subprocess.DEVNULL, env=environment)
    said = b""
    try:

        def shown(words):
            nonlocal said
            speaker.say()
            while select.select([near], [], [], 0.0)[0]:
                said += os.read(near, 65536)
            return words in said

        assert until(lambda: shown(b"S T A B L E")), said
        watch.send_signal(signal.SIGINT)
        assert until(lambda: shown(b"\x1b[?1049l") and watch.poll() is not None), said[-500:]
    finally:
        watch.kill()
        watch.wait()
        os.close(near)
        os.close(far)
    assert watch.returncode == 0
    assert said.count(b"\x1b[?1049h") == said.count(b"\x1b[?1049l") == 1
    assert said.rfind(b"\x1b[?25h") > said.rfind(b"\x1b[?25l") >= 0
    assert re.search(rb"Traceback", said) is None

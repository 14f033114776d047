"""Pages, frames, state, metrics and requests of the server, without a network."""

import json
import pathlib
import re

import pytest
from prometheus_client.parser import text_string_to_metric_families
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from services.dashboard.control import REQUESTS, Control
from services.dashboard.frame import Seen, decode_frame
from services.dashboard.hub import IN_FLIGHT, PATIENCE_S, Browser
from services.dashboard.server import STATIC, check_host, make_app, open_socket
from services.errors import InputError
from services.messages import OperatorRequest
from tests.services.dashboard_kit import HandClock, block, chatter, event, make_hub

HERE = "http://127.0.0.1:8080"
FRAMES = "ws://127.0.0.1:8080/ws"


def client_of(hub, control=None, **more):
    return TestClient(make_app(hub, control, **more), base_url=HERE)


def fill(hub, feed, blocks, **more):
    for number in blocks:
        hub.clock.time += 0.01
        feed.say(*block(number, **more))
        hub.tick()


def test_the_page_and_its_files_are_served_and_ask_nobody_else():
    hub, _, _ = make_hub()
    with client_of(hub) as client:
        page = client.get("/")
        assert page.headers["content-security-policy"].startswith("default-src 'self'")
        wanted = re.findall(r'(?:src|href)="(/[^"]+)"', page.text)
        assert len(wanted) == 4
        for path in (*wanted, "/static/uPlot-LICENSE.txt"):
            assert client.get(path).status_code == 200, path
        assert client.get("/static/../server.py").status_code == 404
        assert client.get("/nothing").status_code == 404
    for path in STATIC.iterdir():
        hosts = set(re.findall(r"(?:https?|wss?)://([\w.-]+)", path.read_text()))
        assert hosts <= {"www.w3.org", "github.com"}, path  # a namespace, and the address in uPlot's banner


def test_uplot_is_shipped_with_its_licence():
    banner = (STATIC / "uPlot.iife.min.js").read_text()[:200]
    assert "uPlot (v1.6.32)" in banner
    assert "MIT License" in (STATIC / "uPlot-LICENSE.txt").read_text()


def test_state_and_metrics_say_what_was_sent():
    hub, feed, _ = make_hub()
    with client_of(hub) as client:
        assert client.get("/api/state").json()["word"] == "NO DATA"
        assert "antiphase_limit_newtons" not in client.get("/metrics").text
        fill(hub, feed, range(50), verdict=chatter)
        feed.peers = [("monitor", True), ("machine", True)]
        feed.waiting.append(feed_nonsense())
        hub.tick()
        state = client.get("/api/state").json()
        assert (state["word"], state["frequency_hz"], state["indicator_n"]) == ("CHATTER", 652.0, 40.0)
        assert state["refused"] == {"unreadable": 1}
        text = client.get("/metrics").text
    found = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            labels = {k: v for k, v in sample.labels.items() if k != "machine"}
            found[(sample.name, *labels.values())] = sample.value
    assert found[("antiphase_indicator_newtons",)] == 40.0
    assert found[("antiphase_frequency_hertz",)] == 652.0
    assert found[("antiphase_marked_millimetres",)] == pytest.approx(1.5)
    assert found[("antiphase_state", "CHATTER")] == 1.0
    assert found[("antiphase_service_alive", "monitor")] == 1.0
    assert found[("antiphase_service_alive", "controller")] == 0.0
    assert found[("antiphase_messages_total", "chatter")] == 50.0
    assert found[("antiphase_messages_refused_total", "unreadable")] == 1.0
    assert found[("antiphase_commands_accepted_total",)] == 49.0
    assert ("process_cpu_seconds_total",) in found


def feed_nonsense():
    from services.bus import Received

    return Received("force", b"\xff\xff", "")


def test_a_late_joiner_sees_the_present_state_and_the_past_at_once():
    hub, feed, _ = make_hub()
    with client_of(hub) as client:
        fill(hub, feed, range(80))
        feed.say(event(5, text="tools in the cut"))
        hub.tick()
        with client.websocket_connect(FRAMES) as socket:
            header, columns, _ = decode_frame(socket.receive_bytes())
            assert header["state"]["word"] == "STABLE"
            assert header["state"]["browsers"] == 1
            assert columns["indicator_n"].size == 80
            assert header["events"][0]["text"] == "tools in the cut"
            socket.send_text(str(header["frame"]))
            second = decode_frame(socket.receive_bytes()).header
            assert second["frame"] > header["frame"]


def test_what_a_browser_says_is_only_the_number_of_a_frame():
    browser = Browser(HandClock())
    for number in (7, 9, 12):
        browser.told(number, Seen())
    for nonsense in ("", "x", "-1", "1e9", "٣", "99999999999999999999", "13", "\x00", "9" * 4000):
        browser.heard(nonsense)
    browser.told(13, Seen())
    assert not browser.ready()
    browser.heard("9")
    assert browser.ready()
    browser.heard("13")
    assert browser.ready()


def test_a_browser_that_reads_nothing_gets_nothing_more_and_is_given_up():
    clock = HandClock()
    browser = Browser(clock)
    sent = 0
    for number in range(1, 200):
        clock.time += 0.05
        if browser.ready():
            browser.told(number, Seen())
            sent += 1
    assert sent == IN_FLIGHT
    assert browser.hopeless()
    browser.heard("2")
    assert not browser.hopeless()
    assert browser.ready()


def test_a_silent_browser_is_dropped_while_another_goes_on():
    hub, _, _ = make_hub()
    with client_of(hub) as client, client.websocket_connect(FRAMES) as good, client.websocket_connect(FRAMES) as silent:

        def state():
            header = decode_frame(good.receive_bytes()).header
            good.send_text(str(header["frame"]))
            return header["state"]

        while not any(browser.waits() for browser in hub.browsers):
            state()
        hub.clock.time += PATIENCE_S + 0.1
        while state()["browsers"] != 1:
            pass
        for _ in range(IN_FLIGHT):
            silent.receive_bytes()
        with pytest.raises(WebSocketDisconnect):
            silent.receive_bytes()
        assert state()["browsers_dropped"] == 1


def test_browsers_are_counted_and_bounded(monkeypatch):
    monkeypatch.setattr("services.dashboard.server.MOST_BROWSERS", 1)
    hub, _, _ = make_hub()
    with client_of(hub) as client, client.websocket_connect(FRAMES) as first:
        first.receive_bytes()
        with client.websocket_connect(FRAMES) as second, pytest.raises(WebSocketDisconnect):
            second.receive_bytes()


def test_whatever_goes_wrong_with_a_message_the_page_goes_on(monkeypatch):
    hub, feed, _ = make_hub()
    monkeypatch.setattr(hub.view, "handle", lambda _: 1 / 0)
    feed.say(*block(0))
    hub.tick()
    assert hub.state()["refused"] == {"unexpected": 3}
    assert "ZeroDivisionError" in hub.state()["last_refused"]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"host": "localhost:8080"}, 200),
        ({"host": "[::1]:8080"}, 200),
        ({"host": "shop.example"}, 403),
        ({"host": ""}, 403),
        ({"host": "[::"}, 403),
        ({"origin": "http://127.0.0.1:8080"}, 200),
        ({"origin": "http://127.0.0.1:8081"}, 403),
        ({"origin": "https://shop.example"}, 403),
        ({"origin": "null"}, 403),
        ({"origin": "http://[::"}, 403),
    ],
)
def test_only_this_host_and_its_own_page_are_let_in(headers, status):
    hub, _, _ = make_hub()
    with client_of(hub) as client:
        assert client.get("/api/state", headers=headers).status_code == status
        if status == 200:
            with client.websocket_connect(FRAMES, headers=headers) as socket:
                socket.receive_bytes()
        else:
            with pytest.raises(WebSocketDisconnect), client.websocket_connect(FRAMES, headers=headers):
                pass


def test_another_page_may_be_allowed():
    hub, _, _ = make_hub()
    with client_of(hub, origins=("null",)) as client:
        with client.websocket_connect(FRAMES, headers={"origin": "null"}) as socket:
            socket.receive_bytes()
        assert client.get("/", headers={"origin": "https://shop.example"}).status_code == 403


def test_without_permission_there_is_no_route_to_the_machine():
    hub, feed, _ = make_hub()
    fill(hub, feed, range(3))
    with client_of(hub) as client:
        for method in ("GET", "POST", "PUT", "DELETE"):
            assert client.request(method, "/api/request", json={"request": "arm"}).status_code == 404
        assert client.get("/api/state").json()["controls"] == []
        for path in ("/", "/api/state", "/metrics", "/static/main.js"):
            assert client.post(path, json={"request": "arm"}).status_code == 405
        with client.websocket_connect(FRAMES) as socket:
            socket.send_text(json.dumps({"request": "arm"}))
            socket.send_bytes(b"arm")
            socket.receive_bytes()
    assert feed.published == []


def test_with_permission_and_token_a_request_goes_to_the_guard_once():
    hub, feed, _ = make_hub()
    control = Control(hub)
    with client_of(hub, control) as client:
        allowed = {"authorization": f"Bearer {control.token}"}
        assert client.post("/api/request", json={"request": "arm"}, headers=allowed).status_code == 409
        fill(hub, feed, range(3))
        assert client.get("/api/state").json()["controls"] == list(REQUESTS)
        for headers in ({}, {"authorization": "Bearer "}, {"authorization": "Bearer ü".encode("latin-1")},
                        {"authorization": control.token}, allowed | {"origin": "https://shop.example"}):  # fmt: skip
            answer = client.post("/api/request", json={"request": "arm"}, headers=headers)
            assert answer.status_code in (401, 403)
        for body in (b"", b"[]", b"{", b'{"request": "explode"}', b'{"request": ["arm"]}', b'"arm"', b"\xff"):
            assert client.post("/api/request", content=body, headers=allowed).status_code == 400
        assert client.post("/api/request", content=b"x" * 5000, headers=allowed).status_code == 413
        assert client.get("/api/request", headers=allowed).status_code == 405
        assert feed.published == []
        for request in REQUESTS:
            answer = client.post("/api/request", json={"request": request}, headers=allowed)
            assert answer.status_code == 200
            assert answer.json()["request"] == request
    assert [type(message) for message in feed.published] == [OperatorRequest] * len(REQUESTS)
    assert [message.request for message in feed.published] == list(REQUESTS)
    assert len({message.nonce for message in feed.published}) == len(REQUESTS)
    assert {(message.run, message.source) for message in feed.published} == {("r1", "operator")}


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "lathe.example", "", "127.0.0.1:80"])
def test_no_other_interface_is_served(host):
    with pytest.raises(InputError, match="without TLS nobody else is served") as refused:
        check_host(host)
    assert refused.value.field == "host"


def test_this_host_has_several_names():
    names = {"localhost": "127.0.0.1", "127.0.0.7": "127.0.0.7", "[::1]": "::1"}
    assert {name: check_host(name) for name in names} == names


def test_a_port_that_is_taken_or_none_is_named():
    with open_socket("127.0.0.1", 0) as taken, pytest.raises(InputError, match="a free port") as refused:
        open_socket("127.0.0.1", taken.getsockname()[1])
    assert refused.value.field == "port"
    with pytest.raises(InputError, match="port must be in 0..65535"):
        open_socket("127.0.0.1", 99999)


def test_the_static_files_are_in_the_package():
    text = (pathlib.Path(__file__).parents[2] / "pyproject.toml").read_text()
    assert '"services.dashboard" = ["static/*"]' in text

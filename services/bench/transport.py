"""How long messages take on the bus, beside bare Zenoh and a bare TCP socket in the same run.

Blocks: one process publishes the same block in four ways in turn, 100 times a second each; a process for each way
receives. On our bus it goes once as bytes, like on bare Zenoh and on the socket, and once from message to message: then
encoding and decoding count, some 5 us each in a tight loop and ten times that in a process that has just been woken.
Loop: the three services work at a case in real time, and beside them three processes hand bytes of the same sizes
round on bare Zenoh at the same pace.
"""

from __future__ import annotations

import contextlib
import json
import math
import socket
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from services.children import Child, end_all, private_folder
from services.clock import WallClock
from services.config import load_case
from services.demo import run_demo
from services.messages import BLOCK_S, ChatterReport, ReportedLine, SampleBlock, TurretCommand
from services.process import python_line
from services.wire import encode
from services.zenoh_bus import ZenohBus, fifo, open_client

CLOCK = WallClock()
MACHINE = "bench"
WARM = 20
"""Messages at the start that do not count."""
START_S = 30.0
WAYS = ("bytes", "message", "zenoh", "socket")
Row = dict[str, Any]


def measure(*, blocks: int = 500, loop_s: float = 6.0, case: str = "quiet") -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    blocks
        How many blocks go each way.
    loop_s
        How long the loop works (s).
    case
        What it works at.
    """
    return [*block_rows(blocks), *loop_rows(case, loop_s)]


def _row(what: str, ours: float, peer: float) -> Row:
    return {"case": what, "ours": ours, "peer": peer, "ratio": ours / peer if peer else math.nan, "unit": "ms"}


def _rows(what: str, peer_name: str, ours: np.ndarray, peer: np.ndarray) -> list[Row]:
    return [
        _row(f"{what}, p{p} beside {peer_name}", float(np.percentile(ours, p)), float(np.percentile(peer, p)))
        for p in (50, 99)
    ]


def sample_block(number: int) -> SampleBlock:
    """Return a block of the usual size: 90 samples of 8 signals that do not compress."""
    rng = np.random.default_rng(number)
    names = ("x1_thrust_n", "x1_motor_position_m", "x1_stage_position_m", "y1_thrust_n", "y1_motor_position_m",
             "y1_stage_position_m", "dx1_um", "dy1p_um")  # fmt: skip
    signals: dict[str, Any] = {name: rng.standard_normal(90) for name in names}
    return SampleBlock(
        run="bench", source="bench", sequence=number, first_sample=90 * number, sample_rate_hz=9000.0,
        shift_requested_deg=0.0, shift_applied_deg=0.0, moving=False, in_cut=True, spindle_speed_rpm=1200.0,
        diameter_mm=25.0,
        guard_state="OFF", session="", **signals,
    )  # fmt: skip


def block_rows(blocks: int) -> list[Row]:
    """Return the rows of blocks from publishing to the handler."""
    total = WARM + blocks
    with private_folder() as folder, ZenohBus.router(MACHINE, "tcp/127.0.0.1:0") as hub:
        children = {way: _child(way, folder, hub.endpoint, str(total)) for way in WAYS}
        sending: Child | None = None
        try:
            _await(lambda: all("ready" in child.said() for child in children.values()), children)
            port = str(children["socket"].said()["ready"])
            sending = _child("send", folder, hub.endpoint, str(total), port)
            everyone = children | {"send": sending}
            _await(lambda: all("times" in child.said() for child in everyone.values()), everyone)
            times = {way: np.array(child.said()["times"]) for way, child in children.items()}
            sent = {way: np.array(sending.said()["times"][way]) for way in WAYS}
        finally:
            end_all([*children.values(), *([sending] if sending else [])])
    took = {way: 1e3 * (times[way] - sent[way])[WARM:] for way in WAYS}
    what = f"block of {len(encode(sample_block(0)))} bytes at 100 Hz, publish to handler"
    return [
        *_rows(what, "bare zenoh", took["bytes"], took["zenoh"]),
        *_rows(what, "a bare socket", took["bytes"], took["socket"]),
        *_rows(f"{what}, encoded and decoded", "the bytes on bare zenoh", took["message"], took["zenoh"]),
    ]


def loop_rows(case: str, loop_s: float) -> list[Row]:
    """Return the rows of the loop machine, monitor, controller, machine."""
    configured = load_case(case)
    with private_folder() as folder, ZenohBus.router(MACHINE, "tcp/127.0.0.1:0") as hub:
        names = ("monitor", "controller", "machine")
        children = {name: _child(f"bare-{name}", folder, hub.endpoint) for name in names}
        try:
            _await(lambda: "ready" in children["machine"].said(), children)
            seen = run_demo(
                case, configured, configured.settings.seed, clock=CLOCK, say=_silent,
                lasts=("--duration-s", str(loop_s)),
            )  # fmt: skip
            children["machine"].go()
            _await(lambda: "times" in children["machine"].said(), children)
            bare = np.array(children["machine"].said()["times"])
        finally:
            end_all(children.values())
    what = "loop of three processes at 100 Hz"
    return _rows(what, "bare zenoh", np.array(seen.tape.latency_ms[WARM:]), bare[-len(seen.tape.latency_ms) :])


def _silent(_: str) -> None:
    pass


def _child(role: str, folder: Any, *arguments: str) -> Child:
    code = "from services.bench.transport import act; act(*sys.argv[1:])"
    return Child(role, python_line(code, role, *arguments), folder, quiet=True)


def _await(holds: Callable[[], bool], children: dict[str, Child]) -> None:
    until = CLOCK.now() + START_S + BLOCK_S * 10_000
    while not holds():
        for name, child in children.items():
            if child.ended() not in (None, 0):
                raise RuntimeError(f"{name} of the benchmark failed: {child.why()}")
        if CLOCK.now() > until:
            raise RuntimeError("the benchmark does not come to an end")
        CLOCK.sleep_until(CLOCK.now() + 0.05)


def act(role: str, endpoint: str, *more: str) -> None:
    """Be one of the processes of the benchmark."""
    if role == "send":
        _send(endpoint, int(more[0]), int(more[1]))
    elif role == "socket":
        _receive_socket(int(more[0]))
    elif role in ("bytes", "message"):
        _receive_ours(endpoint, role, int(more[0]))
    elif role == "zenoh":
        _receive_zenoh(endpoint, int(more[0]))
    elif role == "bare-machine":
        _ping(endpoint)
    else:
        here, there, size = ("a", "b", _sizes()[1]) if role == "bare-monitor" else ("b", "c", _sizes()[2])
        _relay(endpoint, here, there, size)


def _say(**what: Any) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def _receive_ours(endpoint: str, way: str, total: int) -> None:
    with ZenohBus.client(f"{MACHINE}-{way}", endpoint) as bus:
        inbox = bus.subscribe(SampleBlock)
        bus.announce("receiver")
        _say(ready=True)
        times: list[float] = []
        for _ in range(total):
            received = inbox.wait()
            if way == "message":
                received.message()
            times.append(CLOCK.now())
        _say(times=times)


def _receive_zenoh(endpoint: str, total: int) -> None:
    with open_client(endpoint) as session:
        subscriber = session.declare_subscriber("bench/block", fifo(4096))
        _say(ready=True)
        times: list[float] = []
        for _ in range(total):
            subscriber.recv().payload.to_bytes()
            times.append(CLOCK.now())
        subscriber.undeclare()
        _say(times=times)


def _receive_socket(total: int) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        _say(ready=server.getsockname()[1])
        link = server.accept()[0]
        with link, link.makefile("rb") as stream:
            times: list[float] = []
            for _ in range(total):
                stream.read(int.from_bytes(stream.read(4), "little"))
                times.append(CLOCK.now())
            _say(times=times)


def _send(endpoint: str, total: int, port: int) -> None:
    sent: dict[str, list[float]] = {way: [] for way in WAYS}
    with (
        ZenohBus.client(f"{MACHINE}-bytes", endpoint) as bus,
        ZenohBus.client(f"{MACHINE}-message", endpoint) as other,
        open_client(endpoint) as session,
        socket.create_connection(("127.0.0.1", port)) as link,
    ):
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        bus.offer(SampleBlock)
        other.offer(SampleBlock)
        publisher = session.declare_publisher("bench/block")
        CLOCK.sleep_until(CLOCK.now() + 0.3)
        begin = CLOCK.now()
        ways: dict[str, Callable[[SampleBlock, bytes], Any]] = {
            "bytes": lambda _, payload: bus.publish_payload(SampleBlock, payload),
            "message": lambda block, _: other.publish(block),
            "zenoh": lambda _, payload: publisher.put(payload),
            "socket": lambda _, payload: link.sendall(len(payload).to_bytes(4, "little") + payload),
        }
        for turn in range(total * len(WAYS)):
            number, way = turn // len(WAYS), WAYS[(turn + turn // len(WAYS)) % len(WAYS)]
            CLOCK.sleep_until(begin + BLOCK_S * turn / len(WAYS))
            block = sample_block(number)  # like a machine, which has just computed it
            payload = encode(block)
            sent[way].append(CLOCK.now())
            ways[way](block, payload)
        publisher.undeclare()
        _say(times=sent)


def _sizes() -> tuple[int, int, int]:
    """Return the bytes of a block, of a report and of a command."""
    header: dict[str, Any] = {"run": "x" * 36, "source": "controller", "sequence": 1000}
    line = ReportedLine(
        frequency_hz=651.123456789012, amplitude_n=1.23456789012345, growth_1_per_s=30.1234567890123,
        kind="regenerative", confidence=0.987654321098765,
    )  # fmt: skip
    report = ChatterReport(
        **header, first_sample=90_000, samples=90, guard_state="ACTIVE", session="x" * 16, state="chatter",
        indicator=1.23456789012345, limit=1.23456789012345, limit_source="configured", frequency_hz=651.123456789012,
        amplitude_n=1.23456789012345, kind="regenerative", confidence=0.987654321098765, gap_samples=0, moving=False,
        in_cut=True, spindle_speed_rpm=1200.0, diameter_mm=25.0, line_n=1.23456789012345, line_limit_n=1.23456789012345,
        lines=(line, line), cutting=True, comb_hz=None, notes=(), false_alarms_per_h=0.01,
        shift_requested_deg=2.76543210987654, shift_applied_deg=2.76543210987654,
    )  # fmt: skip
    command = TurretCommand(
        **header, session="x" * 16, shift_deg=2.76543210987654, order=0, action="hold", issued_sample=90_090,
        apply_at_sample=90_270, expires_at_sample=90_900, reason="quiet for 1.2 s at 2.77 deg",
    )  # fmt: skip
    return len(encode(sample_block(0))), len(encode(report)), len(encode(command))


def _relay(endpoint: str, here: str, there: str, size: int) -> None:
    with open_client(endpoint) as session:
        subscriber = session.declare_subscriber(f"bench/{here}", fifo(4096))
        publisher = session.declare_publisher(f"bench/{there}")
        payload = b"\x00" * size
        with contextlib.suppress(KeyboardInterrupt):
            while True:
                subscriber.recv()
                publisher.put(payload)


def _ping(endpoint: str) -> None:
    """Send a block every 10 ms and note when the command comes back, until standard input says that it is enough."""
    from services.process import Parent

    enough = Parent()
    with open_client(endpoint) as session:
        subscriber = session.declare_subscriber("bench/c", fifo(4096))
        publisher = session.declare_publisher("bench/a")
        payload = b"\x00" * _sizes()[0]
        times: list[float] = []
        begin, number = CLOCK.now(), 0
        while not enough.told():
            CLOCK.sleep_until(begin + BLOCK_S * number)
            number += 1
            sent = CLOCK.now()
            publisher.put(payload)
            while (back := subscriber.try_recv()) is None and CLOCK.now() < sent + 0.1:
                CLOCK.sleep_until(CLOCK.now() + 0.0002)
            if back is not None:
                times.append(1e3 * (CLOCK.now() - sent))
                if len(times) == WARM:
                    _say(ready=True)
        _say(times=times)

"""The bus itself: several sessions, real TCP."""

import json
import pathlib
import signal
import subprocess
import sys
import time

import pytest
import zenoh

from services.errors import InputError, RefusalError
from services.messages import Event, SampleBlock, TurretCommand
from services.soak.link import Link
from services.wire import MOST_BYTES, DecodeError, decode, key
from services.zenoh_bus import ZenohBus, check_endpoint, check_machine, open_client
from tests.system.kit import Spy, block, command, free_endpoint, processes, until

pytestmark = pytest.mark.system
FREE = "tcp/127.0.0.1:0"
IMPORTABLE = f"import sys; sys.path.insert(0, {str(pathlib.Path(__file__).parents[2])!r}); "


@pytest.fixture
def router():
    with ZenohBus.router("m", FREE) as bus:
        yield bus


def client(router):
    return ZenohBus.client("m", router.endpoint)


def numbers(inbox, wanted, seconds=20.0):
    """Take blocks or commands until `wanted` of them are there, and return their numbers."""
    found = []

    def enough():
        found.extend(received.message().sequence for received in inbox.take())
        return len(found) >= wanted

    until(enough, seconds)
    return found


def introduce(sender, *receivers):
    """Return when the sender knows what the receivers subscribe to: signs of life come later, as in the barrier."""
    presence = sender.presence()
    names = {f"receiver-{id(receiver)}" for receiver in receivers}
    for receiver in receivers:
        receiver.announce(f"receiver-{id(receiver)}")
    assert until(lambda: names <= alive(presence))
    return names


def alive(presence):
    presence.changes()
    return presence.alive


def event(number):
    return Event(run="run-1", source="test", sequence=number, sample=0, kind="k", text="t")


def test_what_is_published_arrives_in_order_and_as_it_was(router):
    with client(router) as sender, client(router) as receiver:
        blocks, everything = receiver.subscribe(SampleBlock), router.subscribe()
        sender.offer(SampleBlock, TurretCommand, Event)
        introduce(sender, receiver, router)
        sent = [message for k in range(50) for message in (block(k), command(k, shift_deg=0.1 * k), event(k))]
        for message in sent:
            sender.publish(message)
        assert numbers(blocks, 50) == list(range(50))
        got = []
        assert until(lambda: got.extend(r.message() for r in everything.take()) or len(got) >= 150)
        assert [m for m in got if isinstance(m, TurretCommand)] == sent[1::3]
        assert [m.sequence for m in got if isinstance(m, Event)] == list(range(50))


def test_a_newcomer_hears_nothing_of_the_past(router):
    with client(router) as sender, client(router) as receiver:
        everything = router.subscribe()
        introduce(sender, router)
        for k in range(20):
            sender.publish(command(k))
        assert numbers(everything, 20) == list(range(20))
        inbox = receiver.subscribe(TurretCommand)
        introduce(sender, receiver)
        for k in range(20, 40):
            sender.publish(command(k))
        assert numbers(inbox, 20) == list(range(20, 40))


def test_a_port_that_is_taken_is_named(router):
    with pytest.raises(InputError, match="listen must be a free endpoint.*" + router.endpoint.rsplit(":", 1)[1]):
        ZenohBus.router("m", router.endpoint)


def test_nobody_there_is_said():
    with pytest.raises(RefusalError, match="nobody listens at tcp"):
        open_client(free_endpoint())


@pytest.mark.parametrize("bad", ["", "7447", "127.0.0.1:7447", "tcp/", "smoke/127.0.0.1:1", "tcp/a b:1", "tcp/x#y=1"])
def test_what_is_no_endpoint_is_refused(bad):
    with pytest.raises(InputError, match="connect must be an endpoint"):
        check_endpoint("connect", bad)


@pytest.mark.parametrize("bad", ["", "a/b", "*", "lathe 1", "-x", "x" * 65])
def test_what_is_no_name_of_a_machine_is_refused(bad):
    with pytest.raises(InputError, match="machine must be"):
        check_machine(bad)


def test_a_subscriber_that_never_reads_costs_the_others_nothing(router, tmp_path):
    code = (
        "import time; from services.zenoh_bus import open_client, fifo; s = open_client(sys.argv[1]); "
        "h = s.declare_subscriber('antiphase/m/**', fifo(1)); print('ready', flush=True); time.sleep(600)"
    )
    line = [sys.executable, "-c", IMPORTABLE + code, router.endpoint]
    with processes(tmp_path) as start, client(router) as sender, client(router) as receiver:
        sloth = start(line=line)
        assert until(lambda: "ready" in (sloth.folder / "out").read_text())
        inbox, got, worst = receiver.subscribe(SampleBlock), [], 0.0
        sender.offer(SampleBlock)
        introduce(sender, receiver)
        for k in range(1500):
            begin = time.perf_counter()
            sender.publish(block(k))
            worst = max(worst, time.perf_counter() - begin)
            got += [received.message().sequence for received in inbox.take()]
            time.sleep(0.001)
        got += numbers(inbox, 1500 - len(got))
        assert got == list(range(1500))
        assert worst < 1.0  # BLOCK would wait five seconds and cut the link
        assert sloth.ended() is None


@pytest.mark.parametrize("way", ["cut", "clog"])
def test_a_link_that_is_cut_for_a_second_loses_nothing_and_is_seen(router, way):
    link = Link(router.endpoint)
    try:
        with client(router) as sender, ZenohBus.client("m", link.endpoint) as receiver:
            presence, inbox = router.presence(), receiver.subscribe(SampleBlock)
            sender.offer(SampleBlock)
            (name,) = introduce(sender, receiver)
            assert until(lambda: name in alive(presence))
            got, gone_after, k = [], None, 0
            cut_at = mended_at = None
            while mended_at is None or time.monotonic() < mended_at + 0.3:
                now = time.monotonic()
                if k == 20 and cut_at is None:
                    getattr(link, way)()
                    cut_at = now
                if cut_at is not None and mended_at is None and now > cut_at + 1.0:
                    link.mend()
                    mended_at = now
                if (name, False) in presence.changes() and gone_after is None:
                    gone_after = now - cut_at
                sender.publish(block(k))
                k += 1
                got += [received.message().sequence for received in inbox.take()]
                time.sleep(0.01)
            got += numbers(inbox, k - len(got))
            assert got == list(range(k))
            assert gone_after is not None
            assert gone_after < 0.9  # 0.6 s on an idle machine: the lease, and the next look
    finally:
        link.close()


def test_publishing_without_a_link_neither_waits_nor_raises(router):
    link = Link(router.endpoint)
    try:
        with ZenohBus.client("m", link.endpoint) as sender:
            sender.offer(SampleBlock)
            link.cut()
            begin = time.perf_counter()
            for k in range(200):
                sender.publish(block(k))
            assert time.perf_counter() - begin < 2.0
    finally:
        link.close()


def test_whoever_sends_too_much_at_once_is_disconnected_alone(router):
    spy = Spy(router.endpoint, "m")
    try:
        with client(router) as sender, client(router) as rogue:
            sender.offer(TurretCommand)
            introduce(sender, spy.bus)
            name = key("m", TurretCommand)
            rogue._session.put(name, b"\x00" * (MOST_BYTES + 1))
            rogue._session.put(name, b"{]", congestion_control=zenoh.CongestionControl.BLOCK)
            sender.publish(command(7))
            assert until(lambda: _payloads(spy))
            good = [received for received in spy.raw if b'"a test"' in received.payload]
            assert [received.message() for received in good] == [command(7)]
            for received in spy.raw:
                assert len(received.payload) <= MOST_BYTES
                if received not in good:
                    pytest.raises(DecodeError, received.message)
    finally:
        spy.close()


def _payloads(spy):
    spy.raw = [*getattr(spy, "raw", []), *spy.inbox.take()]
    return any(b'"a test"' in received.payload for received in spy.raw)


RAISED, CLEAN = "raise RuntimeError('on purpose')", "pass"
CTRL_C = "import os, signal; os.kill(os.getpid(), signal.SIGINT)"


@pytest.mark.parametrize(("ending", "exit_code"), [(RAISED, 1), (CLEAN, 0), (CTRL_C, -signal.SIGINT)])
def test_a_process_with_an_open_bus_ends_whatever_happens(router, ending, exit_code):
    code = (
        f"{IMPORTABLE}from services.zenoh_bus import *; from services.messages import *\n"
        "with ZenohBus.client('m', sys.argv[1]) as bus:\n"
        "    bus.announce('monitor'); bus.subscribe(SampleBlock); bus.subscribe(); bus.offer(Event); bus.presence()\n"
        f"    {ending}\n"
    )
    done = subprocess.run([sys.executable, "-c", code, router.endpoint], capture_output=True, timeout=30, check=False)
    assert done.returncode == exit_code, done.stderr
    assert until(lambda: "monitor" not in router.alive(), 5.0)


def test_closing_twice_does_no_harm(router):
    bus = client(router)
    bus.subscribe(SampleBlock)
    bus.announce("monitor")
    bus.close()
    bus.close()
    assert until(lambda: "monitor" not in router.alive(), 5.0)


def test_whoever_comes_late_can_ask_for_the_latest_of_any_topic(router):
    with client(router) as talker, zenoh.open(_plain(router.endpoint)) as anybody:
        for number in range(5):
            talker.publish(event(number))

        def latest():
            replies = anybody.get("antiphase/m/event/@adv/**?_anyke;_max=1", timeout=2.0)
            return [decode(Event, reply.ok.payload.to_bytes()).sequence for reply in replies if reply.ok is not None]

        assert until(lambda: latest() == [4], 20.0)


def _plain(endpoint):
    config = zenoh.Config()
    for name, value in (("mode", '"client"'), ("scouting/multicast/enabled", "false"),
                        ("connect/endpoints", json.dumps([endpoint]))):  # fmt: skip
        config.insert_json5(name, value)
    return config

"""Who may say what, with real certificates on real TLS on loopback."""

import shutil

import pytest

from services.clock import WallClock, utc_now
from services.errors import RefusalError
from services.messages import TOPICS, MachineState, TurretCommand
from services.security.authority import make_authority
from services.security.identity import load_identity
from services.security.probe import open_probe, probe, stranger_is_refused
from services.security.rights import RIGHTS
from services.zenoh_bus import ZenohBus, open_client
from tests.system.kit import processes, until

pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("authority") / "certs"
    make_authority(folder, 2, utc_now())
    return folder


@pytest.fixture
def rogue(folder, tmp_path):
    """Give a certificate of another authority, that trusts the router all the same."""
    make_authority(tmp_path / "rogue", 2, utc_now(), roles=("controller",))
    shutil.copy(folder / "authority.pem", tmp_path / "rogue" / "authority.pem")
    return tmp_path / "rogue"


def client(folder, role, endpoint):
    return ZenohBus.client("m", endpoint, None, load_identity(folder, role, utc_now()))


def test_every_role_has_its_rights_and_no_others(folder, rogue):
    with open_probe(folder, None) as endpoint:
        found = probe(folder, endpoint, WallClock())
        assert {one.role for one in found} == set(RIGHTS)
        for one in found:
            assert one.ok, one.describe()
        assert stranger_is_refused(rogue, endpoint)
        with pytest.raises(RefusalError, match="nobody listens"):
            open_client(endpoint.replace("tls/", "tcp/"))


@pytest.mark.parametrize(("role", "topic", "may"), [
    ("recorder", "event", True), ("operator", "event", True), ("recorder", "pitch/command", True),
    ("dashboard", "pitch/command", False), ("monitor", "pitch/command", False),
])  # fmt: skip
def test_what_was_missed_is_fetched_by_those_who_may(folder, role, topic, may):
    with open_probe(folder, None) as endpoint, client(folder, "controller", endpoint) as controller:
        controller.publish_payload(TOPICS[topic], b"missed")
        with client(folder, role, endpoint) as late:
            replies = late._session.get(f"antiphase/m/{topic}/@adv/**?_anyke", timeout=0.5)  # noqa: SLF001
            got = [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]
        assert got == ([b"missed"] if may else [])


def test_refusals_are_told_by_the_router_process(folder, rogue, tmp_path):
    with processes(tmp_path) as start:
        router = start("router", "--listen", "tls/127.0.0.1:0", "--identity", str(folder), "--json")
        assert until(lambda: "endpoint" in router.said())
        endpoint = router.said()["endpoint"]
        with client(folder, "dashboard", endpoint) as dashboard, client(folder, "machine", endpoint) as machine:
            inbox = machine.subscribe(TurretCommand)
            dashboard.publish_payload(TurretCommand, b"move")
            dashboard.publish_payload(MachineState, b"state")
            list(dashboard._session.get("antiphase/m/pitch/command/@adv/**?_anyke", timeout=0.2))  # noqa: SLF001
            assert stranger_is_refused(rogue, endpoint)
            words = ("may not put antiphase/m/pitch/command", "may not put antiphase/m/machine/state",
                     "may not query antiphase/m/pitch/command", "without a valid certificate")  # fmt: skip
            assert until(lambda: all(word in router.told() for word in words), 10.0), router.told()
            assert "dashboard may not" in router.told()
            assert not list(inbox.take())
        assert router.stop() == 0


def test_the_whole_loop_with_certificates(folder, tmp_path):
    with processes(tmp_path) as start:
        up = start(
            "up", "thesis-652", "--identity", str(folder), "--listen", "tls/127.0.0.1:0", "--duration-s", "1.5",
            "--json",
        )  # fmt: skip
        assert up.popen.wait(90.0) == 0, up.told()
        machine = up.said()["machine"]
        assert machine["endpoint"].startswith("tls/")
        assert machine["commands_accepted"] + machine["commands_late"] > 0 or machine["blocks"] >= 150
        assert "refused: " not in up.told()

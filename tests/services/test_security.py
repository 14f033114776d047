"""Certificates, rights and the audit, without a network."""

import json
import shutil
from datetime import timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.clock import utc_now
from services.errors import InputError
from services.messages import TOPICS
from services.security.audit import MOST_KNOWN, Audit
from services.security.authority import make_authority
from services.security.endpoints import check_private
from services.security.identity import load_identity
from services.security.rights import RIGHTS, ROLES, access_control
from tests.services.test_cli import run

NOW = utc_now()


@pytest.fixture(scope="module")
def authority(tmp_path_factory):
    folder = tmp_path_factory.mktemp("authority") / "certs"
    make_authority(folder, 30, NOW)
    return folder


@pytest.fixture
def folder(authority, tmp_path):
    return shutil.copytree(authority, tmp_path / "certs")


def test_every_role_has_an_identity_and_keys_are_private(authority):
    for role in ("router", *ROLES):
        identity = load_identity(authority, role, NOW)
        assert (identity.role, identity.folder) == (role, authority.resolve())
        assert abs(identity.expires - NOW - timedelta(days=30)) < timedelta(seconds=2)
        settings = identity.settings(routes=role == "router")
        assert settings["transport/link/tls/enable_mtls"] is True
        assert ("access_control" in settings) == (role == "router")
    for path in authority.glob("*-key.pem"):
        assert path.stat().st_mode & 0o077 == 0


def test_an_authority_is_never_overwritten(authority):
    before = {path.name: path.read_bytes() for path in authority.iterdir()}
    with pytest.raises(InputError, match="without an authority"):
        make_authority(authority, 30, NOW)
    assert before == {path.name: path.read_bytes() for path in authority.iterdir()}


@pytest.mark.parametrize(
    ("arguments", "field"),
    [({"days": 0}, "days"), ({"days": 9999}, "days"), ({"roles": ["king"]}, "role"), ({"hosts": ["ä b"]}, "host")],
)
def test_wrong_wishes(tmp_path, arguments, field):
    with pytest.raises(InputError) as error:
        make_authority(tmp_path / "x", **{"days": 1, "now": NOW} | arguments)
    assert error.value.field == field


def broken(folder, how):
    if how == "missing":
        (folder / "monitor-key.pem").unlink()
    elif how == "others may read":
        (folder / "monitor-key.pem").chmod(0o640)
    elif how == "another role":
        shutil.copy(folder / "controller.pem", folder / "monitor.pem")
    elif how == "another key":
        shutil.copy(folder / "controller-key.pem", folder / "monitor-key.pem")
    elif how == "another authority":
        make_authority(folder / "rogue", 1, NOW)
        shutil.copy(folder / "rogue" / "authority.pem", folder / "authority.pem")
    elif how == "nonsense":
        (folder / "monitor.pem").write_bytes(b"\x00nonsense")
    return folder


@pytest.mark.parametrize(
    ("how", "rule"),
    [
        ("missing", "must be a file"),
        ("others may read", "readable by its owner only"),
        ("another role", "common name monitor, not controller"),
        ("another key", "the key of"),
        ("another authority", "signed by the authority"),
        ("nonsense", "in PEM"),
    ],
)
def test_an_identity_that_is_not_one(folder, how, rule):
    with pytest.raises(InputError, match=rule) as error:
        load_identity(broken(folder, how), "monitor", NOW)
    assert error.value.field == "identity"


@pytest.mark.parametrize("days", [-1, 31])
def test_an_identity_out_of_its_time(authority, days):
    with pytest.raises(InputError, match="valid now; it is from"):
        load_identity(authority, "monitor", NOW + timedelta(days=days))


def test_only_the_controller_commands_and_only_the_machine_says_how_it_stands():
    def may_say(topic):
        return [role for role, rights in RIGHTS.items() if topic in rights.says]

    assert may_say("pitch/command") == ["controller"]
    assert may_say("operator/request") == ["operator"]
    for topic in ("machine/state", "servo/turret1", "sim/truth"):
        assert may_say(topic) == ["machine"]
    for topic in TOPICS:
        assert may_say(topic), topic
    for role in ("monitor", "controller", "operator"):
        assert "sim/truth" not in RIGHTS[role].hears
    for role in ("dashboard", "watch"):
        assert not RIGHTS[role].says
        assert "pitch/command" not in RIGHTS[role].fetches


def test_what_nobody_allows_is_denied():
    rules = access_control()
    assert (rules["enabled"], rules["default_permission"]) == (True, "deny")
    assert {rule["permission"] for rule in rules["rules"]} == {"allow"}
    named = [name for policy in rules["policies"] for name in policy["rules"]]
    assert sorted(named) == sorted(rule["id"] for rule in rules["rules"])
    puts = [rule for rule in rules["rules"] if "put" in rule["messages"] and "ingress" in rule["flows"]]
    assert [r["id"] for r in puts if "antiphase/*/pitch/command" in r["key_exprs"]] == ["controller says"]
    assert not [r for r in puts if any("**" in key for key in r["key_exprs"])]
    json.dumps(rules)


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/0.0.0.0:7447", "tcp/192.168.1.5:7447", "tcp/[::]:7447", "ws/example:80", "tcp/127.0.0.1.evil:7447",
        "udp/10.0.0.1:1", "tcp/localhost.evil:7447",
    ],
)  # fmt: skip
def test_nobody_listens_to_the_world_without_certificates(endpoint):
    with pytest.raises(InputError, match="whoever reaches an open router") as error:
        check_private(endpoint, None)
    assert (error.value.field, error.value.value) == ("listen", endpoint)


def test_with_certificates_the_world_may_be_listened_to(authority):
    check_private("tls/0.0.0.0:7447", load_identity(authority, "router", NOW))
    for endpoint in ("tcp/127.0.0.1:0", "tcp/localhost:7447", "tcp/[::1]:7447", "unixsock-stream//tmp/bus"):
        check_private(endpoint, None)
        with pytest.raises(InputError, match="begins with tls/"):
            check_private(endpoint, load_identity(authority, "router", NOW))
    with pytest.raises(InputError, match="--identity DIR"):
        check_private("tls/127.0.0.1:7447", None)


LINK = "5ecd on Interface(lo)+CertCommonName(dashboard)+Transport(Tls)+5ecd is unauthorized to Put (egress) on x\n"
DENIED = (
    "T access_control: Using cached result: 5ecd is unauthorized to Put (ingress) on antiphase/m/pitch/command\n"
    "T interceptor: Msg intercepted!\n"
)
ASKED = (
    "T access_control: 5ecd on lo+CertCommonName(dashboard) is unauthorized to Query (ingress) on "
    "antiphase/m/pitch/command/@adv/**\nT interceptor: Msg intercepted!\n"
)
ALLOWED = "T access_control: Using cached result: 5ecd is authorized to Put (ingress) on antiphase/m/event\n"
LISTED = "T access_control: 5ecd on lo is unauthorized to Put (ingress) on antiphase/m/force\nT acl: caching\n"
STRANGER = "\x1b[33m WARN\x1b[0m zenoh_link_tls::unicast\x1b[2m:\x1b[0m invalid peer certificate: Bad. Hint: open\n"


class Still:
    def now(self):
        return 0.0


@given(cuts=st.lists(st.integers(0, 900), max_size=12))
def test_the_audit_reads_refusals_however_the_log_is_cut(cuts):
    told = []
    audit = Audit(told.append, Still())
    text = (LINK + ALLOWED + LISTED + DENIED + ALLOWED + ASKED + STRANGER + DENIED + ALLOWED).encode()
    places = [0, *sorted(min(cut, len(text)) for cut in cuts), len(text)]
    for start, stop in zip(places, places[1:], strict=False):
        audit.feed(text[start:stop])
    assert set(told) == {
        "dashboard may not put antiphase/m/pitch/command",
        "dashboard may not query antiphase/m/pitch/command/@adv/**",
        "somebody without a valid certificate is not let in (invalid peer certificate: Bad)",
    }
    assert sorted(audit.counts.values()) == [1, 1, 2]


def test_a_flood_of_refusals_and_sessions_fills_no_memory():
    told = []
    audit = Audit(told.append, Still())
    for number in range(3 * MOST_KNOWN):
        text = DENIED.replace("5ecd", f"{number:x}").replace("/m/", f"/m{number}/")
        audit.feed((LINK.replace("5ecd", f"{number:x}") + text).encode())
    assert len(told) == 3 * MOST_KNOWN
    assert told[-1] == f"dashboard may not put antiphase/m{3 * MOST_KNOWN - 1}/pitch/command"
    assert len(audit.counts) == MOST_KNOWN
    audit.feed(DENIED.replace("5ecd", "0").encode())
    assert told[-1] == "somebody may not put antiphase/m/pitch/command", "the first session has been forgotten"


def test_certs_and_doctor_on_the_command_line(capsys, tmp_path):
    code, answer = run(capsys, "certs", "--out", str(tmp_path / "c"), "--days", "7", "--host", "lathe.local")
    assert code == 0
    assert set(answer["files"]) == {path.name for path in (tmp_path / "c").iterdir()}
    code, answer = run(capsys, "certs", "--out", str(tmp_path / "c"))
    assert (code, answer["error"]["field"]) == (2, "out")
    code, answer = run(capsys, "doctor", "--connect", "tls/127.0.0.1:1")
    assert (code, answer["error"]["field"]) == (2, "connect")
    for verb in ("monitor", "operator arm", "router"):
        code, answer = run(capsys, *verb.split(), "--identity", str(tmp_path))
        assert (code, answer["error"]["field"]) == (2, "identity")

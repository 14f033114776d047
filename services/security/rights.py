"""What each role may say and hear: the one table, and the access control of the router made from it.

The name in the certificate of a client (its common name) is its role. Whatever is not allowed here is denied. The
router drops what is denied without a word to the sender (a property of Zenoh), so `doctor` probes every right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from services.messages import TOPICS

EVERYTHING = tuple(TOPICS)
COMMAND, REQUEST, TRUTH = "pitch/command", "operator/request", "sim/truth"
_SEEN = tuple(topic for topic in EVERYTHING if topic != REQUEST)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rights:
    """What one role may do.

    Attributes
    ----------
    says
        Topics it may put.
    hears
        Topics it may subscribe to.
    fetches
        Topics of which it may ask the cache of the publisher for what it missed.
    service
        Whether it shows a sign of life under its own name.
    keeps_config
        Whether it answers for `config`.
    """

    says: tuple[str, ...] = ()
    hears: tuple[str, ...] = ()
    fetches: tuple[str, ...] = ()
    service: bool = True
    keeps_config: bool = False


def _does(says: tuple[str, ...], hears: tuple[str, ...], **more: Any) -> Rights:
    return Rights(says=says, hears=hears, fetches=more.pop("fetches", hears), **more)


RIGHTS: dict[str, Rights] = {
    "machine": _does(
        ("servo/turret1", "machine/state", TRUTH, "event"), (COMMAND, REQUEST, "event"), keeps_config=True
    ),
    "monitor": _does(("force", "chatter", "event"), ("servo/turret1", "machine/state", "event")),
    "controller": _does((COMMAND, "event"), ("chatter", "machine/state", "event")),
    "operator": _does((REQUEST,), ("machine/state", "event"), service=False),
    "recorder": _does(("event",), EVERYTHING),
    "dashboard": _does((), _SEEN, fetches=tuple(topic for topic in _SEEN if topic != COMMAND)),
    "watch": _does((), _SEEN, fetches=tuple(topic for topic in _SEEN if topic != COMMAND)),
}
"""Role -> rights. Only the controller may put a command, only the machine its state; who cuts blind (monitor and
controller) never hears the truth of the simulation."""

ROLES = tuple(RIGHTS)
ROUTER = "router"
"""Identity of a process that only routes; it has no rights as a client."""


def access_control() -> dict[str, Any]:
    """Return the access control of a router as Zenoh's configuration wants it."""
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for role, rights in RIGHTS.items():
        made = [rule for rule in _rules(role, rights) if rule["key_exprs"]]
        rules += made
        policies.append({"subjects": [role], "rules": [rule["id"] for rule in made]})
    subjects = [{"id": role, "cert_common_names": [role]} for role in RIGHTS]
    return {
        "enabled": True, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies,
    }  # fmt: skip


def _rules(role: str, rights: Rights) -> list[dict[str, Any]]:
    def rule(name: str, flow: str, messages: list[str], keys: list[str]) -> dict[str, Any]:
        return {
            "id": f"{role} {name}", "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys,
        }  # fmt: skip

    says, hears, fetches = (_keys(topics) for topics in (rights.says, rights.hears, rights.fetches))
    if set(rights.hears) == set(EVERYTHING):
        hears = [*hears, "antiphase/*/**"]
    caches, fetched = ([f"{key}/@adv/**" for key in keys] for keys in (says, fetches))
    alive = [f"antiphase/*/alive/{role}"] if rights.service else []
    config = ["antiphase/*/config"]
    return [
        rule("says", "ingress", ["put", "delete"], says),
        rule("is heard", "egress", ["declare_subscriber"], [*says, "antiphase/*/**"] if says else []),
        rule("hears", "ingress", ["declare_subscriber"], hears),
        rule("is told", "egress", ["put", "delete"], hears),
        rule("keeps", "ingress", ["declare_queryable", "reply"], caches + (config if rights.keeps_config else [])),
        rule("is asked", "egress", ["query"], caches + (config if rights.keeps_config else [])),
        rule("keeps samples", "ingress", ["reply"], says),
        rule("asks", "ingress", ["query"], fetched + config),
        rule("is answered", "egress", ["reply", "declare_queryable"], [*fetched, *fetches, *config]),
        rule("lives", "ingress", ["liveliness_token"], alive),
        rule("looks", "ingress", ["declare_liveliness_subscriber", "liveliness_query"], ["antiphase/*/alive/*"]),
        rule("sees", "egress", ["liveliness_token"], ["antiphase/*/alive/*"]),
    ]


def _keys(topics: tuple[str, ...]) -> list[str]:
    return [f"antiphase/*/{topic}" for topic in topics]

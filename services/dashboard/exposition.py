"""The state of a machine in the text format of Prometheus."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from prometheus_client import CollectorRegistry, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from services.dashboard.hub import Hub

GAUGES = {
    "indicator_n": ("indicator_newtons", "Chatter indicator"),
    "limit_n": ("limit_newtons", "Limit of the indicator, learned"),
    "frequency_hz": ("frequency_hertz", "Detected frequency"),
    "amplitude_n": ("amplitude_newtons", "Force amplitude at that frequency"),
    "shift_requested_deg": ("shift_requested_degrees", "Requested shift of turret 1"),
    "shift_applied_deg": ("shift_applied_degrees", "Applied shift of turret 1"),
    "phase_pi": ("phase_pi", "Phase between the two waves, in pi"),
    "marked_length_mm": ("marked_millimetres", "Feed while chatter was reported"),
    "spindle_speed_rpm": ("spindle_speed_rpm", "Spindle speed per minute"),
}
COUNTS = {
    "commands_accepted": "Commands that the guard accepted",
    "commands_rejected": "Commands that the guard rejected",
    "commands_late": "Commands that came after their time",
}


class StateCollector(Collector):
    """Turns the latest state into metrics at each scrape."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub

    def collect(self) -> Iterator[Metric]:
        """Yield every metric; what is not known is left out."""
        state = self._hub.state()
        yield from _gauges(state)
        for key, text in COUNTS.items():
            if state[key] is not None:
                yield _counter(f"antiphase_{key}", text, state, float(state[key]))
        for name, key, label in (("messages", "messages", "topic"), ("messages_refused", "refused", "reason")):
            counter = CounterMetricFamily(
                f"antiphase_{name}", f"Messages: {key}, since the start of the page", labels=["machine", label]
            )
            for word, count in state[key].items():
                counter.add_metric([state["machine"], word], count)
            yield counter
        yield _counter("antiphase_browsers_dropped", "Browsers that did not read", state, state["browsers_dropped"])


def _gauges(state: dict[str, Any]) -> Iterator[Metric]:
    machine = state["machine"]
    age = state["age_ms"]
    values = [(name, text, state[key]) for key, (name, text) in GAUGES.items()]
    values += [
        ("data_age_seconds", "Age of the oldest of what should be fresh", None if age is None else 1e-3 * age),
        ("stale", "1 when something that should be fresh is older than half a second", float(state["stale"])),
        ("bus_linked", "1 when the router of the bus is in reach", float(state["linked"])),
        ("browsers", "Browsers that look at the page", float(state["browsers"])),
    ]
    for name, text, value in values:
        if value is not None:
            gauge = GaugeMetricFamily(f"antiphase_{name}", text, labels=["machine"])
            gauge.add_metric([machine], value)
            yield gauge
    word = GaugeMetricFamily("antiphase_state", "1 for the present state in one word", labels=["machine", "state"])
    word.add_metric([machine, state["word"]], 1.0)
    yield word
    alive = GaugeMetricFamily("antiphase_service_alive", "1 for a sign of life", labels=["machine", "service"])
    for service in state["services"]:
        alive.add_metric([machine, service["name"]], float(service["alive"]))
    yield alive


def _counter(name: str, text: str, state: dict[str, Any], value: float) -> CounterMetricFamily:
    counter = CounterMetricFamily(name, text, labels=["machine"])
    counter.add_metric([state["machine"]], value)
    return counter


class Exposition:
    """What `/metrics` answers: the machine, and the process of the page itself."""

    def __init__(self, hub: Hub) -> None:
        self._registry = CollectorRegistry()
        self._registry.register(StateCollector(hub))
        ProcessCollector(registry=self._registry)

    def text(self) -> bytes:
        """Return all metrics in the text format."""
        return generate_latest(self._registry)

"""Several machines on one bus, served by one monitor and one controller."""

import signal

import pytest

from services.messages import ChatterReport, SampleBlock, TurretCommand
from tests.system.kit import Spy, free_endpoint, processes, until

pytestmark = pytest.mark.system
MACHINES = ("lathe-1", "lathe-2", "lathe-3")


def test_one_monitor_and_one_controller_serve_three_machines(tmp_path):
    endpoint = free_endpoint()
    named = [word for name in MACHINES for word in ("--machine", name)]
    with processes(tmp_path) as start:
        router = start("router", "--listen", endpoint, "--json")
        assert until(lambda: "endpoint" in router.said())
        followers = [start(verb, *named, "--connect", endpoint, "--json") for verb in ("monitor", "controller")]
        spies = [Spy(endpoint, name) for name in MACHINES]
        lathes = [
            start("machine", "--machine", name, "--connect", endpoint, "--duration-s", "1.5", "--seed", str(seed),
                  "--arm-after-s", "0", "--json")
            for seed, name in enumerate(MACHINES)
        ]  # fmt: skip
        for lathe in lathes:
            assert lathe.popen.wait(90.0) == 0, lathe.told()
        for spy in spies:
            assert spy.until(lambda spy=spy: len(spy.of(ChatterReport)) == 150, 10.0)
            runs = {message.run for kind in (SampleBlock, ChatterReport, TurretCommand) for message in spy.of(kind)}
            assert len(runs) == 1
            assert [report.sequence for report in spy.of(ChatterReport)] == list(range(150))
        assert len({spy.last[SampleBlock].run for spy in spies}) == 3
        for spy in spies:
            spy.close()
        for follower in followers:
            assert follower.stop(signal.SIGTERM) == 0, follower.told()
            answers = follower.said()["machines"]
            assert {answer["machine"] for answer in answers} == set(MACHINES)
            assert all(answer["handled"] == 150 for answer in answers), answers


def test_a_fleet_has_a_router_of_its_own(tmp_path):
    with processes(tmp_path) as start:
        wrong = start("monitor", "--machine", "a", "--machine", "b", "--listen", free_endpoint(), "--json")
        assert wrong.popen.wait(30.0) == 2
        assert wrong.said()["error"]["field"] == "listen"

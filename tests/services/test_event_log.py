"""The audit log: appended line by line, complete after a crash, never in the way of the machine."""

import json
import os
import pathlib
import subprocess
import sys
import threading

import pytest

from services.config import load_case
from services.errors import InputError
from services.event_log import EventLog
from services.messages import Event


def event(number):
    return Event(
        run="r", source="machine", sequence=number, sample=90 * number, kind="guard_state", text="OFF -> ARMED"
    )


def test_lines_are_appended_and_never_rewritten(tmp_path):
    path = tmp_path / "deep" / "events.jsonl"
    for run in ("first", "second"):
        with EventLog(path) as log:
            log.begin(load_case("thesis-652"), run)
            for number in range(3):
                log.write(event(number))
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["run"] for line in lines] == ["first", "r", "r", "r", "second", "r", "r", "r"]
    assert lines[0]["sha256"] == load_case("thesis-652").digest
    assert any(limit.startswith("shift_speed = ") for limit in lines[0]["limits"])
    assert lines[1]["sample"] == 0


def test_a_killed_process_leaves_what_it_told(tmp_path):
    path = tmp_path / "events.jsonl"
    code = (
        "import os, sys, time, pathlib\n"
        "from services.event_log import EventLog\nfrom tests.services.test_event_log import event\n"
        f"log = EventLog(pathlib.Path({str(path)!r}))\n"
        "for k in range(50): log.write(event(k))\n"
        "while log._lines.qsize(): time.sleep(0.001)\n"
        "time.sleep(0.2)\nos.kill(os.getpid(), 9)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False)
    assert done.returncode == -9
    assert len(path.read_text().splitlines()) == 50


WRITER = """
import itertools, pathlib, sys, time
from services.config import load_case
from services.event_log import EventLog
from tests.services.test_event_log import event
log = EventLog(pathlib.Path(sys.argv[1]))
start = log._file.tell()
log.begin(load_case("thesis-652"), "r")
for number in itertools.count():
    log.write(event(number))
    while log._lines.qsize() > 1000:
        time.sleep(1e-4)
    if number % 100 == 0 and log._file.tell() > start + 200_000:
        print(flush=True)
"""


def test_killed_while_it_writes_every_line_but_the_last_is_whole(tmp_path):
    path, whole = tmp_path / "events.jsonl", 0
    for _ in range(2):
        with subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE) as writer:
            assert writer.stdout.readline() == b"\n"
            writer.kill()
        assert writer.returncode == -9
        lines = path.read_bytes().splitlines(keepends=True)
        told = [json.loads(line) for line in lines[whole:] if line.endswith(b"\n") and line.strip()]
        assert "limits" in told[0], "also after a line that was torn"
        assert [line["sequence"] for line in told[1:]] == list(range(len(told) - 1))
        assert len(told) > 500
        whole = len(lines)


def test_what_was_torn_stays_alone_in_its_line(tmp_path):
    path = tmp_path / "events.jsonl"
    path.write_bytes(b'{"sequence": 1}\n{"sequen')
    with EventLog(path) as log:
        log.write(event(7))
    lines = path.read_text().splitlines()
    assert lines[:2] == ['{"sequence": 1}', '{"sequen']
    assert json.loads(lines[2])["sequence"] == 7
    with EventLog(path) as log:
        log.write(event(8))
    assert len(path.read_text().splitlines()) == 4


def test_every_batch_is_synced_before_the_next_and_so_is_the_name_of_the_file(tmp_path, monkeypatch):
    seen = []
    real = os.fsync
    monkeypatch.setattr(os, "fsync", lambda number: seen.append(os.readlink(f"/proc/self/fd/{number}")) or real(number))
    path = tmp_path / "events.jsonl"
    with EventLog(path) as log:
        log.write(event(1))
    assert seen[0] == str(tmp_path)
    assert seen[1:]
    assert set(seen[1:]) == {str(path)}


def test_what_comes_faster_than_the_disk_takes_is_counted_to_the_last(tmp_path, monkeypatch):
    monkeypatch.setattr("services.event_log.ROOM", 20)
    slow = threading.Event()
    monkeypatch.setattr(os, "fsync", lambda number: slow.wait(0.002))
    path = tmp_path / "events.jsonl"
    with EventLog(path) as log:
        for number in range(5000):
            log.write(event(number))
        slow.set()
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    numbers = [line["sequence"] for line in lines if "sequence" in line]
    assert numbers == sorted(set(numbers))
    assert len(numbers) < 5000
    assert len(numbers) + sum(line.get("lost", 0) for line in lines) == 5000


def test_a_full_disk_is_said_and_stops_nothing():
    full = pathlib.Path("/dev/full")
    if not full.exists():
        pytest.skip("no /dev/full here")
    log = EventLog(full)
    log.write(event(1))
    log.close()
    assert "No space" in log.failure


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="appended"):
        EventLog(tmp_path / "file" / "events.jsonl")

"""The report: complete, self-contained, escaped, and right for every way a run can end."""

import base64
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import get_args

import numpy as np
import pytest

from chatter.estimate import LimitSource
from services.metrics import summarize
from services.report import render, write_report, write_summary
from services.sentences import LIMIT_SOURCES, headline, noise_passes, number, tiles, verdict
from tests.services.synthetic import event, make_record, with_twin

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)
VOID = {"meta", "link", "img", "br"}

ENDINGS = {
    "suppressed": (make_record(), "good", "found and stopped"),
    "prevented": (make_record(start_um=0.05, rate_1_s=20.0, detected_s=2.12), "good", "before it marked the part"),
    "stable": (make_record(start_um=0.0, detected_s=None), "good", "No chatter"),
    "forced": (make_record(start_um=0.0, detected_s=None, kind="forced"), "warn", "Forced vibration at 640 Hz"),
    "missed": (make_record(detected_s=None), "bad", "not found"),
    "not_moved": (make_record(shift_deg=None), "bad", "not acted on"),
    "not_suppressed": (make_record(calm=False), "bad", "not stopped"),
    "gave_up": (make_record(calm=False, events=[event(2.5, "give_up", "no pitch within 6 deg.")]), "bad",
                "could not be stopped"),
    "false_alarm": (with_twin(make_record(), vibration_um=np.zeros(54000)), "warn", "Alarm without"),
    "undecided": (make_record(duration_s=2.4, interrupted=True), "warn", "before the outcome was known"),
    "no_cut": (make_record(duration_s=1.0, detected_s=None, interrupted=True), "neutral", "never reached the part"),
}


class Balance(HTMLParser):
    """Checks that every element is closed in order, and collects what the page refers to."""

    def __init__(self):
        super().__init__()
        self.open, self.references, self.text = [], [], []

    def handle_starttag(self, tag, attrs):
        self.references += [value for name, value in attrs if name in {"src", "href", "srcset", "action", "data"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def read(page):
    parser = Balance()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser


@pytest.mark.parametrize(("name", "ending"), ENDINGS.items(), ids=ENDINGS.keys())
def test_every_ending_has_its_verdict_and_a_whole_page(name, ending, tmp_path):
    record, tone, words = ending
    summary = summarize(record)
    assert summary.outcome == name
    judged = verdict(record, summary)
    assert (judged.tone, words in judged.title) == (tone, True)
    page = render(record, summary, tmp_path)
    text = " ".join(read(page).text)
    assert judged.title in text
    assert all(sentence in text for sentence in judged.sentences)
    assert not re.search(r"\b(nan|None|inf)\b", text)


def test_the_good_run_in_the_words_of_the_shop():
    record = make_record()
    summary = summarize(record, ra_before_um=6.1, ra_after_um=1.6)
    said = " ".join(verdict(record, summary).sentences)
    assert "Chatter at 652 Hz was found 0.016 s after it began." in said
    assert "Turret 1 moved 0.60 mm (2.76°) round the bar" in said
    assert "0.34 mm of part was marked." in said
    assert "Roughness Ra 6.1 µm without control, 1.6 µm with it, 3.8 times smoother." in said
    assert ("652 Hz", "chatter frequency") in tiles(record, summary)
    assert headline(record, summary) == "Chatter at 652 Hz found and stopped"


def test_an_interrupted_run_says_so_and_is_never_called_good():
    record = replace(make_record(), interrupted=True)
    judged = verdict(record, summarize(record))
    assert judged.tone == "warn"
    assert "stopped by hand after 6.00 s" in judged.sentences[-1]


def test_the_reason_for_giving_up_is_told():
    record = ENDINGS["gave_up"][0]
    said = verdict(record, summarize(record)).sentences
    assert "The controller gave up 2.50 s after the start: no pitch within 6 deg." in said


def test_the_page_needs_nothing_from_outside(tmp_path):
    (tmp_path / "spectrograms.png").write_bytes(PIXEL)
    record = make_record()
    page = write_report(record, summarize(record), tmp_path).read_text(encoding="utf-8")
    references = read(page).references
    assert any(reference.startswith("data:image/png;base64,") for reference in references)
    assert all(reference.startswith("data:") for reference in references)
    assert "@import" not in page
    assert "url(" not in page
    assert "<script" not in page


def test_everything_foreign_is_escaped(tmp_path):
    nasty = "<script>alert('1')</script>&\""
    record = replace(
        make_record(events=[event(1.0, nasty, nasty)]), title=nasty, case=nasty, config_text=nasty,
        config_hash=nasty, versions={nasty: nasty},
    )  # fmt: skip
    page = render(record, summarize(record), tmp_path)
    assert "<script" not in page
    assert "".join(read(page).text).count(nasty) >= 6


def test_without_figures_the_page_says_so(tmp_path):
    record = make_record()
    assert "No figures were drawn" in render(record, summarize(record), tmp_path)


def test_a_long_log_is_folded(tmp_path):
    record = make_record(events=[event(0.01 * i, "guard", f"line {i}") for i in range(200)])
    assert "<summary>200 events</summary>" in render(record, summarize(record), tmp_path)


def test_the_same_run_gives_the_same_page(tmp_path):
    record = make_record()
    assert render(record, summarize(record), tmp_path) == render(record, summarize(record), tmp_path)


def test_summary_json_is_strict_json(tmp_path):
    summary = replace(summarize(make_record()), ra_before_um=float("nan"), real_time_factor=float("inf"))
    path = write_summary(summary, tmp_path / "new")
    values = json.loads(path.read_text(encoding="utf-8"), parse_constant=lambda word: pytest.fail(word))
    assert (values["ra_before_um"], values["real_time_factor"], values["shift_deg"]) == (None, None, 2.76)


@pytest.mark.parametrize(
    ("value", "digits", "unit", "text"),
    [(None, 1, "mm", "–"), (float("nan"), 1, "mm", "–"), (-0.04, 1, "s", "0.0 s"), (-1.5, 1, "s", "−1.5 s"),
     (2.76, 1, "°", "2.8°"), (3.0, 0, "", "3")],
)  # fmt: skip
def test_numbers_as_people_read_them(value, digits, unit, text):
    assert number(value, digits, unit) == text


def test_every_source_of_a_limit_has_words_and_so_has_its_rate():
    assert set(get_args(LimitSource)) == set(LIMIT_SOURCES)
    said = [noise_passes(rate) for rate in (None, 1e-10, 0.01, 94.0)]
    assert said == [
        "", "noise alone passes it less than once in a million hours", "noise alone passes it about once in 100 hours",
        "noise alone passes it 94 times an hour",
    ]  # fmt: skip

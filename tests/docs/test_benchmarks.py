"""The page of benchmarks says what its data say, and why a peer is quicker."""

import json
from pathlib import Path

import pytest

pytest.importorskip("slycot")

import robustpolish as rp
from benchmarks.growth import above, certified
from benchmarks.page import line, page, unexplained
from benchmarks.row import Row, limited, once
from benchmarks.run import main
from tests.synthesis.hard_plants import flexible_structure

DOCS = Path(__file__).parents[2] / "docs"
DATA = json.loads((DOCS / "benchmarks.json").read_text(encoding="utf-8"))
FAMILIES = {
    "start-up", "norms", "synthesis", "growth", "closed loops", "sweeps", "brush", "diagnosis",
    "robust analysis",
}  # fmt: skip


def test_the_page_is_made_of_the_data():
    assert (DOCS / "benchmarks.md").read_text(encoding="utf-8") == page(DATA)


def test_all_families_are_there():
    assert {row["family"] for row in DATA["rows"]} == FAMILIES
    assert set(DATA["machine"]["peers"]) >= {"numpy", "scipy", "slycot", "control"}


def test_what_is_slower_or_missing_says_why():
    assert [row["task"] for row in DATA["rows"] if unexplained(row)] == []


def test_a_closed_loop_is_a_hundred_times_as_quick_as_by_runge_kutta():
    loops = [row for row in DATA["rows"] if row["family"] == "closed loops"]
    row = next(row for row in loops if row["peer"].startswith("solve_ivp RK45"))
    assert row["asked"] == 0.01
    assert row["met"] is True
    assert row["ratio"] <= 0.01


@pytest.mark.parametrize(
    ("peer_ms", "reason", "kept", "silent"),
    [(1.0, "proven", "proven", False), (1.0, " ", " ", True), (4.0, "proven", "", False)],
)
def test_a_reason_is_kept_where_the_peer_is_quicker(peer_ms, reason, kept, silent):
    row = Row("norms", "a task", "ours", 2.0, "peer", peer_ms, asked=1.5, reason=reason).as_json()
    assert row["reason"] == kept
    assert unexplained(row) is silent
    assert row["met"] is (peer_ms == 4.0)
    assert ("1.5 ✗" in line(row)) is (peer_ms == 1.0)


def test_small_sizes_are_not_for_the_page(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["run", "--quick", "--only", "diagnosis", "--out", str(DOCS)])
    with pytest.raises(SystemExit):
        main()
    assert "full sizes" in capsys.readouterr().err


def test_calls_are_timed_here_and_in_a_process_that_ends():
    spent, found = once(sum, range(1000))
    assert spent >= 0
    assert found == 499500
    assert limited(10.0, int, "7")[1] == 7
    assert limited(10.0, int, "seven") == (None, "ValueError")
    assert limited(0.2, lambda: sum(iter(int, 1)))[0] is None  # never ends


def test_growth_tells_the_gap_to_the_bound_and_what_a_certificate_takes():
    design = rp.output_feedback(flexible_structure(2), "h2")
    assert above(design) == "0.0% above the lower bound"
    # more states than a bound is proven for
    large = rp.output_feedback(flexible_structure(11), "hinf")
    assert large.lower_bound is None
    assert 0 < large.details["estimated_infimum"] <= large.certificate.achieved
    assert above(large).endswith("% above the infimum as doubles estimate it")
    states = design.certificate.poles.size
    for norm, peer in (("hinf", "AB13DD"), ("h2", "AB13BD")):
        row = certified(norm, design)
        assert row.task == f"certificate {norm}, {states} closed-loop states"
        assert row.peer == peer
        assert "proven below" in row.answers
        assert row.ratio is not None

"""`robustpolish design`: certified results in a folder, as a report and as JSON."""

import json

import pandas as pd
import pytest

import robustpolish as rp
from tests.cli.command_line import run


def test_design_saves_a_report(tmp_path):
    out = tmp_path / "results"
    arguments = ("design", "--ideal", "--duration", "0.05", "--out", str(out), "--report")
    result = run(*arguments)
    assert "every row is driven by the same disturbance" in result.stdout
    names = {path.name for path in out.iterdir()}
    assert {"table.csv", "figure.png", "gain.csv", "design.json", "report.html"} <= names
    saved = json.loads((out / "design.json").read_text())
    assert saved["certificate"]["valid"] is True
    gain = pd.read_csv(out / "gain.csv", index_col=0)
    loop = rp.air_bearing(actuation="force").state_feedback_loop(gain.to_numpy())
    assert rp.hinf_norm(loop).value == pytest.approx(saved["norm"]["closed_loop"], rel=1e-6)
    page = (out / "report.html").read_text()
    assert "Effort and price" in page
    assert "certified" in page
    assert "--force" in run(*arguments, code=2).stderr
    run(*arguments, "--force")


def test_design_prints_json_alone(tmp_path):
    report = tmp_path / "report.html"
    found = json.loads(
        run("design", "--ideal", "--duration", "0.02", "--json", "--report", str(report)).stdout
    )
    rows = {row["row"]: row for row in found["rows"]}
    assert rows["with control"]["improvement_percent"]["y"] >= 90
    assert found["status"] in ("optimal", "suboptimal")
    assert report.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]

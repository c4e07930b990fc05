"""The report and the files of a design against the brush."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from robustpolish.app.cli.options import to_json
from robustpolish.app.report.documents import (
    brush_design_report,
    brush_design_summary,
    save_brush_design,
)
from tests import made_up


@pytest.fixture(scope="module")
def job():
    return made_up.brush_design()


def test_the_report_begins_with_the_verdict_and_tells_all(job):
    report = brush_design_report(job)
    assert report.verdict == job.verdict()
    assert report.good is job.design.certificate.valid
    assert [section.title for section in report.sections] == [
        "What was gained", "Effort and price", "Certificate", "Load", "Machine",
    ]  # fmt: skip
    effort, load = report.sections[1], report.sections[3]
    assert effort.text[0] == "The gain was kept below 2e+06 (largest singular value)."
    rows = {row[0]: row for row in effort.tables[0].rows}
    response = job.comparison.responses["with control"]
    assert rows["u_y"][1] == pytest.approx(float(np.abs(response["u_y"]).max()))
    assert ("F_y", 10.0, 10.0) in load.tables[0].rows
    assert load.text == ("Simulated by the brush model 'a step'.",)


def test_the_summary_is_what_programs_read(job):
    found = json.loads(to_json(brush_design_summary(job)))
    np.testing.assert_array_equal(found["gain"], job.design.controller.D)
    assert found["norm"]["open_loop"] == float(job.open_loop_norm)
    assert [row["row"] for row in found["rows"]] == ["without control", "with control"]
    assert found["rows"][0]["improvement_percent"]["x"] is None  # nothing moved
    assert found["certificate"]["valid"] is True
    assert found["units"]["deviation"] == {"x": "m", "y": "m", "z": "m"}
    assert found["units"]["effort"] == "N"
    assert found["units"]["states"]["dx"] == "m/s"


def test_the_files_hold_the_gain_and_the_signals(job, tmp_path):
    save_brush_design(job, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "table.csv", "gain.csv", "figure.png", "disturbance.nc",
        "response-with-control.nc", "response-without-control.nc",
    }  # fmt: skip
    gain = pd.read_csv(tmp_path / "gain.csv", index_col=0)
    np.testing.assert_array_equal(gain, job.design.controller.D)
    assert list(gain.index) == list(job.plant.control_names)
    with xr.open_dataset(tmp_path / "response-with-control.nc") as saved:
        np.testing.assert_array_equal(saved["y"], job.comparison.responses["with control"]["y"])

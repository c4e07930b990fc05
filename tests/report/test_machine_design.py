"""The report and the files of a design for a machine."""

import json

import pandas as pd
import pytest

import robustpolish as rp
from robustpolish.app.report.documents import machine_design_report, save_machine_design
from robustpolish.app.report.html import render_html
from tests.machine_design.machines import DESIGN, SPINDLE


@pytest.fixture(scope="module")
def found():
    return rp.design_machine(SPINDLE + DESIGN)


def test_the_report_answers_whether_it_can_be_built(found):
    report = machine_design_report(found)
    assert report.title == "Controller for spindle on its slide"
    titles = [section.title for section in report.sections]
    assert titles == ["What was gained", "Can it be built?", "Why it can be trusted"]
    assert report.sections[1].points == found.analysis.problems
    assert "Largest gains" in render_html(report, "1")


def test_the_files(found, tmp_path):
    save_machine_design(found, tmp_path)
    design = rp.results.Design.load(tmp_path / "design.json")
    assert design.certificate.achieved == pytest.approx(found.design.certificate.achieved)
    assert rp.GeneralizedPlant.load(tmp_path / "plant.json").limits["F"] == 200.0
    table = pd.read_csv(tmp_path / "table.csv")
    assert list(table["controlled"]) == pytest.approx([found.channels[0].controlled])
    assert (tmp_path / "figure.png").stat().st_size > 1000
    assert json.loads((tmp_path / "design.json").read_text())["robustpolish"] == "design"

"""The sections on what can be built, on the default design."""

import json
import re

import numpy as np
import pytest

from robustpolish.app.cli.options import to_json
from robustpolish.app.report.documents import (
    actuator_forces_section,
    assumptions_section,
    brush_design_report,
    brush_design_text,
    buildability_section,
    buildable_summary,
    hardware_limits_table,
    hardware_table,
    sampled_certificate,
    save_brush_design,
    z_deviation_section,
)
from robustpolish.app.report.html import render_html


def test_margins_and_the_delay_of_the_ideal_stand_side_by_side(buildable_job):
    section = buildability_section(buildable_job)
    words = " ".join(section.text)
    assert buildable_job.loop.explain() in words
    assert buildable_job.sampled.message in words
    ideal = 1e6 * buildable_job.ideal_loop.delay_margin
    assert f"ideal bears a delay of {ideal:.3g} µs" in words
    assert len(section.pictures) == 1
    beside, costs = section.tables
    rows = {row[0]: row[1:] for row in beside.rows}
    gain_db, _ = rows["disk margin, one loop at a time [dB]"]
    phase_deg, _ = rows["disk margin, one loop at a time [deg]"]
    assert gain_db >= 6
    assert phase_deg >= 30
    assert costs.rows == hardware_limits_table(buildable_job).rows


def test_what_reality_costs_is_told_relative_to_what_is_built(buildable_job):
    table = hardware_limits_table(buildable_job)
    rows = {row[0]: row for row in table.rows}
    assert rows["as it can be built"][2] == 1
    deviation = {row.what: row.deviation for row in buildable_job.limits}["as it can be built"]
    assert table.columns[3] == "largest deviation [µm]"
    assert rows["as it can be built"][3] == pytest.approx(1e6 * deviation)
    built, faster = rows["as it can be built"][1], rows["ten times the sampling"][1]
    assert rows["ten times the sampling"][2] == pytest.approx(faster / built)
    words = buildability_section(buildable_job).text[-1]
    factor = built / rows["the thesis's ideal"][1]
    assert f"a factor of {factor:.3g}" in words
    assert "ten times the sampling" in words


def test_what_could_go_wrong_names_the_numbers_at_which_it_breaks(buildable_job):
    section = assumptions_section(buildable_job)
    points = " ".join(section.points)
    for subject in ("delay", "Slower sampling", "Slower actuators", "Flexible modes", "Noise",
                    "Saturation", "Drift", "Gyroscopic"):  # fmt: skip
        assert subject in points
    assert f"{1e6 * buildable_job.loop.delay_margin:.3g} µs more" in points
    assert f"below {buildable_job.slowest_actuator_hz:.0f} Hz" in points
    assert not re.search(r"\b(nan|inf)\b", points)
    (table,) = section.tables
    assert [row[0] for row in table.rows] == list(buildable_job.survived)
    assert all(row[1] for row in table.rows)


def test_z_is_explained(buildable_job):
    section = z_deviation_section(buildable_job)
    words = " ".join(section.text)
    deviation = buildable_job.comparison.table["deviation"].sel(signal="z")
    for row in ("without control", "thesis's ideal"):
        assert f"{1e9 * float(deviation.sel(row=row)):.0f} nm" in words
    static = 1e9 * abs(buildable_job.static_deflection)
    assert f"bends z by {static:.0f} nm" in words
    assert len(section.pictures) == 1


def test_tables_of_effort_hardware_and_certificate(buildable_job):
    rows = {row[0]: row for row in actuator_forces_section(buildable_job).tables[0].rows}
    assert list(rows) == ["u_x", "u_y"]
    run = buildable_job.run
    assert rows["u_y"][1] == float(np.abs(run["u_y"]).max())
    assert rows["u_y"][4] == 100 * run["u_y"].attrs["at_limit"]
    assert hardware_table(buildable_job).rows == tuple(buildable_job.hardware.table())
    proven = {row[0]: row[1] for row in sampled_certificate(buildable_job).rows}
    assert proven["proven stable, between samples too"] is True
    assert proven["computation delay [s]"] == 2.5e-5


def test_the_summary_is_what_programs_read(buildable_job):
    found = json.loads(to_json(buildable_summary(buildable_job)))
    assert found["good"] is True
    assert found["sampled"]["valid"] is True
    assert found["sampled"]["achieved"] <= found["sampled"]["bound"]
    assert found["ideal_delay_margin_s"] == buildable_job.ideal_loop.delay_margin
    assert set(found["survived"]) == set(buildable_job.survived)
    assert [row["what"] for row in found["limits"]] == [row.what for row in buildable_job.limits]
    assert found["hardware"]["sample_rate_hz"] == 20e3


def test_the_whole_report_and_its_files(buildable_job, tmp_path):
    report = brush_design_report(buildable_job)
    assert [section.title for section in report.sections] == [
        "What was gained", "Can it be built?", "What could go wrong", "Why z is left alone",
        "Effort", "Certificate", "Load", "Machine",
    ]  # fmt: skip
    assert report.good
    page = render_html(report, "1.2.3")
    assert "Can it be built?" in page
    shown = brush_design_text(buildable_job)
    assert "What reality costs" in shown
    assert "disk margin, one loop at a time [dB]" in shown
    save_brush_design(buildable_job, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "table.csv", "limits.csv", "figure.png", "disturbance.nc", "controller.c",
        "controller.json", "response-with-control.nc", "response-without-control.nc",
        "response-thesiss-ideal.nc",
    }  # fmt: skip
    code = json.loads((tmp_path / "controller.json").read_text())
    np.testing.assert_array_equal(code["limits"], [[-20.0, -20.0], [20.0, 20.0]])

"""Reports: the verdict first, then the evidence; one HTML file that needs no network."""

import json
import re
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.app.cli.options import to_json
from robustpolish.app.documents import (
    assumptions_section,
    brush_design_report,
    brush_design_summary,
    brush_design_text,
    buildability_section,
    buildable_summary,
    diagnosis_report,
    hardware_limits_table,
    machine_design_report,
    save_brush_design,
    save_machine_design,
    z_deviation_section,
)
from robustpolish.app.html import Picture, Report, Section, render_html
from robustpolish.base.results import Table
from robustpolish.identification.compare import step_runs
from robustpolish.identification.observer.starts import SmoothedMotion
from robustpolish.identification.residual_tests import force_maps
from robustpolish.identification.tell_apart import tell_apart
from robustpolish.machines.effects.effect import lookup
from robustpolish.machines.simulation import simulate_model as simulate
from tests import made_up
from tests.app.machines import DESIGN, SPINDLE


@pytest.fixture
def page():
    figure, axes = plt.subplots()
    axes.plot([0, 1], [0, 1])
    axes.set_xlabel("time [s]")
    plt.close(figure)
    table = Table("Deviations", ("row", "y [m]"), (("a <b>", 1.25e-6), ("none", float("nan"))))
    section = Section("What was gained", ("It works.",), (Picture("A line", figure),), (table,))
    return render_html(Report("Design", "Certified & checked.", True, (section,)), "1.2.3")


def test_it_needs_no_network_and_its_content_is_escaped(page):
    links = re.findall(r"(?:src|href)=\"(?!#|data:)([^\"]+)\"", page)
    assert links == []
    assert "url(http" not in page
    assert "Certified &amp; checked." in page
    assert "a &lt;b&gt;" in page
    assert "<b>" not in page
    assert "1.25e-06" in page
    assert '<td data-value="nan" class="number">–</td>' in page
    assert "time [s]" in page
    assert "robustpolish 1.2.3" in page


@pytest.fixture(scope="module")
def job():
    return made_up.brush_design()


def test_the_report_and_summary_of_an_ideal_design(job, tmp_path):
    report = brush_design_report(job)
    assert (report.verdict, report.good) == (job.verdict(), job.design.certificate.valid)
    effort, load = section(report, "Effort and price"), section(report, "Load")
    assert effort.text[0] == "The gain was kept below 2e+06 (largest singular value)."
    rows = {row[0]: row for row in effort.tables[0].rows}
    response = job.comparison.responses["with control"]
    assert rows["u_y"][1] == pytest.approx(float(np.abs(response["u_y"]).max()))
    assert ("F_y", 10.0, 10.0) in load.tables[0].rows
    assert load.text == ("Simulated by the brush model 'a step'.",)
    found = json.loads(to_json(brush_design_summary(job)))
    np.testing.assert_array_equal(found["gain"], job.design.controller.D)
    assert found["norm"]["open_loop"] == float(job.open_loop_norm)
    assert [row["row"] for row in found["rows"]] == ["without control", "with control"]
    assert found["rows"][0]["improvement_percent"]["x"] is None  # nothing moved
    assert found["certificate"]["valid"] is True
    assert (found["units"]["effort"], found["units"]["states"]["dx"]) == ("N", "m/s")
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


def test_sections_of_a_controller_that_can_be_built(buildable_job):
    part = buildability_section(buildable_job)
    words = " ".join(part.text)
    assert buildable_job.loop.explain() in words
    assert buildable_job.sampled.message in words
    ideal = 1e6 * buildable_job.ideal_loop.delay_margin
    assert f"ideal bears a delay of {ideal:.3g} µs" in words
    assert len(part.pictures) == 1
    beside, costs = part.tables
    rows = {row[0]: row[1:] for row in beside.rows}
    gain_db, _ = rows["disk margin, one loop at a time [dB]"]
    phase_deg, _ = rows["disk margin, one loop at a time [deg]"]
    assert gain_db >= 6
    assert phase_deg >= 30
    assert costs.rows == hardware_limits_table(buildable_job).rows
    rows = {row[0]: row for row in costs.rows}
    assert rows["as it can be built"][2] == 1
    deviation = {row.what: row.deviation for row in buildable_job.limits}["as it can be built"]
    assert costs.columns[3] == "largest deviation [µm]"
    assert rows["as it can be built"][3] == pytest.approx(1e6 * deviation)
    built, faster = rows["as it can be built"][1], rows["ten times the sampling"][1]
    assert rows["ten times the sampling"][2] == pytest.approx(faster / built)
    words = part.text[-1]
    factor = built / rows["the thesis's ideal"][1]
    assert f"a factor of {factor:.3g}" in words
    assert "ten times the sampling" in words
    part = assumptions_section(buildable_job)
    points = " ".join(part.points)
    for subject in ("delay", "Slower sampling", "Slower actuators", "Flexible modes", "Noise",
                    "Saturation", "Drift", "Gyroscopic"):  # fmt: skip
        assert subject in points
    assert f"{1e6 * buildable_job.loop.delay_margin:.3g} µs more" in points
    assert f"below {buildable_job.slowest_actuator_hz:.0f} Hz" in points
    assert not re.search(r"\b(nan|inf)\b", points)
    (table,) = part.tables
    assert [row[0] for row in table.rows] == list(buildable_job.survived)
    assert all(row[1] for row in table.rows)
    part = z_deviation_section(buildable_job)
    words = " ".join(part.text)
    deviation = buildable_job.comparison.table["deviation"].sel(signal="z")
    for row in ("without control", "thesis's ideal"):
        assert f"{1e9 * float(deviation.sel(row=row)):.0f} nm" in words
    static = 1e9 * abs(buildable_job.static_deflection)
    assert f"bends z by {static:.0f} nm" in words
    assert len(part.pictures) == 1


def test_the_whole_report_its_summary_and_files(buildable_job, tmp_path):
    found = json.loads(to_json(buildable_summary(buildable_job)))
    assert found["good"] is True
    assert found["sampled"]["valid"] is True
    assert found["sampled"]["achieved"] <= found["sampled"]["bound"]
    assert found["ideal_delay_margin_s"] == buildable_job.ideal_loop.delay_margin
    assert set(found["survived"]) == set(buildable_job.survived)
    assert [row["what"] for row in found["limits"]] == [row.what for row in buildable_job.limits]
    assert found["hardware"]["sample_rate_hz"] == 20e3
    report = brush_design_report(buildable_job)
    assert report.good
    assert "Can it be built?" in render_html(report, "1.2.3")
    assert "disk margin, one loop at a time [dB]" in brush_design_text(buildable_job)
    save_brush_design(buildable_job, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {
        "table.csv", "limits.csv", "figure.png", "disturbance.nc", "controller.c",
        "controller.json", "response-with-control.nc", "response-without-control.nc",
        "response-thesiss-ideal.nc",
    }  # fmt: skip
    code = json.loads((tmp_path / "controller.json").read_text())
    np.testing.assert_array_equal(code["limits"], [[-20.0, -20.0], [20.0, 20.0]])


@pytest.fixture(scope="module")
def found():
    return rp.design_machine(SPINDLE + DESIGN)


def test_the_report_of_a_machine_and_its_files(found, tmp_path):
    report = machine_design_report(found)
    assert report.title == "Controller for spindle on its slide"
    assert section(report, "Can it be built?").points == found.analysis.problems
    assert "Largest gains" in render_html(report, "1")
    save_machine_design(found, tmp_path)
    design = rp.results.Design.load(tmp_path / "design.json")
    assert design.certificate.achieved == pytest.approx(found.design.certificate.achieved)
    assert rp.GeneralizedPlant.load(tmp_path / "plant.json").limits["F"] == 200.0
    table = pd.read_csv(tmp_path / "table.csv")
    assert list(table["controlled"]) == pytest.approx([found.channels[0].controlled])
    assert (tmp_path / "figure.png").stat().st_size > 1000
    assert json.loads((tmp_path / "design.json").read_text())["robustpolish"] == "design"


@pytest.fixture(scope="module")
def told():
    return made_up.diagnosis()


def section(report, title):
    return next(part for part in report.sections if part.title == title)


def test_which_and_how_much_and_what_to_check(told):
    report = diagnosis_report(told)
    assert report.title == "Diagnosis of slide"
    assert report.good
    assert report.verdict.endswith(told.reasons[0])
    assert "Where the model failed" not in [part.title for part in report.sections]  # no data
    which = section(report, "Which effects were added")
    row = ("coulomb_friction", "x, ground", "force", 3.1, 0.02, "N")
    assert which.tables[0].rows == (row,)
    assert lookup("coulomb_friction").looks_like in which.text[0]
    fall = section(report, "How much of the error is gone").tables[0]
    assert fall.rows == (
        ("base", 0.5), ("refit", 0.31), ("coulomb_friction", 0.0123456789), ("noise floor", 0.01),
    )  # fmt: skip
    checks = section(report, "What to check on the machine")
    assert len(checks.points) == len(lookup("coulomb_friction").checks)
    assert checks.tables[0].rows[0][2] == "Move slowly, <1 mm/s, and change the speed."
    assert ("spring[0].stiffness", 8e4, None, "N/m") in section(
        report, "All fitted numbers"
    ).tables[0].rows
    candidates = section(report, "Candidates").tables[0].rows
    assert candidates[1] == (1, "quadratic_damping at x, ground", None, 9.1, "", "not sensible")


def test_a_learned_law_is_drawn_and_told():
    report = diagnosis_report(made_up.unknown_law())
    which = section(report, "Which effects were added")
    (shown,) = which.pictures
    assert shown.caption == "The force over displacement at x, ground as learned."
    assert any("k5*q**5 with k5 = " in point for point in which.points)
    assert [row[:3] for row in which.tables[0].rows] == [("coulomb_friction", "x, ground", "force")]
    assert not report.good  # what nobody has named is to be looked at


def test_nothing_found_is_said_and_warnings_come_first(told):
    report = diagnosis_report(
        replace(told, verdict="unexplained", effects=(), candidates=(), indistinguishable=())
    )
    assert not report.good
    assert section(report, "Which effects were added").text == ("None.",)
    assert section(report, "What to check on the machine").text == (
        "Nothing was found that could be checked on the machine.",
    )
    assert "Candidates" not in [part.title for part in report.sections]
    note = "x sticks at its extremes in 7 places"
    first, *rest = diagnosis_report(replace(told, notes=(note,))).sections
    assert (first.title, first.points) == ("Look at the record and the numbers first", (note,))
    assert not any(note in " ".join([*part.text, *part.points]) for part in rest)


def test_what_is_left_is_mapped_whatever_the_verdict(told):
    time = np.linspace(0, 60, 3000)
    q, v = np.sin(time) + 0.5 * np.sin(2.3 * time), np.cos(time) + 1.15 * np.cos(2.3 * time)
    motion = SmoothedMotion(
        q[None], v[None], v[None], 4.0 * q[None] ** 3, np.zeros((3000, 1)), q[:, None],
        np.zeros((3000, 0)),
    )  # fmt: skip
    maps = force_maps(told.model, motion)
    found = replace(told, verdict="unexplained", effects=(), maps=maps)
    left = section(diagnosis_report(found), "What is left")
    assert left.points == (maps[0].describe(),)
    assert [p.caption for p in left.pictures] == [
        "Force that is still missing at each site.", "Force that is still missing at x.",
    ]  # fmt: skip
    (mesh,) = left.pictures[1].figure.axes[0].collections[:1]
    shown = np.asarray(mesh.get_array(), dtype=float)
    assert np.nanmax(shown) == pytest.approx(np.nanmax(maps[0].surface["force"]))
    assert len(left.text) == 1
    noise = replace(maps[0], follows=0.02)
    quiet = section(diagnosis_report(replace(found, maps=(noise,))), "What is left")
    assert quiet.text[-1] == "Here the motion foretells next to nothing of what is left."


def test_every_step_is_shown_with_the_model_before_and_after(told):
    runs = step_runs(stepped(told), DATA)
    steps = section(diagnosis_report(told, runs=runs), "Step by step")
    assert [point.split(":")[0] for point in steps.points] == ["refit", "coulomb_friction"]
    old, new = (run.outputs["x"].rmse for run in (runs[2].before, runs[2].after))
    assert steps.points[1] == (
        f"coulomb_friction: the error of x goes from {old:.4g} to {new:.4g} m."
    )
    assert new < 0.2 * old
    assert "before and after coulomb_friction" in steps.pictures[1].caption
    titles = [part.title for part in diagnosis_report(told, runs=runs).sections]
    assert titles[0] == "Where the model failed"  # the first run is the model as it was


def test_experiments_for_alike_effects_are_proposed_with_figures(told):
    found = tell_apart((told.model, told.model.without_effects()), DATA, fit=False)
    part = section(
        diagnosis_report(told, experiments=[found]),
        "Which experiment would tell alike effects apart",
    )
    assert part.text[0].startswith("To tell coulomb_friction at x, ground from ")
    assert str(found.recommended.experiment) in part.text[0]
    assert part.tables[0].rows == found.table().rows
    assert len(part.pictures) == 2


def stepped(told):
    """The diagnosis with the models of its steps, as one that was just made."""
    base = told.model.without_effects()
    models = (base.with_parameters({"spring[0].stiffness": 7e4}), base, told.model)
    entries = tuple(
        replace(entry, model=model)
        for entry, model in zip(told.ledger.entries, models, strict=True)
    )
    return replace(told, ledger=replace(told.ledger, entries=entries))


def pushed():
    time = np.arange(4000) / 2e3
    push = 30 * np.random.default_rng(0).standard_normal(time.size)
    data = xr.Dataset({"F": ("time", push, {"units": "N"})}, {"time": time})
    x = simulate(made_up.diagnosis().model, data).outputs[:, 0]
    x = x + 0.01 * np.std(x) * np.random.default_rng(1).standard_normal(time.size)
    return data.assign(x=("time", x, {"units": "m"}))


DATA = pushed()

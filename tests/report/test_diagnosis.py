"""The report of a diagnosis: where, which, how much, and what to check."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from robustpolish.app.report.documents import diagnosis_report
from robustpolish.identification.experiments.tell_apart import tell_apart
from robustpolish.identification.observer.missing_force import SmoothedMotion
from robustpolish.identification.residuals.tests import force_maps
from robustpolish.identification.steps import step_runs
from robustpolish.machines.effects.effect import lookup
from robustpolish.machines.simulation.run import simulate_model as simulate
from tests import made_up
from tests.identification.learned_diagnosis import unknown_law


@pytest.fixture(scope="module")
def told():
    return made_up.diagnosis()


def section(report, title):
    return next(part for part in report.sections if part.title == title)


def test_without_data_there_is_no_where(told):
    report = diagnosis_report(told)
    assert report.title == "Diagnosis of slide"
    assert report.good
    assert report.verdict.endswith(told.reasons[0])
    assert [part.title for part in report.sections] == [
        "Which effects were added", "How much of the error is gone", "What is left",
        "What to check on the machine", "Candidates", "All fitted numbers",
    ]  # fmt: skip


def test_which_and_how_much(told):
    report = diagnosis_report(told)
    which = section(report, "Which effects were added")
    row = ("coulomb_friction", "x, ground", "force", 3.1, 0.02, "N")
    assert which.tables[0].rows == (row,)
    assert lookup("coulomb_friction").looks_like in which.text[0]
    fall = section(report, "How much of the error is gone").tables[0]
    assert fall.rows == (
        ("base", 0.5), ("refit", 0.31), ("coulomb_friction", 0.0123456789), ("noise floor", 0.01),
    )  # fmt: skip


def test_checks_and_what_cannot_be_told_apart(told):
    checks = section(diagnosis_report(told), "What to check on the machine")
    assert len(checks.points) == len(lookup("coulomb_friction").checks)
    assert checks.tables[0].rows[0][2] == "Move slowly, <1 mm/s, and change the speed."


def test_numbers_that_were_not_found_are_left_blank(told):
    report = diagnosis_report(told)
    assert ("spring[0].stiffness", 8e4, None, "N/m") in section(
        report, "All fitted numbers"
    ).tables[0].rows
    candidates = section(report, "Candidates").tables[0].rows
    assert candidates[1] == (1, "quadratic_damping", "x, ground", None, 9.1, "not sensible")


def test_a_learned_law_is_drawn_and_told():
    report = diagnosis_report(unknown_law())
    which = section(report, "Which effects were added")
    (shown,) = which.pictures
    assert shown.caption == "The force over displacement at x, ground as learned."
    assert any("k5*q**5 with k5 = " in point for point in which.points)
    assert [row[:3] for row in which.tables[0].rows] == [("coulomb_friction", "x, ground", "force")]
    assert not report.good  # what nobody has named is to be looked at


def test_nothing_found_is_said(told):
    report = diagnosis_report(
        replace(told, verdict="unexplained", effects=(), candidates=(), indistinguishable=())
    )
    assert not report.good
    assert section(report, "Which effects were added").text == ("None.",)
    assert section(report, "What to check on the machine").text == (
        "Nothing was found that could be checked on the machine.",
    )
    assert "Candidates" not in [part.title for part in report.sections]


def test_warnings_come_first_and_once(told):
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
        diagnosis_report(told, told=[found]), "Which experiment would tell alike effects apart"
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

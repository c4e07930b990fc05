"""`robustpolish design`: certified results in a folder, as a report and as JSON."""

import importlib
import json

import control
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


def test_by_default_it_designs_what_can_be_built(tmp_path, buildable_job, monkeypatch):
    asked = []

    def designed(**options):
        asked.append(options)
        return buildable_job

    module = importlib.import_module("robustpolish.app.cli.design")
    monkeypatch.setattr(module, "design_against_brush", designed)
    out = tmp_path / "results"
    shown = run("design", "--duration", "0.02", "--out", str(out), "--report").stdout
    assert "The controller can be built" in shown
    assert "What reality costs" in shown
    (options,) = asked
    assert options["duration"] == 0.02
    assert options["realisation"] is None
    names = {path.name for path in out.iterdir()}
    assert {"controller.c", "limits.csv", "design.json", "report.html"} <= names
    saved = json.loads((out / "design.json").read_text())
    assert saved["realisation"] == "buildable"
    assert saved["built"]["sampled"]["valid"] is True
    assert "Can it be built?" in (out / "report.html").read_text()


@pytest.mark.long
def test_the_demo_is_a_controller_that_can_be_built(tmp_path):
    out = tmp_path / "demo"
    run("design", "--out", str(out), "--report")
    saved = json.loads((out / "design.json").read_text())
    built = saved["built"]
    # Stable with its delay and sampling, exactly between the samples.
    sampled = built["sampled"]
    assert sampled["valid"]
    assert sampled["stable"]
    assert (sampled["period"], sampled["delay"]) == (5e-5, 2.5e-5)
    assert sampled["period"] < sampled["largest_period"]
    # Margins at each input, of the code that was written.
    code = json.loads((out / "controller.json").read_text())
    controller = control.ss(code["A"], code["B"], code["C"], code["D"], code["period"])
    plant = rp.polishing.polishing_plant()
    loop = rp.loop_analysis(rp.implementation.plant_at_samples(plant, 5e-5, 2.5e-5), controller)
    inputs = [margins for margins in loop.margins if margins.place == "input"]
    assert len(inputs) == 2
    for margins in inputs:
        assert margins.disk.gain_db >= 6
        assert margins.disk.phase_deg >= 30
    # Actuators 30 % slower, and the bearing's stiffness 5 % off.
    slow = rp.polishing.polishing_plant(
        rp.polishing.PolishingHardware(actuator_bandwidth_hz=1400.0)
    )
    assert rp.implementation.certify_sampled(slow, controller, delay=2.5e-5).valid
    assert len(built["survived"]) == 3
    assert all(found["valid"] for found in built["survived"].values())
    # The report shows it, the delay of the ideal beside it.
    assert len(built["limits"]) == 7
    page = (out / "report.html").read_text()
    assert "Can it be built?" in page
    assert "What could go wrong" in page
    assert f"{1e6 * built['ideal_delay_margin_s']:.3g} µs" in page

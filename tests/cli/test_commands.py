"""The command line: what it prints, what it saves, how it refuses."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from click.testing import CliRunner

import robustpolish as rp
from robustpolish.cli import main


def run(*arguments, code=0):
    result = CliRunner().invoke(main, arguments)
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == code, result.output
    return result


def test_help_lists_every_command():
    text = run("--help").stdout
    for command in ("design", "modes", "norms", "brush"):
        assert command in text
        assert "Usage" in run(command, "--help").stdout
    assert rp.__version__ in run("--version").stdout
    assert "No such command" in run("nonsense", code=2).stderr


def test_modes_are_those_of_the_thesis():
    found = json.loads(run("modes", "--json").stdout)["modes"]
    hertz = sorted(mode["frequency_hz"] for mode in found)
    np.testing.assert_allclose(
        hertz, [194.0691, 194.0691, 2069.58, 2069.58, 2824.58, 4610.75], rtol=2e-6
    )
    assert "194.0691" in run("modes").stdout
    assert "3361" in run("modes", "--parameters", "corrected").stdout


def test_norms_are_those_of_the_thesis(tmp_path):
    found = json.loads(run("norms", "--dissipation", "0.01", "--json").stdout)
    assert found["hinf"]["value"] == pytest.approx(0.00211825, abs=5e-9)
    assert found["h2"]["value"] == pytest.approx(0.00294744, abs=5e-9)
    target = tmp_path / "norms.json"
    assert "0.02118" in run("norms", "--json", str(target)).stdout
    assert json.loads(target.read_text())["hinf"]["frequency_hz"] == pytest.approx(
        194.069, abs=1e-3
    )
    assert "--force" in run("norms", "--json", str(target), code=2).stderr


def test_undamped_norm_is_infinite_and_says_why():
    result = run("norms", "--dissipation", "0", "--json")
    found = json.loads(result.stdout)
    assert found["hinf"]["value"] == "inf"
    assert found["hinf"]["frequency_hz"] is None or found["hinf"]["frequency_hz"] == "inf"
    assert found["hinf"]["reason"]


@pytest.mark.parametrize("ending", ["csv", "nc"])
def test_brush_saves_its_signals(tmp_path, ending):
    target = tmp_path / f"brush.{ending}"
    result = run("brush", "--duration", "0.02", "--out", str(target), "--json")
    forces = json.loads(result.stdout)["forces"]
    assert 5 < forces["F_z"]["largest"] < 50
    if ending == "csv":
        assert len(pd.read_csv(target)) == 401
    else:
        with xr.open_dataset(target) as saved:
            assert saved.sizes["time"] == 401
    before = target.read_bytes()
    assert "--force" in run("brush", "--duration", "0.02", "--out", str(target), code=2).stderr
    assert target.read_bytes() == before


def test_bad_input_ends_in_a_message(tmp_path):
    assert "duration: got -1.0" in run("brush", "--duration", "-1", code=2).stderr
    assert "dissipation" in run("norms", "--dissipation", "nan", code=2).stderr
    assert "out: got" in run("brush", "--out", str(tmp_path / "a.xyz"), code=2).stderr
    assert list(tmp_path.iterdir()) == []


def test_design_saves_a_report(tmp_path):
    out = tmp_path / "results"
    arguments = ("design", "--duration", "0.05", "--out", str(out), "--report")
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
        run("design", "--duration", "0.02", "--json", "--report", str(report)).stdout
    )
    rows = {row["row"]: row for row in found["rows"]}
    assert rows["with control"]["improvement_percent"]["y"] >= 90
    assert found["status"] in ("optimal", "suboptimal")
    assert report.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]

"""Commands of the robot and of any machine: design, margins, modes, norms, brush and export."""

import importlib
import json
import shutil

import control
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import robustpolish as rp
from tests.app.command_line import run
from tests.app.machines import DESIGN, SPINDLE
from tests.reference.examples import servo_design


def test_design_saves_a_report_and_prints_json_alone(tmp_path):
    out = tmp_path / "results"
    arguments = ("design", "--ideal", "--duration", "0.02", "--out", str(out), "--report")
    found = json.loads(run(*arguments, "--json").stdout)
    names = {path.name for path in out.iterdir()}
    assert {"table.csv", "figure.png", "gain.csv", "design.json", "report.html"} <= names
    assert json.loads((out / "design.json").read_text()) == found
    assert found["certificate"]["valid"] is True
    assert found["status"] in ("optimal", "suboptimal")
    gain = pd.read_csv(out / "gain.csv", index_col=0)
    loop = rp.air_bearing(actuation="force").state_feedback_loop(gain.to_numpy())
    assert rp.hinf_norm(loop).value == pytest.approx(found["norm"]["closed_loop"], rel=1e-6)
    rows = {row["row"]: row for row in found["rows"]}
    assert rows["with control"]["improvement_percent"]["y"] >= 90
    page = (out / "report.html").read_text()
    assert "Effort and price" in page
    assert "certified" in page
    assert "--force" in run(*arguments, code=2).stderr


def test_design_replaces_by_force_and_prints_words(tmp_path):
    report = tmp_path / "report.html"
    report.write_text("mine")
    arguments = ("design", "--ideal", "--duration", "0.02", "--report", str(report), "--force")
    assert "every row is driven by the same disturbance" in run(*arguments).stdout
    assert "Effort and price" in report.read_text()
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


@pytest.fixture
def machine_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "machine.toml"
    path.write_text(SPINDLE + DESIGN)
    (tmp_path / "asked.toml").write_text("[design]\n")  # nothing of its own counts
    return str(path)


def test_from_a_file_to_code(machine_file, tmp_path):
    out = tmp_path / "out"
    result = run(
        "design", "--model", machine_file, "--sample-rate", "20e3", "--out", str(out), "--report",
        "--json",
    )  # fmt: skip
    found = json.loads(result.stdout)
    assert found["certificate"]["valid"]
    assert found["controls"] == ["F"]
    assert found["sampled"]["upper"] > 0
    files = {path.name for path in out.iterdir() if not path.name.startswith(".")}
    assert files == {"design.json", "plant.json", "table.csv", "figure.png", "report.html"}
    design = str(out / "design.json")
    told = run("margins", "--design", design).stdout
    assert "Margins, one loop at a time" in told
    for again in (("--model", machine_file), ("--plant", str(out / "plant.json"))):
        same = run("margins", "--design", design, *again).stdout
        assert same.splitlines()[:8] == told.splitlines()[:8]  # the margins: noise is not there
    exported = run(
        "export", "--design", design, "--period", "5e-5", "--out", str(tmp_path), "--json"
    )
    code = json.loads(exported.stdout)
    assert (tmp_path / "controller.c").exists()
    assert code["norm"]["upper"] == pytest.approx(found["sampled"]["upper"], rel=1e-6)
    refused = run("design", "--model", machine_file, "--out", str(out), code=2)
    assert "--force" in refused.stderr


def test_the_command_line_counts_more_than_the_file(machine_file):
    result = run(
        "design", "--model", machine_file, "--control", "slide", "--measure", "x",
        "--measure", "acc", "--performance", "slide", "--disturbance", "F", "--norm", "h2",
        "--method", "riccati",
        "--control-weight", "1e-6", "--noise", "x=1e-7", "--noise", "acc=1e-3", "--json",
        "--weights", "asked.toml",
    )  # fmt: skip
    found = json.loads(result.stdout)
    assert found["controls"] == ["u_slide"]
    assert found["measurements"] == ["measured_x", "measured_acc"]
    assert found["disturbances"] == ["F"]
    assert found["norm"]["kind"] == "h2"


def test_a_saved_plant_and_what_cannot_be_designed(machine_file, tmp_path):
    plant = rp.MechanicalModel.from_toml(SPINDLE).linearize(["F"])
    plant.save(tmp_path / "plant.json")
    file = str(tmp_path / "plant.json")
    text = run("design", "--plant", file, "--full-state", "--control-weight", "1e-6").stdout
    assert "a static gain, lmi" in text
    assert "missing.toml" in run("design", "--model", "missing.toml", code=2).stderr
    path = tmp_path / "loose.toml"
    loose = SPINDLE.replace("stiffness = 9.0e5", "stiffness = 0.0")
    path.write_text(loose.replace("damping = 40.0", "damping = 0.0"))
    refused = run("design", "--model", str(path), "--control", "F", "--measure", "x", code=1)
    assert "spindle" in refused.stderr


def test_bad_options(machine_file):
    for arguments, says in {
        "--control G": "controls: got 'G'",
        "--measure xx": "measurements: got 'xx'",
        "--order -1": "order",
        "--noise x=much": "--noise",
        "--noise 1e-6 --noise x=1e-6": "Name the signals",
        "--plant plant.json": "one of the two",
        "--weights none.toml": "none.toml",
        "--run 2": "one of the polishing robot",
        "--method best": "'best' is not one of",
    }.items():
        told = run("design", "--model", machine_file, *arguments.split(), code=2).stderr
        assert says in told


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder, ground = tmp_path_factory.mktemp("margins"), ("x", "ground")
    machine = rp.MechanicalModel(
        [rp.Dof("x", 2.0)], [rp.Spring(ground, 800.0)], [rp.Damper(ground, 4.0)],
        inputs=[rp.Input("F", "x")], outputs=[rp.Output("x_meas", "x")],
    )  # fmt: skip
    plant = machine.linearize().with_full_state()
    design = rp.given_controller(plant, [[-400.0, -60.0]])
    design.save(folder / "design.json")
    plant.save(folder / "plant.json")
    machine.to_toml(folder / "machine.toml")
    return folder


def test_a_saved_design_is_enough(saved):
    shown = run("margins", "--design", str(saved / "design.json")).stdout
    assert "Margins, one loop at a time" in shown
    assert "This loop" in shown
    found = json.loads(run("margins", "--design", str(saved / "design.json"), "--json").stdout)
    again = rp.loop_analysis(rp.results.Design.load(saved / "design.json"))
    assert found["delay_margin_s"] == pytest.approx(again.delay_margin)
    assert found["margins"][0]["name"] == "u_x"
    assert found["words"] == again.explain()
    assert found["buildable"] == again.buildable


def test_the_design_on_another_plant_or_machine_and_what_can_be_bought(saved):
    call = ("margins", "--design", str(saved / "design.json"), "--json")
    own = json.loads(run(*call).stdout)
    for option, file in (("--plant", "plant.json"), ("--model", "machine.toml")):
        other = json.loads(run(*call, option, str(saved / file)).stdout)
        assert other["delay_margin_s"] == pytest.approx(own["delay_margin_s"])
    slow, fast = (json.loads(run(*call, "--sample-rate", rate).stdout) for rate in ("20", "20000"))
    assert any("sampled below" in problem for problem in slow["problems"])
    assert fast["problems"] == []
    assert np.isfinite(fast["sample_rate"]["needed_hz"])


def test_pictures_and_bad_input(saved, tmp_path):
    picture = tmp_path / "loop.png"
    call = ("margins", "--design", str(saved / "design.json"))
    run(*call, "--plot", str(picture), "--kind", "bode")
    assert picture.stat().st_size > 1000
    assert "--force" in run(*call, "--plot", str(picture), code=2).stderr
    both = (*call, "--plant", str(saved / "plant.json"), "--model", str(saved / "machine.toml"))
    assert "one of the two" in run(*both, code=2).stderr
    assert "missing.json" in run("margins", "--design", "missing.json", code=2).stderr
    assert "design" in run("margins", "--design", str(saved / "plant.json"), code=2).stderr
    assert "sample_rate_hz" in run(*call, "--sample-rate", "-1", code=2).stderr


def test_modes_of_the_thesis_and_of_a_machine(tmp_path):
    found = json.loads(run("modes", "--json").stdout)["modes"]
    hertz = sorted(mode["frequency_hz"] for mode in found)
    np.testing.assert_allclose(
        hertz, [194.0691, 194.0691, 2069.58, 2069.58, 2824.58, 4610.75], rtol=2e-6
    )
    assert "194.0691" in run("modes").stdout
    assert "3361" in run("modes", "--parameters", "corrected").stdout
    path = tmp_path / "machine.toml"
    path.write_text(SPINDLE)
    found = json.loads(run("modes", "--model", str(path), "--json").stdout)["modes"]
    own = rp.modes(rp.MechanicalModel.from_toml(SPINDLE).state_space())
    assert [mode["frequency_hz"] for mode in found] == pytest.approx(
        [mode.frequency_hz for mode in own]
    )
    rp.air_bearing().save(tmp_path / "plant.json")
    assert "194.0691" in run("modes", "--plant", str(tmp_path / "plant.json")).stdout
    model = rp.MechanicalModel.from_toml(SPINDLE)
    force = {"stiffness": 1e9}
    model.with_effect("cubic_stiffness", ("slide", "ground"), force).to_toml(path)
    again = json.loads(run("modes", "--model", str(path), "--json").stdout)["modes"]
    assert again[0]["frequency_hz"] == pytest.approx(found[0]["frequency_hz"])  # flat at rest


def test_norms_of_the_thesis_and_of_a_machine(tmp_path):
    undamped = json.loads(run("norms", "--dissipation", "0", "--json").stdout)["hinf"]
    assert undamped["value"] == "inf"
    assert undamped["reason"]
    found = json.loads(run("norms", "--dissipation", "0.01", "--json").stdout)
    assert found["hinf"]["value"] == pytest.approx(0.00211825, abs=5e-9)
    assert found["h2"]["value"] == pytest.approx(0.00294744, abs=5e-9)
    target = tmp_path / "norms.json"
    assert "0.02118" in run("norms", "--json", str(target)).stdout
    saved = json.loads(target.read_text())
    assert saved["hinf"]["frequency_hz"] == pytest.approx(194.069, abs=1e-3)
    assert "--force" in run("norms", "--json", str(target), code=2).stderr
    path = tmp_path / "machine.toml"
    path.write_text(SPINDLE)
    chosen = ("--disturbance", "F", "--performance", "x")
    found = json.loads(run("norms", "--model", str(path), *chosen, "--json").stdout)
    system = rp.MechanicalModel.from_toml(SPINDLE).state_space()[0, 1]
    assert found["hinf"]["value"] == pytest.approx(float(rp.hinf_norm(system)))
    assert found["h2"]["value"] == pytest.approx(float(rp.h2_norm(system)))
    assert found["unit"]["hinf"] == "m/N"
    assert "from F_cut, F to slide, spindle" in run("norms", "--model", str(path)).stdout
    rp.air_bearing().save(tmp_path / "plant.json")
    own = json.loads(run("norms", "--json").stdout)
    again = json.loads(run("norms", "--plant", str(tmp_path / "plant.json"), "--json").stdout)
    assert again["hinf"] == own["hinf"]
    assert (
        "Write slide" in run("norms", "--model", str(path), "--performance", "slid", code=2).stderr
    )


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


def test_brush_on_a_mould_along_a_path(tmp_path):
    side = np.linspace(-30.0, 30.0, 31)
    grid = np.add.outer(side**2 / 100, side**2 / 160)
    lines = [["x", *side], *([x, *row] for x, row in zip(side, grid, strict=True))]
    mould, path = tmp_path / "mould.csv", tmp_path / "path.csv"
    mould.write_text("\n".join(",".join(map(str, line)) for line in lines))
    path.write_text("x,y\n-10,0\n10,0\n")
    files = ("--mould", str(mould), "--path", str(path))
    result = run("brush", "--duration", "0.02", *files, "--speed", "0.04", "--json")
    assert 5 < json.loads(result.stdout)["forces"]["F_z"]["largest"] < 50
    result = run("brush", "--duration", "0.02", *files, code=2)
    assert "speed" in result.stderr


@pytest.fixture
def servo(tmp_path):
    path = tmp_path / "design.json"
    servo_design().save(path)
    return str(path)


def test_a_saved_design_becomes_code(servo, tmp_path):
    kinds = ["--to", "c", "--to", "mat", "--to", "json"]
    if shutil.which("cc"):
        kinds += ["--to", "fmu"]
    result = run(
        "export", "--design", servo, "--period", "0.05", "--delay", "0.02", "--order", "3",
        "--form", "modal", "--limit", "F=-1:2", "--name", "servo", *kinds, "--test-vectors", "10",
        "--out", str(tmp_path), "--json",
    )  # fmt: skip
    found = json.loads(result.stdout)
    assert found["states"] == 3
    assert 0 < found["norm"]["lower"] <= found["norm"]["upper"]
    for suffix in (".c", ".mat", ".json", "_vectors.csv"):
        assert (tmp_path / f"servo{suffix}").exists()
    assert "static const double servo_high[1] = {2.0}" in (tmp_path / "servo.c").read_text()
    assert "Reduced from 4 to 3" in found["messages"][0]
    again = run(
        "export", "--design", servo, "--period", "0.05", "--name", "servo", "--out", str(tmp_path),
        code=2,
    )  # fmt: skip
    assert "--force" in again.stderr


def test_too_slow_a_period_and_wrong_options_are_refused(servo, tmp_path):
    result = run("export", "--design", servo, "--period", "2.0", "--out", str(tmp_path), code=1)
    assert "longest period" in result.stderr
    assert not (tmp_path / "controller.c").exists()
    base = ["export", "--design", servo, "--out", str(tmp_path), "--period"]
    assert "limit" in run(*base, "0.05", "--limit", "F", code=2).stderr
    assert "limits.G" in run(*base, "0.05", "--limit", "G=1", code=2).stderr
    assert "period" in run(*base, "-1", code=2).stderr
    assert "path" in run("export", "--design", "none.json", "--period", "1", code=2).stderr

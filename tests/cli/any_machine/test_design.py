"""`robustpolish design --model`: from a file to a folder that margins and export read."""

import json

import pytest

import robustpolish as rp
from tests.cli.command_line import run
from tests.machine_design.machines import DESIGN, SPINDLE


@pytest.fixture
def machine(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(SPINDLE + DESIGN)
    return str(path)


def test_from_a_file_to_code(machine, tmp_path):
    out = tmp_path / "out"
    result = run(
        "design", "--model", machine, "--sample-rate", "20e3", "--out", str(out), "--report",
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
    for again in (("--model", machine), ("--plant", str(out / "plant.json"))):
        same = run("margins", "--design", design, *again).stdout
        assert same.splitlines()[:8] == told.splitlines()[:8]  # the margins: noise is not there
    exported = run(
        "export", "--design", design, "--period", "5e-5", "--out", str(tmp_path), "--json"
    )
    code = json.loads(exported.stdout)
    assert (tmp_path / "controller.c").exists()
    assert code["norm"]["upper"] == pytest.approx(found["sampled"]["upper"], rel=1e-6)
    refused = run("design", "--model", machine, "--out", str(out), code=2)
    assert "--force" in refused.stderr


def test_the_command_line_counts_more_than_the_file(machine):
    result = run(
        "design", "--model", machine, "--control", "slide", "--measure", "x", "--measure", "acc",
        "--performance", "slide", "--disturbance", "F", "--norm", "h2", "--method", "riccati",
        "--control-weight", "1e-6", "--noise", "x=1e-7", "--noise", "acc=1e-3", "--json",
        "--weights", _section(machine),
    )  # fmt: skip
    found = json.loads(result.stdout)
    assert found["controls"] == ["u_slide"]
    assert found["measurements"] == ["measured_x", "measured_acc"]
    assert found["disturbances"] == ["F"]
    assert found["norm"]["kind"] == "h2"


def test_a_saved_plant(machine, tmp_path):
    plant = rp.MechanicalModel.from_toml(SPINDLE).linearize(["F"])
    plant.save(tmp_path / "plant.json")
    text = run(
        "design",
        "--plant",
        str(tmp_path / "plant.json"),
        "--full-state",
        "--control-weight",
        "1e-6",
    ).stdout
    assert "a static gain, lmi" in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--control", "G"], "controls: got 'G'"),
        (["--measure", "xx"], "measurements: got 'xx'"),
        (["--order", "-1"], "order"),
        (["--noise", "x=much"], "--noise"),
        (["--noise", "1e-6", "--noise", "x=1e-6"], "Name the signals"),
        (["--plant", "plant.json"], "one of the two"),
        (["--weights", "none.toml"], "none.toml"),
        (["--run", "2"], "one of the polishing robot"),
        (["--method", "best"], "'best' is not one of"),
    ],
)
def test_bad_options(machine, arguments, says):
    assert says in run("design", "--model", machine, *arguments, code=2).stderr


def test_what_cannot_be_designed(machine, tmp_path):
    assert "missing.toml" in run("design", "--model", "missing.toml", code=2).stderr
    path = tmp_path / "loose.toml"
    loose = SPINDLE.replace("stiffness = 9.0e5", "stiffness = 0.0")
    path.write_text(loose.replace("damping = 40.0", "damping = 0.0"))
    refused = run("design", "--model", str(path), "--control", "F", "--measure", "x", code=1)
    assert "spindle" in refused.stderr


def _section(machine):
    """Write an empty section beside a machine, so that nothing of its own counts."""
    path = machine.replace("machine.toml", "asked.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write("[design]\n")
    return path

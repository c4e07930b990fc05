"""A disk that takes nothing more: one line, an exit code, and the folder as it was."""

import resource
import shutil
import subprocess
import sys
from contextlib import contextmanager

import pytest
from click.testing import CliRunner

import robustpolish as rp
from robustpolish.app.cli.main import main
from tests.app.test_learn_commands import CSV, MODEL

MACHINE = (
    MODEL
    + """
[design]
controls = ["F"]

[weights]
performance = { low = 10.0, crossover_hz = 3.0, high = 0.5 }
effort = 1e-5
"""
)
COMMANDS = {
    "norms": "norms --model machine.toml --json out.json",
    "margins": "margins --design design.json --plot picture.png",
    "export c": "export --design design.json --period 0.01 --test-vectors 20",
    "export others": "export --design design.json --period 0.01 --to mat --to json",
    "brush netcdf": "brush --duration 0.002 --out forces.nc",
    "refit": "refit data.csv --model model.toml --save fitted.toml",
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    (folder / "data.csv").write_text(CSV)
    (folder / "model.toml").write_text(MODEL)
    (folder / "machine.toml").write_text(MACHINE)
    other = rp.MechanicalModel.from_toml(folder / "model.toml")
    other.with_effect("cubic_stiffness", ("x", "ground"), {"stiffness": 2e4}).to_toml(
        folder / "other.toml"
    )
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    rp.given_controller(plant, [[-3.0]]).save(folder / "design.json")
    return folder


@contextmanager
def no_room(size):
    """Let no file grow beyond a size, as a full disk would."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def names(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def refused_with_one_line(result, told="not written"):
    assert not result.exception or isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == 1, result.output
    (line,) = [line for line in result.stderr.splitlines() if not line.startswith(("...", "Simul"))]
    assert line.startswith("Error: ")
    assert told in line
    return line


def check_full(name, files, folder, monkeypatch, size):
    shutil.copytree(files, folder, dirs_exist_ok=True)
    monkeypatch.chdir(folder)
    before = names(folder)
    with no_room(size):
        result = CliRunner().invoke(main, COMMANDS[name].split())
    assert "File too large" in refused_with_one_line(result)
    assert names(folder) == before


@pytest.mark.parametrize("name", COMMANDS)
def test_nothing_is_half_written(name, files, tmp_path, monkeypatch):
    check_full(name, files, tmp_path, monkeypatch, 64)


def test_names_that_no_file_can_have(files, monkeypatch):
    monkeypatch.chdir(files)
    arguments = ["norms", "--model", "machine.toml", "--json", "a" * 300]
    line = refused_with_one_line(CliRunner().invoke(main, arguments))
    assert "File name too long" in line
    with pytest.raises(rp.InvalidInputError, match="NUL"):
        rp.load("design.json").save("a\0b.json")


@pytest.mark.skipif(sys.platform != "linux", reason="/dev/full is a device of Linux")
@pytest.mark.parametrize(
    "arguments",
    [["--help"], pytest.param(["norms", "--model", "machine.toml"], marks=pytest.mark.long)],
)
def test_a_full_disk_behind_the_output(arguments, files):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "robustpolish", *arguments],
            cwd=files, stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.startswith("Error: output: not written (No space left on device)")
    assert len(done.stderr.splitlines()) == 1

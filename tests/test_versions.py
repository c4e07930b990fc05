"""The version is one, and people can name it."""

import subprocess
import sys
import tomllib
from pathlib import Path

from click.shell_completion import BashComplete

import robustpolish as rp
from robustpolish.app.cli.main import main

ROOT = Path(__file__).resolve().parents[1]


def test_package_and_project_agree():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert rp.__version__ == project["version"]


def test_versions_name_what_a_report_needs(capsys):
    rp.show_versions()
    shown = dict(
        line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[1:] if " " in line
    )
    assert shown["robustpolish"] == rp.__version__
    assert shown["Python"].startswith(f"{sys.version_info.major}.{sys.version_info.minor}")
    for name in ("numpy", "scipy", "control", "cvxpy", "xarray", "matplotlib"):
        assert shown[name][0].isdigit()


def test_the_module_runs_as_a_command():
    command = [sys.executable, "-m", "robustpolish", "--version"]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert told.stdout.strip() == f"robustpolish, version {rp.__version__}"


def test_the_shell_completes_commands_and_options():
    complete = BashComplete(main, {}, "robustpolish", "_robustpolish_COMPLETE")
    assert {"design", "diagnose"} == {c.value for c in complete.get_completions([], "d")}
    assert "--report" in {c.value for c in complete.get_completions(["design"], "--r")}
    found = complete.get_completions(["design", "--norm"], "")
    assert {c.value for c in found} == {"hinf", "h2"}

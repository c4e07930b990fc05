"""`robustpolish export`: from a saved design to files."""

import json
import shutil

import pytest

from tests.cli.command_line import run
from tests.implementation.designs import servo_design


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "design.json"
    servo_design().save(path)
    return str(path)


def test_a_saved_design_becomes_code(saved, tmp_path):
    kinds = ["--to", "c", "--to", "mat", "--to", "json"]
    if shutil.which("cc"):
        kinds += ["--to", "fmu"]
    result = run(
        "export", "--design", saved, "--period", "0.05", "--delay", "0.02", "--order", "3",
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
        "export", "--design", saved, "--period", "0.05", "--name", "servo", "--out", str(tmp_path),
        code=2,
    )  # fmt: skip
    assert "--force" in again.stderr


def test_too_slow_a_period_says_how_fast(saved, tmp_path):
    result = run("export", "--design", saved, "--period", "2.0", "--out", str(tmp_path), code=1)
    assert "longest period" in result.stderr
    assert not (tmp_path / "controller.c").exists()


def test_wrong_options_are_refused(saved, tmp_path):
    base = ["export", "--design", saved, "--out", str(tmp_path), "--period"]
    assert "limit" in run(*base, "0.05", "--limit", "F", code=2).stderr
    assert "limits.G" in run(*base, "0.05", "--limit", "G=1", code=2).stderr
    assert "period" in run(*base, "-1", code=2).stderr
    assert "path" in run("export", "--design", "none.json", "--period", "1", code=2).stderr

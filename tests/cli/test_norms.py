"""`robustpolish norms`: the norms of the thesis, and infinite ones."""

import json

import pytest

from tests.cli.command_line import run


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

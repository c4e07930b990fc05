"""A place that is taken is refused before anything is read or computed, by every command."""

import pytest

from tests.cli.command_line import run

MISSING = "missing.json"
COMMANDS = {
    "brush": ("brush",),
    "compare": ("compare", "missing.csv", "--model", "missing.toml"),
    "design": ("design",),
    "design, any machine": ("design", "--model", "missing.toml"),
    "diagnose": ("diagnose", "missing.csv", "--model", "missing.toml"),
    "export": ("export", "--design", MISSING, "--period", "1e-3"),
    "margins": ("margins", "--design", MISSING),
    "modes": ("modes",),
    "modes, any machine": ("modes", "--model", "missing.toml"),
    "norms": ("norms",),
    "norms, any machine": ("norms", "--model", "missing.toml"),
    "refit": ("refit", "missing.csv", "--model", "missing.toml"),
    "tell-apart": ("tell-apart", "missing.csv", MISSING),
}


@pytest.fixture(autouse=True)
def nothing_is_computed(monkeypatch, tmp_path):
    def computed(*_, **__):
        raise AssertionError("it was computed first")

    for what in ("cli.brush.simulate_brush", "cli.design.design_against_brush"):
        monkeypatch.setattr(f"robustpolish.{what}", computed)
    for what in ("cli.modes.air_bearing", "cli.norms.air_bearing"):
        monkeypatch.setattr(f"robustpolish.{what}", computed)
    monkeypatch.chdir(tmp_path)


def refused(*arguments):
    told = run(*arguments, code=2).stderr
    assert "--force" in told
    assert "missing" not in told


@pytest.mark.parametrize("name", COMMANDS)
def test_json(name, tmp_path):
    # Not .json, which commands on measurements replace without being told to.
    (tmp_path / "taken.txt").write_text("mine")
    refused(*COMMANDS[name], "--json", "taken.txt")
    assert (tmp_path / "taken.txt").read_text() == "mine"


@pytest.mark.parametrize("name", ["compare", "margins", "tell-apart"])
def test_pictures(name, tmp_path):
    (tmp_path / "taken.png").write_text("mine")
    refused(*COMMANDS[name], "--plot", "taken.png")


@pytest.mark.parametrize("taken", ["controller.c", "controller_vectors.csv"])
def test_code(taken, tmp_path):
    (tmp_path / taken).write_text("mine")
    refused(*COMMANDS["export"], "--out", ".", "--test-vectors", "10")

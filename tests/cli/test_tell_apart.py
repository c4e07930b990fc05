"""`robustpolish tell-apart`: what it prints and writes, and bad input."""

import json
from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.diagnosis.findings import IndistinguishablePair
from robustpolish.machines.effects.effect import Effect
from tests import made_up
from tests.cli.command_line import run
from tests.identification.oscillators import PLACE, oscillator, record

CUBIC = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": 2e4})


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = record(1500, noise=0.01)
    columns = zip(*(data[name].values for name in ("time", "F", "x")), strict=True)
    lines = [",".join(repr(float(value)) for value in row) for row in columns]
    (tmp_path / "data.csv").write_text("\n".join(["time [s],F [N],x [m]", *lines]) + "\n")
    CUBIC.to_toml(tmp_path / "cubic.toml")
    oscillator().to_toml(tmp_path / "plain.toml")
    return tmp_path


def test_two_models_are_told_apart(folder):
    shown = run("tell-apart", "data.csv", "cubic.toml", "plain.toml", "--no-fit", "--json",
                "out.json", "--plot", "told.png", "--noise", "x=1e-4")  # fmt: skip
    assert "To tell cubic_stiffness at x, ground from " in shown.stdout
    assert "\n  make " in shown.stdout
    assert "... simulating 20 experiments" in shown.stderr
    content = json.loads((folder / "out.json").read_text())
    assert content["told_apart"] is True
    assert content["noise"] == {"x": 1e-4}
    ratios = [e["left_over_noise"] for e in content["experiments"]]
    assert ratios == sorted(ratios, reverse=True)
    best = content["experiments"][0]
    assert best["left"]["x"] / 1e-4 == pytest.approx(best["left_over_noise"])
    assert (folder / "told.png").stat().st_size > 10_000


def test_a_diagnosis_brings_its_pairs(folder):
    drag = Effect("quadratic_damping", PLACE, {"coefficient": 0.5})
    pair = IndistinguishablePair(CUBIC.effects[0], drag, "Repeat.")
    found = replace(made_up.diagnosis(), model=CUBIC, indistinguishable=(pair,))
    found.save(folder / "found.json")
    shown = run("tell-apart", "data.csv", "found.json", "--no-fit", "--limit", "F=5")
    assert "quadratic_damping at x, ground:" in shown.stdout.splitlines()[0]
    refused = run("tell-apart", "data.csv", "found.json", "--pair", "2", code=2)
    assert "pair" in refused.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("cubic.toml",), "two models"),
        (("cubic.toml", "plain.toml", "plain.toml"), "two models"),
        (("cubic.toml", "plain.toml", "--noise", "x"), "NAME=SIZE"),
        (("cubic.toml", "plain.toml", "--noise", "x=much"), "SI units"),
        (("cubic.toml", "plain.toml", "--limit", "G=3"), "one of F, x"),
        (("cubic.toml", "plain.toml", "--plot", "told.doc"), "told.doc"),
    ],
)
def test_bad_input_ends_with_code_2(arguments, message, folder):
    before = set(folder.iterdir())
    assert message in run("tell-apart", "data.csv", *arguments, "--no-fit", code=2).stderr
    assert set(folder.iterdir()) == before


def test_frequency_responses_do_not_tell(folder):
    lines = np.geomspace(1, 10, 30)
    curve = oscillator().frequency_response(lines).values[:, 0, 0]
    rows = [
        f"{f!r},{h.real!r},{h.imag!r}" for f, h in zip(lines.tolist(), curve.tolist(), strict=True)
    ]
    head = "frequency [Hz],x/F real [m/N],x/F imag [m/N]"
    (folder / "response.csv").write_text("\n".join([head, *rows]) + "\n")
    for command in (
        ("tell-apart", "response.csv", "cubic.toml", "plain.toml"),
        ("diagnose", "response.csv", "--model", "plain.toml"),
    ):
        told = run(*command, code=2).stderr
        assert "signals over time" in told
        assert "compare" in told
        assert "refit take frequency responses" in told

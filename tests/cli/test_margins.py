"""`robustpolish margins`: a saved design is enough; another plant or machine may be named."""

import json

import numpy as np
import pytest

import robustpolish as rp
from tests.cli.command_line import run


def machine():
    return rp.MechanicalModel(
        [rp.Dof("x", 2.0)],
        [rp.Spring(("x", "ground"), 800.0)],
        [rp.Damper(("x", "ground"), 4.0)],
        inputs=[rp.Input("F", "x")],
        outputs=[rp.Output("x_meas", "x")],
    )


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("margins")
    plant = machine().linearize().with_full_state()
    design = rp.given_controller(plant, [[-400.0, -60.0]])
    design.save(folder / "design.json")
    plant.save(folder / "plant.json")
    machine().to_toml(folder / "machine.toml")
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


def test_the_design_on_another_plant_or_machine(saved):
    own = run("margins", "--design", str(saved / "design.json"), "--json").stdout
    for option, file in (("--plant", "plant.json"), ("--model", "machine.toml")):
        other = run(
            "margins", "--design", str(saved / "design.json"), option, str(saved / file), "--json"
        ).stdout
        delays = [json.loads(text)["delay_margin_s"] for text in (own, other)]
        assert delays[0] == pytest.approx(delays[1])


def test_what_can_be_bought_changes_the_verdict(saved):
    call = ("margins", "--design", str(saved / "design.json"), "--json", "--sample-rate")
    slow, fast = (json.loads(run(*call, rate).stdout) for rate in ("20", "20000"))
    assert any("sampling" in problem for problem in slow["problems"])
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

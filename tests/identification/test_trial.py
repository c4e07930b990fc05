"""Effects that are added and removed by hand."""

import json

import pytest
from click.testing import CliRunner

import robustpolish as rp
from robustpolish.app.cli.main import main

AT = ("x", "ground")


@pytest.fixture(scope="module")
def slide():
    model, data = rp.datasets.sticky_slide()
    return model, data.isel(time=slice(0, 500))


@pytest.fixture(scope="module")
def right(slide):
    return rp.try_effect(*slide, "coulomb_friction", AT)


def test_the_right_effect_is_worth_its_numbers(slide, right):
    assert right.worthwhile
    force = right.effect.parameters["force"]
    assert force.value == pytest.approx(3.0, abs=4 * force.stderr)
    base, refit, last = (entry.nrmse["x"] for entry in right.ledger.entries)
    assert last < 0.1 * refit < base


def test_a_wrong_effect_gains_nothing_and_stays_in_the_ledger(slide, right):
    wrong = rp.try_effect(*slide, "cubic_stiffness", AT)
    assert not wrong.worthwhile
    again = rp.try_effect(wrong, slide[1], "cubic_stiffness", AT, remove=True)
    assert again.model.effects == ()
    assert [e.step for e in again.ledger.entries] == [
        "base", "refit", "cubic_stiffness at x, ground", "without cubic_stiffness at x, ground",
    ]  # fmt: skip
    assert "not worth its numbers" in repr(wrong)


def test_the_steps_of_a_diagnosis_are_taken_one_by_one(slide):
    model, data = slide
    found = rp.diagnose(model, data)
    wrong = found.candidates[-1]
    taken = rp.try_effect(rp.try_effect(model, data, wrong), data, wrong, remove=True)
    for effect in found.effects:
        taken = rp.try_effect(taken, data, effect)
    assert taken.worthwhile
    assert taken.model.parameters == pytest.approx(found.model.parameters, rel=0.02)
    with pytest.raises(rp.InvalidInputError, match="at: got nothing"):
        rp.try_effect(model, data, "coulomb_friction")


def test_an_effect_that_is_not_there_cannot_be_removed(slide):
    with pytest.raises(rp.InvalidInputError, match="no effect"):
        rp.try_effect(*slide, "coulomb_friction", AT, remove=True)


def test_an_effect_is_tried_from_the_command_line(slide, tmp_path):
    model, data = slide
    (tmp_path / "slide.toml").write_text(model.to_toml())
    data.to_dataframe().to_csv(tmp_path / "run.csv")
    file, steps = str(tmp_path / "run.csv"), str(tmp_path / "steps.json")

    def tried(*options):
        given = ["try", file, *options, "--ledger", steps]
        result = CliRunner().invoke(main, given)
        assert result.exit_code == 0, result.output
        return result.output

    toml, learned = str(tmp_path / "slide.toml"), str(tmp_path / "learned.toml")
    assert "not worth" in tried("--model", toml, "--add", "cubic_stiffness x ground")
    picture = str(tmp_path / "falls.png")
    said = tried(
        "--model", toml, "--add", "coulomb_friction x ground", "--save", learned,
        "--plot", picture, "--json", str(tmp_path / "said.json"),
    )  # fmt: skip
    assert "worth its numbers" in said
    assert "cubic_stiffness" in said
    assert json.loads((tmp_path / "said.json").read_text())["worthwhile"]
    assert rp.load(learned).effects[0].kind == "coulomb_friction"
    assert (tmp_path / "falls.png").stat().st_size > 1000
    tried("--model", learned, "--remove", "coulomb_friction x ground")
    assert len(json.loads((tmp_path / "steps.json").read_text())["ledger"]) == 5


def test_a_change_without_a_place_is_refused(slide, tmp_path):
    (tmp_path / "slide.toml").write_text(slide[0].to_toml())
    slide[1].to_dataframe().to_csv(tmp_path / "run.csv")
    given = ["try", str(tmp_path / "run.csv"), "--model", str(tmp_path / "slide.toml")]
    result = CliRunner().invoke(main, [*given, "--add", "coulomb_friction"])
    assert result.exit_code == 2
    assert "--add" in result.output


def test_the_air_bearing_is_a_model_by_name(tmp_path):
    written = tmp_path / "bearing.toml"
    result = CliRunner().invoke(main, ["model", "air-bearing:as-printed", "--out", str(written)])
    assert result.exit_code == 0, result.output
    bearing = rp.polishing.air_bearing_model(rp.polishing.AirBearingParameters.as_printed())
    assert rp.load(written).parameters == pytest.approx(bearing.parameters)
    assert {d.name: d.axis for d in rp.load(written).dofs} == {d.name: d.axis for d in bearing.dofs}
    shown = CliRunner().invoke(main, ["model", "air-bearing"])
    assert rp.MechanicalModel.from_toml(shown.output).free == bearing.free
    refused = CliRunner().invoke(main, ["model", "air-bearing:as-built"])
    assert refused.exit_code == 2
    assert "air-bearing:as-published" in refused.output


def test_a_kind_of_ones_own_is_removed_by_its_formula(slide):
    own = rp.effect("f = -b*v**3", parameters={"b": "N s^3/m^3"})
    wrong = rp.try_effect(*slide, own, AT)
    again = rp.try_effect(wrong, slide[1], own, AT, remove=True)
    assert again.model.effects == ()

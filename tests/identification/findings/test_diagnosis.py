from dataclasses import replace

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.saved import read_saved
from robustpolish.errors import InvalidInputError
from robustpolish.identification.diagnosis.result import diagnosis_from
from robustpolish.machines.mechanical.parts import Dof
from tests import made_up


def test_it_shows_what_was_found_and_how_the_error_fell():
    shown = repr(made_up.diagnosis())
    rows = [line.split() for line in shown.splitlines()]
    assert shown.startswith("The model lacked: Coulomb friction at x, ground.")
    assert ["coulomb_friction", "x,", "ground", "force", "3.100", "0.020", "N"] in rows
    assert ["refit", "0.31"] in rows
    assert "The effects explain 99 % of the error above the noise." in shown
    assert "Added effects" not in repr(replace(made_up.diagnosis(), effects=()))


def test_it_draws_how_the_error_fell():
    assert made_up.diagnosis().plot(output="x").get_ylabel() == "relative error of x"
    with pytest.raises(InvalidInputError, match="output"):
        made_up.diagnosis().plot(output="F")


def test_it_draws_what_is_still_missing_over_time():
    found = made_up.diagnosis()
    ax = found.plot_missing_force()
    (line,) = ax.lines
    np.testing.assert_allclose(np.asarray(line.get_ydata()), found.missing_force[0])
    assert "N]" in ax.get_ylabel()
    turning = replace(found.model, dofs=(Dof("x", 2.0, rotational=True),))
    assert "N m]" in replace(found, model=turning).plot_missing_force().get_ylabel()


def test_an_existing_file_is_not_replaced_unasked(tmp_path):
    found, path = made_up.diagnosis(), tmp_path / "slide.json"
    found.save(path)
    with pytest.raises(InvalidInputError, match="exist"):
        found.save(path)
    replace(found, verdict="unexplained").save(path, force=True)
    assert rp.results.Diagnosis.load(path).verdict == "unexplained"


def test_what_is_loaded_can_do_all_that_a_diagnosis_can(tmp_path):
    found = made_up.diagnosis()
    found.save(tmp_path / "slide.json")
    again = diagnosis_from(read_saved(tmp_path / "slide.json", "diagnosis"))
    assert isinstance(again, rp.results.Diagnosis)
    assert again.explain() == found.explain()
    assert again.to_dict() == found.to_dict()
    assert repr(again) == repr(found)

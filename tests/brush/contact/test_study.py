"""Why the thesis's forces were too large: the table that code makes."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError


@pytest.fixture(scope="module")
def study():
    return rp.polishing.force_study()


def test_the_interpolation_of_d2_is_worth_a_factor_of_the_spacing(study):
    """States weighted 1/S too much: 1e5 for 1e-5 s, as the errors of reading find."""
    factor = float(study.table["factor"].sel(row="as D.2 applies it"))
    assert factor == pytest.approx(1e5, rel=0.3)


def test_the_duration_is_in_the_force(study):
    """Force m v / t_m: a tenth and a hundredth of it at 10 and 100 times the duration."""
    for times in (10, 100):
        factor = float(study.table["factor"].sel(row=f"t_m {times} times as long"))
        assert factor == pytest.approx(1 / times, rel=0.1)


def test_geometry_and_friction_are_not_to_blame(study):
    answer = study.answer()
    assert max(answer["geometry"], answer["friction"]) < 3
    assert answer["duration"] > 50
    assert answer["code"] > 1e5
    assert next(iter(answer)) == "code"


def test_base_row_is_the_listing(study):
    signals = rp.simulate_brush("listing", 1, 0.1)
    beyond = np.stack([signals.F_x, signals.F_y, signals.F_z - signals.F_p])
    assert float(study.table["peak"][0]) == pytest.approx(np.linalg.norm(beyond, axis=0).max())


def test_well_posed_contact_stays_near_the_polishing_force(study):
    for start in ("pressed", "landing"):
        row = study.table.sel(row=f"physical, {start}")
        assert float(row["peak"]) < 1.5 * 10.0
        assert float(row["impulse"]) < 1.0


def test_it_shows_itself(study):
    assert "times the base" in repr(study)
    assert study.plot().get_xscale() == "log"


def test_bad_arguments_are_named():
    with pytest.raises(InvalidInputError, match="suspects"):
        rp.polishing.force_study(suspects=("weather",))
    with pytest.raises(InvalidInputError, match="duration"):
        rp.polishing.force_study(duration=0.0)

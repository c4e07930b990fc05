"""Parameters of the brush, against table 9.1."""

from dataclasses import fields, replace

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.parameters import RUN_STIFFNESS, BrushParameters
from robustpolish.polishing.surfaces.surface import Surface


def test_every_field_tells_its_unit_and_source() -> None:
    for item in fields(BrushParameters):
        assert set(item.metadata) == {"unit", "source"}
        assert item.metadata["source"]


def test_derived_values() -> None:
    brush = BrushParameters()
    assert brush.rim_distance == pytest.approx(0.01118, abs=5e-6)
    assert brush.spin_inertia == pytest.approx(1.0e-5)
    assert brush.tilt_inertia == pytest.approx(6.67e-6, rel=1e-3)
    assert brush.impact_duration == pytest.approx(np.pi / 2 * np.sqrt(0.2 / 1e4))


def test_runs_are_table_9_2() -> None:
    assert dict(RUN_STIFFNESS) == {1: 1e4, 2: 1e6, 3: 1e8, 4: 1e10}
    for run, stiffness in RUN_STIFFNESS.items():
        assert BrushParameters.for_run(run).contact_stiffness == stiffness
    assert BrushParameters.as_published(2).surface == Surface.as_published()
    with pytest.raises(InvalidInputError, match="run"):
        BrushParameters.for_run(5)


@pytest.mark.parametrize(
    ("name", "value"),
    [("mass", -0.2), ("radius", 0.0), ("friction", np.nan), ("spin", np.inf), ("surface", 5.0)],
)
def test_bad_values_are_named(name: str, value: float) -> None:
    with pytest.raises(InvalidInputError, match=name):
        replace(BrushParameters(), **{name: value})

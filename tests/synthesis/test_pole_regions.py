"""Pole regions: the matrix description says the same as the geometry."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, PoleRegion, Sector

POLES = np.random.default_rng(0).normal(size=200) * 5 + 3j * np.random.default_rng(1).normal(
    size=200
)


def geometry(region, s):
    if isinstance(region, HalfPlane):
        return s.real < region.max_real
    if isinstance(region, Disk):
        return abs(s - region.center) < region.radius
    seen = s - region.apex
    return seen.real < 0 and -seen.real / abs(seen) > region.damping


@pytest.mark.parametrize("region", [HalfPlane(-1.0), Disk(-4.0, 3.5), Sector(0.6), Sector(0.3, -1)])
def test_matrix_form_matches_geometry(region):
    assert isinstance(region, PoleRegion)
    for s in POLES:
        assert region.contains(s) == geometry(region, s)
    scaled = region.in_unit_of_time(0.01)
    assert all(scaled.contains(0.01 * s) == region.contains(s) for s in POLES)


@pytest.mark.parametrize(
    ("make", "argument"),
    [
        (lambda: HalfPlane(np.nan), "max_real"),
        (lambda: Disk(0.0, -1.0), "radius"),
        (lambda: Disk("a", 1.0), "center"),
        (lambda: Sector(1.5), "damping"),
        (lambda: Sector(0.0), "damping"),
        (lambda: Sector(0.5, np.inf), "apex"),
    ],
)
def test_bad_regions_are_refused(make, argument):
    with pytest.raises(rp.InvalidInputError, match=rf"^{argument}: got"):
        make()

"""Pole regions: the matrix description says the same as the geometry."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.pole_regions import (
    Disk,
    HalfPlane,
    PoleRegion,
    Sector,
    boundaries,
    violated_regions,
)

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
        (lambda: Disk("a", 1.0), "center"),  # pyright: ignore[reportArgumentType]
        (lambda: Sector(1.5), "damping"),
        (lambda: Sector(0.0), "damping"),
        (lambda: Sector(0.5, np.inf), "apex"),
    ],
)
def test_bad_regions_are_refused(make, argument):
    with pytest.raises(rp.InvalidInputError, match=rf"^{argument}: got"):
        make()


def test_a_tolerance_counts_relative_to_the_size_of_the_terms():
    region = Disk(-1000.0, 900.0)
    assert not region.contains(-99.9)
    assert region.contains(-99.9, tolerance=1e-3)
    assert not region.contains(-50.0, tolerance=1e-3)
    assert region.contains([])


def test_regions_that_are_missed_are_named():
    regions = HalfPlane(-1.0), Disk(-4.0, 2.0)
    assert violated_regions(regions, [-3.0, -5.0]) == []
    assert violated_regions(regions, [-1.5]) == [
        "a pole lies outside Disk(center=-4.0, radius=2.0)"
    ]
    assert len(violated_regions(regions, [0.0])) == 2
    drawn = boundaries(regions)
    assert list(drawn) == [f"outside {region}" for region in regions]
    for region, (L, M) in zip(regions, drawn.values(), strict=True):
        np.testing.assert_array_equal(L, region.L)
        np.testing.assert_array_equal(M, region.M)

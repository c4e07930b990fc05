"""Pole regions: the matrix description says the same as the geometry."""

import dataclasses

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.problem.pole_regions import (
    Disk,
    HalfPlane,
    PassiveElement,
    PoleRegion,
    Sector,
    boundaries,
    checked_regions,
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


def test_one_region_several_or_none():
    one, other = HalfPlane(-1.0), Sector(0.5)
    assert checked_regions("pole_region", None) == ()
    assert checked_regions("pole_region", one) == (one,)
    assert checked_regions("pole_region", [one, other]) == (one, other)
    with pytest.raises(rp.InvalidInputError, match=r"^pole_region: got float, expected HalfPlane"):
        checked_regions("pole_region", [one, -3.0])  # pyright: ignore[reportArgumentType]


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


@pytest.mark.parametrize(
    ("element", "text"),
    [
        (PassiveElement("spring", ("x", "ground"), 8e4, "N/m"), "x and ground: 80000 N/m"),
        (PassiveElement("damper", ("x", "y"), 1 / 3, "N s/m"), "x and y: 0.333333 N s/m"),
        (PassiveElement("spring", ("p", "q"), 1.5e9, "N m/rad"), "p and q: 1.5e+09 N m/rad"),
    ],
)
def test_an_element_in_words(element, text):
    assert str(element) == f"{element.kind} between {text}"


def test_elements_are_compared_by_value_and_do_not_change():
    one, other = (rp.results.PassiveElement("damper", ("x", "y"), 5.0, "N s/m") for _ in range(2))
    assert one == other
    assert one != dataclasses.replace(one, coefficient=6.0)
    assert len({one, other}) == 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        one.coefficient = 6.0  # pyright: ignore[reportAttributeAccessIssue]

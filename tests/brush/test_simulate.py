"""The one interface: contents, options, complaints."""

import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.surfaces.surface import Surface
from robustpolish.polishing.thesis.listing import ListingDefects

SHARED = {
    "theta", "psi", "theta_rate", "psi_rate", "F_x", "F_y", "F_z", "F_p", "contact",
    "tool_x", "tool_y", "surface_height", "elevation",
}  # fmt: skip


@pytest.mark.parametrize("simulator", ["physical", "listing"])
def test_both_simulators_share_names_and_units(simulator: str) -> None:
    signals = simulate_brush(simulator, run=2, duration=0.005)
    assert set(signals.data_vars) >= SHARED
    assert signals.time.attrs["units"] == "s"
    assert all("units" in signals[name].attrs for name in signals.data_vars)
    assert {signals[name].attrs["units"] for name in ("F_x", "F_y", "F_z", "F_p")} == {"N"}
    assert signals.attrs["simulator"] == simulator
    assert signals.attrs["contact_stiffness"] == 1e6


def test_the_third_angle_comes_with_the_three_angle_disc() -> None:
    signals = simulate_brush(duration=0.005, disc="three-angle")
    assert {"phi", "phi_rate", "omega_z"} <= set(signals.data_vars)


def test_defaults_are_the_fitting_surface_and_the_published_one() -> None:
    assert simulate_brush(duration=0.001).attrs["surface_across"] == Surface().across
    assert simulate_brush("listing", duration=0.001).attrs["surface_across"] == 5.0
    assert simulate_brush(duration=0.001).attrs["contact_stiffness"] == 1e4


def test_run_replaces_the_stiffness_of_given_parameters() -> None:
    given = BrushParameters(contact_stiffness=3e5, friction=0.1)
    assert simulate_brush(duration=0.001, parameters=given).attrs["contact_stiffness"] == 3e5
    replaced = simulate_brush(duration=0.001, parameters=given, run=3)
    assert replaced.attrs["contact_stiffness"] == 1e8
    assert replaced.attrs["friction"] == 0.1


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("simulator", "magic"),
        ("run", 7),
        ("duration", -1.0),
        ("duration", 1e-9),
        ("sample_rate", 0.0),
        ("tolerance", float("nan")),
        ("disc", "flat"),
        ("start", "falling"),
        ("max_passes", 1),
        ("parameters", {"friction": 0.1}),
        ("defects", ListingDefects()),
        ("workaround", "divide"),
    ],
)
def test_bad_arguments_are_named(name: str, value) -> None:
    with pytest.raises(InvalidInputError, match=name):
        simulate_brush(**{"duration": 0.001, name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("disc", "two-angle"),
        ("start", "landing"),
        ("max_passes", 3),
        ("workaround", "hope"),
        ("defects", True),
    ],
)
def test_the_listing_refuses_what_it_does_not_have(name: str, value) -> None:
    with pytest.raises(InvalidInputError, match=name):
        simulate_brush("listing", **{"duration": 0.001, name: value})


def test_the_listing_needs_a_moving_tool() -> None:
    resting = BrushParameters(feed=0.0, rotation_rate=0.0)
    with pytest.raises(InvalidInputError, match="at rest"):
        simulate_brush("listing", duration=0.001, parameters=resting)
    held = simulate_brush(duration=0.05, parameters=resting)
    assert float(abs(held.elevation).max()) == 0.0
    assert bool((held.tool_x == held.tool_x[0]).all())


@pytest.mark.parametrize("samples", [1, 3, 7, 49, 1003])
def test_any_number_of_samples_comes_back(samples: int) -> None:
    for simulator, rate in (("physical", 20e3), ("listing", 1e5)):
        assert simulate_brush(simulator, duration=samples / rate).sizes["time"] == samples + 1

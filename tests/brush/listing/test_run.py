"""Runs of the listings of appendix D: what they report, and their ill-posed impact law."""

import numpy as np
import pytest

from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.thesis.listing import ListingDefects


def test_starts_level_and_reports_the_thesis_angles() -> None:
    signals = simulate_brush("listing", run=1, duration=0.05)
    assert float(signals.psi[0]) == pytest.approx(np.pi / 2) == signals.psi.attrs["level"]
    assert signals.sizes == {"time": 5001, "point": 4}
    assert signals.attrs["defects"].split() == list(ListingDefects().names())
    assert bool((signals.F_z >= 10.0).all())


@pytest.mark.parametrize("name", ListingDefects().names())
def test_every_motion_mistake_can_be_switched(name: str) -> None:
    """Each switch of the motion changes it; the other four act on the bearing's loads."""
    all_made = simulate_brush("listing", run=1, duration=0.02)
    others = tuple(other for other in ListingDefects().names() if other != name)
    mended = simulate_brush(
        "listing", run=1, duration=0.02, defects=ListingDefects.none(but=others)
    )
    same = np.allclose(all_made.theta_rate, mended.theta_rate, rtol=1e-6)
    of_the_response = {
        "interpolation_weight", "bearing_gate", "gravity_terms", "polishing_force_dropped",
    }  # fmt: skip
    assert same == (name in of_the_response)
    assert name not in mended.attrs["defects"].split()


def test_workarounds_scale_only_the_impacts() -> None:
    plain, divided, timed = (
        simulate_brush("listing", run=4, duration=0.01, workaround=kind)
        for kind in ("none", "divide", "impulse")
    )
    np.testing.assert_allclose(divided.F_y, plain.F_y / 10000)
    duration = BrushParameters.as_published(4).impact_duration
    np.testing.assert_allclose(timed.F_z - 10.0, (plain.F_z - 10.0) * duration, atol=1e-12)
    assert float(abs(plain.F_y).max()) > 0.0


def test_impact_law_is_not_well_posed() -> None:
    """On the guard both fields point inward: impacts multiply as the tolerance falls."""
    coarse, fine = (
        simulate_brush("listing", run=1, duration=0.13, tolerance=tolerance)
        for tolerance in (1e-3, 1e-4)
    )
    assert coarse.attrs["impacts"] > 1000
    assert fine.attrs["impacts"] > 4 * coarse.attrs["impacts"]


# Largest forces [N] over 5 s at a relative tolerance of 1e-3, found by porting the listings.
PEAKS = {1: (334, 949), 2: (962, 2737), 3: (1222, 3417), 4: (1818, 5129)}


@pytest.mark.long
@pytest.mark.parametrize("run", PEAKS)
def test_peak_forces_over_five_seconds(run: int) -> None:
    """The thesis's hundreds to thousands of newtons; F_x, all chatter, is not repeatable."""
    signals = simulate_brush("listing", run=run)
    largest = [float(abs(signals[name]).max()) for name in ("F_x", "F_y", "F_z")]
    np.testing.assert_allclose(largest[1:], PEAKS[run], rtol=0.01)
    assert 20.0 < largest[0] < 500.0
    touching = float(signals.contact.sel(point="C1").mean())
    assert touching == pytest.approx({1: 0.58, 2: 0.65, 3: 0.89, 4: 0.95}[run], abs=0.02)

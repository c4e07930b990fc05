"""The laws side by side: peaks and impulses."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.polishing.thesis.contact_study import most_impulse


def test_laws_differ_in_peaks_and_hardly_in_impulses():
    table = rp.polishing.compare_contact_laws(
        rp.polishing.BrushParameters.for_run(3), duration=0.012
    ).table
    peak, window = table["peak"], table["window_impulse"]
    assert float(peak.max() / peak.min()) > 1.5
    assert float(window.max() / window.min()) < 1.1


def test_peaks_grow_with_stiffness_but_impulses_do_not():
    tables = [
        rp.polishing.compare_contact_laws(
            rp.polishing.BrushParameters.for_run(run), duration=0.012
        ).table
        for run in (2, 3)
    ]
    law = "Hunt-Crossley"
    peaks, windows = ([float(t[key].sel(law=law)) for t in tables]
                      for key in ("peak", "window_impulse"))  # fmt: skip
    assert peaks[1] > 5 * peaks[0]
    assert windows[1] == pytest.approx(windows[0], rel=0.02)


def test_a_comparison_shows_itself():
    comparison = rp.polishing.compare_contact_laws(duration=0.01)
    assert "Hunt-Crossley" in repr(comparison)
    assert "N" in comparison.plot().get_ylabel()


def test_most_impulse_is_that_of_the_hardest_ten_milliseconds():
    force = np.zeros(1001)
    force[300:400] = 5.0
    assert most_impulse(np.cumsum(force) * 1e-3, 1e-3) == pytest.approx(5.0 * 0.01)

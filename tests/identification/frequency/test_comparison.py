"""Models held against frequency responses."""

import json

import matplotlib.pyplot as plt
import numpy as np
import pytest

import robustpolish as rp
from tests.identification.frequency.chains import LINES, measured, two_masses


def test_the_true_model_is_at_the_noise():
    model = two_masses()
    comparison = rp.compare(model, measured(model, told=True))
    for error in comparison.pairs.values():
        assert error.over_noise == pytest.approx(1.0, abs=0.1)
        assert error.relative == pytest.approx(error.noise, rel=0.15)
        assert error.likeness > 0.999


def test_a_wrong_spring_shows_in_error_and_modes():
    comparison = rp.compare(two_masses(stiffness=(2.6e5, 1e5)), measured(two_masses()))
    assert comparison.relative > 0.5
    first, second = comparison.modes
    assert first.model_frequency > 1.05 * first.frequency
    assert second.likeness > 0.9
    assert " 35.588" in repr(comparison)
    assert "<table>" in comparison._repr_html_()


def test_a_mode_that_the_model_lacks_is_listed():
    one = rp.MechanicalModel(
        [rp.Dof("a", 3.0)], [rp.Spring(("a", "ground"), 2e5)], [rp.Damper(("a", "ground"), 4.0)],
        [rp.Input("F", ("a", "ground"))], [rp.Output("a", ("a", "ground"))],
    )  # fmt: skip
    modes = rp.compare(one, measured(two_masses())).modes
    assert [mode.model_frequency is None for mode in modes] == [False, True]


def test_effects_count_with_their_linear_part():
    place = ("a", "b")
    loaded = two_masses(stiffness=(2e5, 8e4)).with_effect(
        "attached_resonator", "b", {"mass": 0.1, "stiffness": 1e4, "damping": 1.0}
    )
    friction = two_masses().with_effect("coulomb_friction", place, {"force": 1.0})
    assert rp.compare(loaded, measured(loaded)).relative < 0.1
    comparison = rp.compare(friction, measured(two_masses()))
    assert any("jumps at rest" in note for note in comparison.notes)


def test_files_and_estimates_are_recognised(tmp_path):
    model = two_masses()
    data = measured(model)
    table = {"frequency [Hz]": LINES}
    for name in ("a", "b"):
        curve = data.sel(output=name, input="F").values
        table |= {f"{name}/F real [m/N]": curve.real, f"{name}/F imag [m/N]": curve.imag}
    path = tmp_path / "frf.csv"
    np.savetxt(path, np.column_stack(list(table.values())), delimiter=",",
               header=",".join(table), comments="")  # fmt: skip
    by_file, by_array = rp.compare(model, path), rp.compare(model, data)
    assert by_file.relative == pytest.approx(by_array.relative, rel=1e-6)
    with pytest.raises(rp.InvalidInputError, match="a record over time"):
        rp.compare(model, path, window=1.0)


def test_pictures_and_figures():
    comparison = rp.compare(two_masses(stiffness=(2.6e5, 1e5)), measured(two_masses(), told=True))
    assert comparison.plot(output="b").get_ylabel() == "magnitude of b/F"
    assert comparison.plot(kind="nyquist", output="a").get_ylabel().startswith("imaginary part")
    assert len(comparison.plot_panels().axes) == 4
    _, ax = plt.subplots()
    assert comparison.plot(ax) is ax
    with pytest.raises(rp.InvalidInputError, match="one of 'a', 'b'"):
        comparison.plot(output="c")
    assert json.loads(json.dumps(comparison.to_dict()))["overall"]["relative"] > 0.5
    assert comparison.residual.dims == ("frequency", "output", "input")
    plt.close("all")

import numpy as np
import pytest
import xarray as xr

from robustpolish.errors import InvalidInputError
from robustpolish.identification.experiments.candidates import (
    EXPERIMENTS,
    Distance,
    Experiment,
    MachinePair,
)
from robustpolish.identification.experiments.tell_apart import SimulatedExperiment, ToldApart
from tests.identification.oscillators import oscillator

TIME = np.arange(400) / 100
WAVE = np.sqrt(2) * np.sin(2 * np.pi * TIME)
NOISE = np.array([2e-6])


def tried(left, times=1.0, kind="sweep", apart=None):
    """An experiment in which two machines are so many times the noise apart."""
    inputs = xr.Dataset({"F": ("time", WAVE)}, {"time": TIME})
    how = (times, 4.0 * times, "N", (0.5, 5.0))
    experiment = Experiment(kind, "F", *how, inputs, np.zeros(2), 1.0)
    runs = [np.zeros((400, 1)), -NOISE * (left if apart is None else apart) * WAVE[:, None],
            -NOISE * left * WAVE[:, None]]  # fmt: skip
    return SimulatedExperiment(experiment, Distance(*runs), NOISE)


def told(*experiments):
    machines = MachinePair(
        oscillator(), oscillator(), ("Coulomb", "Dahl"), NOISE, {}, np.zeros((0, 0))
    )
    ordered = tuple(sorted(experiments, key=lambda t: -t.left))
    refused = (("a step", "x would reach 2 times its limit"),)
    return ToldApart(machines, ordered, refused, {}, "Rest.")


def test_figures_are_over_the_noise_before_and_after_a_fit():
    one = tried(2.0, apart=5.0)
    assert one.apart == pytest.approx(5.0)
    assert one.left == pytest.approx(2.0)


def test_the_gentlest_experiment_that_is_sure_is_recommended():
    gentle, strong, weak = tried(4.0, 1.0), tried(400.0, 10.0), tried(2.0, 0.3)
    assert told(strong, gentle, weak).recommended is gentle
    assert told(weak).recommended is weak  # not sure, but clear
    faint = tried(0.9 * EXPERIMENTS.clear, 0.3)
    assert told(faint).recommended is None
    assert told().recommended is None


def test_it_says_what_to_do_and_how_far_they_are_apart():
    text = told(tried(4.0, 3.0, apart=6.0)).explain()
    assert text.splitlines()[:2] == [
        "To tell Coulomb from Dahl:",
        "make a sweep on F, up to 12 N (3 times that of the record) from 0.5 to 5 Hz.",
    ]
    assert "x differs by 1.2e-05 m (root mean square), 6 times its noise of 2e-06 m" in text
    assert "by 8e-06 m, 4 times, once the numbers of Dahl are fitted" in text
    assert "Left out: a step: x would reach 2 times its limit." in text
    assert "Rest." not in text


def test_it_is_honest_where_nothing_tells():
    text = told(tried(0.2, apart=3.0)).explain()
    assert "no experiment that was tried tells them apart." in text
    assert "0.2 times" in text
    assert "What may help instead: Rest." in text
    assert "one machine to every experiment" not in text
    assert "one machine to every experiment" in told(tried(0.2)).explain()


def test_plain_data_and_table_hold_the_same_figures():
    found = told(tried(4.0, 3.0, apart=6.0), tried(1.0))
    content = found.to_dict()
    assert content["told_apart"] is True
    assert [e["left_over_noise"] for e in content["experiments"]] == pytest.approx([4.0, 1.0])
    assert content["experiments"][0]["apart"]["x"] == pytest.approx(1.2e-5)
    assert content["recommended"].startswith("a sweep on F")
    rows = found.table().rows
    assert rows[0][:6] == ("sweep", "F", 12.0, "N", 0.5, 5.0)
    assert rows[0][6:] == pytest.approx((6.0, 4.0))
    assert "difference over noise" in repr(found)


def test_pictures_show_the_recommended_experiment_and_all_distances():
    found = told(tried(4.0, 3.0, apart=6.0), tried(0.5))
    bars = found.plot()
    assert [bar.get_width() for bar in bars.patches] == pytest.approx([4.0, 0.5])
    drive, both, apart = found.plot_panels().axes
    np.testing.assert_allclose(np.asarray(drive.lines[0].get_ydata()), WAVE)
    assert [str(line.get_label()) for line in both.lines] == ["Coulomb", "Dahl"]
    largest = [np.abs(np.asarray(line.get_ydata())).max() for line in apart.lines]
    assert largest == pytest.approx([6 * 2e-6 * np.sqrt(2), 4 * 2e-6 * np.sqrt(2)], rel=1e-3)


def test_without_an_experiment_there_is_no_picture():
    with pytest.raises(InvalidInputError, match="2 times its limit"):
        told().plot_panels()
    assert "no experiment could be made." in told().explain()

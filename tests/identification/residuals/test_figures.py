import numpy as np

from tests.identification.residuals.made_up import figures


def test_outputs_count_by_their_share_of_the_error():
    made = figures()
    np.testing.assert_allclose(made.overall(made.windows), [0.4, 0.6])
    np.testing.assert_allclose(made.overall(made.bands), [0.45, 0.55])
    assert float(made.overall(made.windows)["begin"][1]) == 2.0


def test_the_worst_output_has_the_largest_share():
    assert figures().worst == "y"
    assert figures(channels=figures().channels[::-1].assign_coords(output=["x", "y"])).worst == "x"

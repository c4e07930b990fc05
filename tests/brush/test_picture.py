import matplotlib.pyplot as plt
import numpy as np

import robustpolish as rp


def test_the_path_has_the_colour_of_the_contact_force():
    path = rp.polishing.ToolPath.spiral((0.0, 0.0), 0.012, 0.003, speed=0.04)
    mould = rp.polishing.Mould.from_formula("x**2 + 2*y**2", x=(-0.03, 0.03), y=(-0.03, 0.03))
    signals = rp.simulate_brush(duration=0.05, surface=mould, path=path)
    ax = rp.polishing.plot_polishing(signals, mould)
    line = ax.collections[1]
    np.testing.assert_allclose(line.get_array(), signals["contact_force"].sum("point").values[:-1])
    assert ax.get_xlabel() == "x [mm]"
    rp.polishing.plot_polishing(
        rp.simulate_brush("listing", duration=0.001), rp.polishing.Surface.as_published()
    )
    plt.close("all")

import numpy as np
import pytest

import robustpolish as rp
from tests.brush import moulds


@pytest.fixture(scope="module")
def from_mesh(tmp_path_factory):
    file = tmp_path_factory.mktemp("mould") / "mould.stl"
    return rp.polishing.Mould.from_stl(
        moulds.write_stl(file, *moulds.triangles(scale=1e3)), unit="mm"
    )


def from_array():
    side = np.linspace(-moulds.HALF, moulds.HALF, 61)
    return rp.polishing.Mould.from_array(moulds.height(side[:, None], side[None, :]), side, side)


def from_formula():
    side = (-moulds.HALF, moulds.HALF)
    return rp.polishing.Mould.from_formula(moulds.FORMULA, x=side, y=side)


@pytest.mark.parametrize("make", [from_array, from_formula])
def test_heights_slopes_and_bends_are_those_of_the_formula(make):
    x, y = moulds.places()
    mould = make()
    np.testing.assert_allclose(mould.height(x, y), moulds.height(x, y), atol=2e-9)
    np.testing.assert_allclose(mould.gradient(x, y)[0], moulds.slope_x(x, y), atol=5e-6)
    np.testing.assert_allclose(mould.bends(x, y)[0], moulds.bend_x(x, y), atol=0.02)


def test_a_mesh_becomes_the_smooth_surface_below_its_faces(from_mesh):
    x, y = moulds.places()
    # Its faces are up to 6 um away from the surface: 1 mm edges on a radius of 20 mm.
    np.testing.assert_allclose(from_mesh.height(x, y), moulds.height(x, y), atol=1e-8)
    np.testing.assert_allclose(from_mesh.gradient(x, y)[0], moulds.slope_x(x, y), atol=5e-5)
    np.testing.assert_allclose(from_mesh.bends(x, y)[0], moulds.bend_x(x, y), atol=0.1)
    assert 0 < from_mesh.error < 1e-8
    assert "60 x 60 mm" in repr(from_mesh)


def test_outside_the_mould_there_is_nothing():
    mould = from_array()
    assert np.isnan(mould.height(2 * moulds.HALF, 0.0))
    assert mould.distance_to_edge(0.025, 0.0) == pytest.approx(0.005)
    assert mould.distance_to_edge(0.035, 0.0) < 0


def test_a_round_mesh_ends_at_its_edge(tmp_path):
    vertices, faces = moulds.triangles(81)
    centres = vertices[faces].mean(axis=1)
    faces = faces[np.hypot(centres[:, 0], centres[:, 1]) < 0.025]
    mould = rp.polishing.Mould.from_stl(
        moulds.write_stl(tmp_path / "round.stl", vertices, faces), unit="m"
    )
    assert np.isnan(mould.height(0.024, 0.024))
    assert mould.height(0.012, 0.01) == pytest.approx(moulds.height(0.012, 0.01), abs=2e-8)
    spare = mould.distance_to_edge(0.010, 0.0)
    assert 0.012 < spare <= 0.0155


def test_a_mesh_with_a_step_is_refused(tmp_path):
    vertices, faces = moulds.triangles(61, lambda x, y: 0.005 * (x + 0 * y > 0.0005))
    file = moulds.write_stl(tmp_path / "step.stl", vertices, faces)
    with pytest.raises(rp.InvalidInputError, match="away from a smooth surface"):
        rp.polishing.Mould.from_stl(file, unit="m")


def test_units_and_spacing_of_a_mesh(tmp_path):
    file = moulds.write_stl(tmp_path / "mould.stl", *moulds.triangles(31))
    with pytest.raises(rp.InvalidInputError, match="unit"):
        rp.polishing.Mould.from_stl(file, unit="inch")
    with pytest.raises(rp.InvalidInputError, match="spacing"):
        rp.polishing.Mould.from_stl(file, unit="m", spacing=1e-6)
    assert rp.polishing.Mould.from_stl(file, unit="m", spacing=0.004).x.size == 16

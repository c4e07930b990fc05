"""Polished surfaces: the trough, splines, and moulds from formulas, grids and meshes."""

import numpy as np
import pytest
import trimesh

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.polishing.surfaces.importers import checked_mesh as checked
from robustpolish.polishing.surfaces.importers import covered, fitted, read_mesh
from robustpolish.polishing.surfaces.spline import expansions, pack
from robustpolish.polishing.surfaces.surface import Surface
from tests.polishing import moulds

# The trough, against finite differences and the thesis's numbers.


def test_published_surface_is_equation_9_1() -> None:
    x, y, surface = 0.013, -0.004, Surface.as_published()
    expected = 0.1 * (5 * x / 4) ** 2 + 5 * (4 * y) ** 2
    assert surface.height(x, y) == pytest.approx(expected, rel=1e-14)
    assert surface.trough_radius == pytest.approx(6.25e-3)
    assert Surface().fits(0.010)
    assert not surface.fits(0.010)
    assert Surface.flat().trough_radius == np.inf


def test_slopes_and_elevations_of_the_trough():
    surface, x, y, h = Surface(0.7, 3.0), 0.02, 0.005, 1e-6
    ends = [
        (surface.height(x + i, y + j), surface.height(x - i, y - j)) for i, j in ((h, 0), (0, h))
    ]
    expected = [(ahead - behind) / (2 * h) for ahead, behind in ends]
    np.testing.assert_allclose(surface.gradient(x, y), expected, rtol=1e-8)
    surface = Surface()
    short, long = (surface.elevation(0.01, 0.01, (s * 3.0, s * 4.0)) for s in (1e-9, 1e9))
    assert short == pytest.approx(long, rel=1e-14)
    assert surface.elevation(0.01, 0.01, (-3.0, -4.0)) == pytest.approx(-long, rel=1e-14)
    with pytest.raises(InvalidInputError, match="direction"):
        Surface().elevation(0.0, 0.0, (0.0, 0.0))


# Curvatures and elevation of moulds.

BOWL = "0.05 - sqrt(0.05**2 - x**2 - y**2)"


def test_curvature_of_a_sphere_and_elevation_of_a_trough():
    sphere = rp.polishing.Mould.from_formula(BOWL, x=(-0.02, 0.02), y=(-0.02, 0.02))
    x, y = np.random.default_rng(0).uniform(-0.015, 0.015, (2, 30))
    for curvature in sphere.principal_curvatures(x, y):
        np.testing.assert_allclose(curvature, 20.0, rtol=1e-3)
    trough = rp.polishing.Surface(0.2, 1.5)
    along, across = (0.5 * bend for bend in trough.curvatures)
    mould = rp.polishing.Mould.from_formula(
        "a*x**2 + b*y**2", x=(-0.02, 0.02), y=(-0.02, 0.02), parameters={"a": along, "b": across}
    )
    x, y = np.random.default_rng(0).uniform(-0.02, 0.02, (2, 20))
    direction = (np.cos(x * 500), np.sin(x * 500))
    found = mould.elevation(x, y, direction)
    np.testing.assert_allclose(found, trough.elevation(x, y, direction), atol=1e-12)


# Moulds from formulas.

AREA = {"x": (-0.02, 0.03), "y": (-0.01, 0.01)}


def test_names_and_what_is_no_smooth_height():
    mould = rp.polishing.Mould.from_formula("z = depth*(1 - exp(-x**2/w**2)) + 0*y*pi", **AREA,
                                  parameters={"depth": 0.002, "w": 0.02})  # fmt: skip
    assert mould.height(0.01, 0.0) == pytest.approx(0.002 * (1 - np.exp(-0.25)), abs=1e-9)
    assert mould.error <= 1e-9
    for text, message in NOT_SMOOTH.items():
        with pytest.raises(rp.InvalidInputError, match=message):
            rp.polishing.Mould.from_formula(text, **AREA)
    with pytest.raises(rp.InvalidInputError, match="x"):
        rp.polishing.Mould.from_formula("x", x=(0.0, 0.0), y=(0.0, 1.0))
    with pytest.raises(rp.InvalidInputError, match="finite"):
        rp.polishing.Mould.from_formula("a*x", **AREA, parameters={"a": np.nan})


NOT_SMOOTH = {
    "abs(x)": "edge", "a*x": "the name 'a'", "log(x)": "without a value", "1/x": "off on a grid",
    "__import__('os')": "the name", "x.real": "formula", "sqrt(x**2 + 1e-12)": "off on a grid",
    7: "text",
}  # fmt: skip

# Moulds from grids.

SIDE = np.linspace(-30.0, 30.0, 61)  # mm
HEIGHTS = 1e3 * moulds.height(1e-3 * SIDE[:, None], 1e-3 * SIDE[None, :])


def test_a_file_gives_what_the_array_gives(tmp_path):
    file = tmp_path / "grid.csv"
    lines = [["x/y", *SIDE], *([x, *row] for x, row in zip(SIDE, HEIGHTS, strict=True))]
    file.write_text("\n".join(",".join(map(str, line)) for line in lines))
    alone = tmp_path / "alone.csv"
    np.savetxt(alone, HEIGHTS, delimiter=",", fmt="%.17g")
    wanted = rp.polishing.Mould.from_array(HEIGHTS, SIDE, SIDE, unit="mm")
    x, y = moulds.places()
    found = rp.polishing.Mould.from_csv(file, unit="mm")
    np.testing.assert_allclose(found.height(x, y), wanted.height(x, y), atol=1e-15)
    found = rp.polishing.Mould.from_csv(alone, unit="mm", spacing=1.0)
    np.testing.assert_allclose(found.height(x + 0.03, y + 0.03), wanted.height(x, y), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "none"),
        (",1,2,3\n1,2\n", "unequal"),
        (",0,1,2,3\n0,1,1,1,one\n1,1,1,1,1\n2,1,1,1,1\n3,1,1,1,1\n", "'one' in row 2, column 5"),
        (",0,1,2,3\n0,1,1,,1\n1,1,1,1,1\n2,1,1,1,1\n3,1,1,1,1\n", r"1 that are no number"),
        (",0,1,2,4\n0,1,1,1,1\n1,1,1,1,1\n2,1,1,1,1\n3,1,1,1,1\n", "equally spaced"),
    ],
)
def test_files_that_are_no_grid_are_refused(tmp_path, text, message):
    file = tmp_path / "grid.csv"
    file.write_text(text)
    with pytest.raises(rp.InvalidInputError, match=message):
        rp.polishing.Mould.from_csv(file)


def test_arrays_are_checked():
    for name, arguments in {
        "heights": (HEIGHTS[:, 1:], SIDE, SIDE),
        "x": (HEIGHTS[:3], SIDE[:3], SIDE),
    }.items():
        with pytest.raises(rp.InvalidInputError, match=name):
            rp.polishing.Mould.from_array(*arguments)
    with pytest.raises(rp.InvalidInputError, match="can be read"):
        rp.polishing.Mould.from_csv("no_such_file.csv")


# Meshes: what is refused.


def refused(vertices, faces, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        checked(vertices, faces)


def test_corners_are_joined_and_holes_and_overhang_are_refused():
    vertices, faces = moulds.triangles(11)
    loose = vertices[faces].reshape(-1, 3)
    sheet = checked(loose, np.arange(len(loose)).reshape(-1, 3))
    assert len(sheet.vertices) == 121
    assert len(sheet.faces) == 200
    sheet = checked(vertices, faces[:, ::-1])
    a, b, c = (sheet.vertices[sheet.faces[:, i]] for i in range(3))
    assert np.all(np.cross(b - a, c - a)[:, 2] > 0)
    vertices, faces = moulds.triangles(21)
    middle = vertices[faces].mean(axis=1)
    holed = faces[np.hypot(middle[:, 0] - 0.01, middle[:, 1]) > 0.005]
    refused(vertices, holed, r"1 holes, one near x = 10")
    bent = vertices.copy()
    bent[bent[:, 0] > 0.0255] += [-0.008, 0.0, 0.01]
    refused(bent, faces, "vertical or hang over")


def test_folds_pieces_and_fins_are_refused():
    vertices, faces = moulds.triangles(11)
    twice = np.concatenate([vertices, vertices + np.array([0.2, 0.0, 0.0])])
    refused(twice, np.concatenate([faces, faces + len(vertices)]), "2 pieces")
    fin = np.concatenate([vertices, [[0.0, 0.0, 0.05]]])
    a, _, c = faces[50]  # their edge is the diagonal of a square, at which two faces meet
    up = [a, c, len(vertices)] if vertices[a, 1] * vertices[c, 0] < 0 else [c, a, len(vertices)]
    refused(fin, np.concatenate([faces, [up]]), "more than two faces|hang over")
    angle = np.linspace(0, 3 * np.pi, 40)  # one and a half turns of a ramp
    ring = np.stack([np.cos(angle), np.sin(angle), 0.02 * angle], axis=1)
    ramp = np.concatenate([ring * [1, 1, 1], ring * [2, 2, 1]])
    i = np.arange(39)
    strips = np.concatenate([np.stack([i, i + 40, i + 41], 1), np.stack([i, i + 41, i + 1], 1)])
    with pytest.raises(rp.InvalidInputError, match="above each other"):
        covered(checked(ramp, strips), None)


def test_what_is_no_mesh_is_refused(tmp_path):
    vertices, faces = moulds.triangles(5)
    refused(np.zeros((0, 3)), np.zeros((0, 3), int), "0 faces")
    refused(np.tile([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], (1, 1)), faces[:2] * 0, "without area")
    broken = vertices.copy()
    broken[7, 2] = np.nan
    file = moulds.write_stl(tmp_path / "nan.stl", broken, faces)
    with pytest.raises(rp.InvalidInputError, match="no numbers"):
        read_mesh(file, 1.0)
    text = tmp_path / "text.stl"
    text.write_text("nothing of a mesh")
    for path in (text, tmp_path / "missing.stl"):
        with pytest.raises(rp.InvalidInputError, match="path"):
            read_mesh(path, 1.0)


# Moulds against a closed form.


@pytest.fixture(scope="module")
def from_mesh(tmp_path_factory):
    file = tmp_path_factory.mktemp("mould") / "mould.stl"
    return rp.polishing.Mould.from_stl(
        moulds.write_stl(file, *moulds.triangles(scale=1e3)), unit="mm"
    )


def from_array():
    return rp.polishing.Mould.from_array(1e-3 * HEIGHTS, 1e-3 * SIDE, 1e-3 * SIDE)


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


def test_a_round_mesh_ends_at_its_edge_and_units_and_steps_are_checked(tmp_path):
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
    vertices, faces = moulds.triangles(61, lambda x, y: 0.005 * (x + 0 * y > 0.0005))
    file = moulds.write_stl(tmp_path / "step.stl", vertices, faces)
    with pytest.raises(rp.InvalidInputError, match="away from a smooth surface"):
        rp.polishing.Mould.from_stl(file, unit="m")
    file = moulds.write_stl(tmp_path / "mould.stl", *moulds.triangles(31))
    with pytest.raises(rp.InvalidInputError, match="unit"):
        rp.polishing.Mould.from_stl(file, unit="inch")
    with pytest.raises(rp.InvalidInputError, match="spacing"):
        rp.polishing.Mould.from_stl(file, unit="m", spacing=1e-6)
    assert rp.polishing.Mould.from_stl(file, unit="m", spacing=0.004).x.size == 16


# Meshes with distant vertices.


def test_between_distant_vertices_the_faces_are_followed():
    # A groove as a drawing program cuts it: long faces, with vertices at both ends only.
    y = np.linspace(-0.01, 0.01, 21)
    ends = np.array([-0.03, 0.03])
    vertices = np.array([[x, v, 40 * v**2] for x in ends for v in y])
    i = np.arange(20)
    faces = np.concatenate([np.stack([i, i + 21, i + 22], 1), np.stack([i, i + 22, i + 1], 1)])
    x, sheet = np.linspace(-0.03, 0.03, 61), trimesh.Trimesh(vertices, faces, process=False)
    found, error = fitted(sheet, x, y, covered(sheet, 0.001)[2])
    assert error < 1e-6
    spots = np.random.default_rng(0).uniform(-0.009, 0.009, 200)
    height = expansions(2 * spots[::-1].copy(), spots, pack(x, y, found))[0]
    # Chords of 1 mm on a radius of 12.5 mm are 10 um away.
    np.testing.assert_allclose(height, 40 * spots**2, atol=1.5e-5)

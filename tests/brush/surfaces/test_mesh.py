import numpy as np
import pytest

import robustpolish as rp
from robustpolish.polishing.surfaces.importers import checked_mesh as checked
from robustpolish.polishing.surfaces.importers import covered, read_mesh
from tests.brush import moulds


def refused(vertices, faces, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        checked(vertices, faces)


def test_corners_of_a_file_are_joined():
    vertices, faces = moulds.triangles(11)
    loose = vertices[faces].reshape(-1, 3)
    sheet = checked(loose, np.arange(len(loose)).reshape(-1, 3))
    assert len(sheet.vertices) == 121
    assert len(sheet.faces) == 200


def test_a_mesh_drawn_from_below_is_turned_over():
    vertices, faces = moulds.triangles(11)
    sheet = checked(vertices, faces[:, ::-1])
    a, b, c = (sheet.vertices[sheet.faces[:, i]] for i in range(3))
    assert np.all(np.cross(b - a, c - a)[:, 2] > 0)


def test_holes_are_refused_and_placed():
    vertices, faces = moulds.triangles(21)
    middle = vertices[faces].mean(axis=1)
    holed = faces[np.hypot(middle[:, 0] - 0.01, middle[:, 1]) > 0.005]
    refused(vertices, holed, r"1 holes, one near x = 10")


def test_overhang_is_refused():
    vertices, faces = moulds.triangles(21)
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


def test_the_grid_marks_what_is_covered():
    vertices, faces = moulds.triangles(21)
    sheet = checked(vertices, faces[vertices[faces].mean(axis=1)[:, 0] < 0.0])
    x, y, heights = covered(sheet, 0.001)
    np.testing.assert_allclose(heights, moulds.height(x[:, None], y), atol=1e-4)
    assert (x[0], x[-1], y[-1]) == pytest.approx((-0.03, 0.0, 0.03))

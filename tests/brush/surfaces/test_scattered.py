import numpy as np
import trimesh

from robustpolish.polishing.surfaces.importers import covered, fitted
from robustpolish.polishing.surfaces.spline import expansions, pack


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

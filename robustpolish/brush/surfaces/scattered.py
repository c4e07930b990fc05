"""The spline of least bending through the vertices of a mesh.

Least squares with a penalty on second differences (P. H. C. Eilers and B. D. Marx, "Flexible
smoothing with B-splines and penalties", Statistical Science 11 (1996), here along two axes).
The penalty is so small that it decides only what the vertices leave open: between distant
vertices, where the flat faces guide it with a little more weight, and outside the mesh.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from robustpolish.arrays import AnyArray as Array
from robustpolish.brush.surfaces.mesh import Sheet
from robustpolish.brush.surfaces.polished_surface import Floats
from robustpolish.brush.surfaces.uniform_spline import expansions, pack, weights

_BENDING = 1e-6  # weight of a squared second difference, where a vertex has weight 1
_FACES = 1e-4  # weight of the faces at a place of the grid


def fitted(sheet: Sheet, x: Floats, y: Floats, faces: Floats) -> tuple[Floats, float]:
    """Return the coefficients of the spline on a grid, and its largest error at a vertex [m].

    `faces` are the heights of the faces on the grid, nan where there is none.
    """
    rows, columns = x.size + 2, y.size + 2
    at_vertices = _design(sheet.vertices[:, :2], x, y)
    i, j = np.nonzero(np.isfinite(faces))
    at_faces = _design(np.stack([x[i], y[j]], axis=1), x, y)
    one, other = sparse.eye_array(rows), sparse.eye_array(columns)
    parts = [
        (sparse.kron(_difference(rows, 2), other), 1.0),
        (sparse.kron(one, _difference(columns, 2)), 1.0),
        (sparse.kron(_difference(rows, 1), _difference(columns, 1)), 2.0),
    ]
    system = at_vertices.T @ at_vertices + _FACES * (at_faces.T @ at_faces)
    for part, share in parts:
        system = system + _BENDING * share * (part.T @ part)
    middle = float(np.mean(sheet.vertices[:, 2]))
    known = at_vertices.T @ (sheet.vertices[:, 2] - middle)
    known = known + _FACES * (at_faces.T @ (faces[i, j] - middle))
    solver = splu(
        sparse.csc_array(system),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    found = solver.solve(known).reshape(rows, columns) + middle
    here = sheet.vertices.T
    error = expansions(here[0].copy(), here[1].copy(), pack(x, y, found))[0] - here[2]
    return found, float(np.max(np.abs(error)))


def _design(places: Floats, x: Floats, y: Floats) -> sparse.csr_array:
    """Return the matrix from coefficients to heights at places, shape (n, unknowns)."""
    i, a = _weights(places[:, 0], x)
    j, b = _weights(places[:, 1], y)
    columns = (i[:, :, None] * (y.size + 2) + j[:, None, :]).reshape(len(places), 16)
    values = (a[:, :, None] * b[:, None, :]).reshape(len(places), 16)
    starts = np.arange(0, 16 * len(places) + 1, 16)
    shape = (len(places), (x.size + 2) * (y.size + 2))
    return sparse.csr_array((values.ravel(), columns.ravel(), starts), shape)


def _weights(places: Floats, axis: Floats) -> tuple[Array, Floats]:
    """Return numbers and weights of the four coefficients at each place."""
    u = (places - axis[0]) / (axis[1] - axis[0])
    number = np.clip(u.astype(int), 0, axis.size - 2)
    found = np.stack(weights(u - number), axis=1)
    return number[:, None] + np.arange(4), found


def _difference(count: int, order: int) -> sparse.csr_array:
    return sparse.csr_array(np.diff(np.eye(count), order, axis=0))

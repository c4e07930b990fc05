"""A mesh that is fit to be polished: one sheet without holes, steep faces or folds."""

from __future__ import annotations

import io
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from robustpolish.arrays import AnyArray as Array
from robustpolish.brush.surfaces.grid import FILE, check_size
from robustpolish.brush.surfaces.polished_surface import Floats
from robustpolish.compiling import njit
from robustpolish.files import Wanted, content
from robustpolish.validation import described, invalid, one_of

_STEEPEST = 0.05  # upward part of a face's normal: 87 degrees
_MOST_CELLS = 200  # along the longer side, unless a spacing is given
_MOST_GIVEN = 600
_FORMATS = (".stl", ".obj", ".off", ".ply")
_REMEDY = "Cut the polished side out of the model as one open sheet, z up."


@dataclass(frozen=True)
class Sheet:
    """A checked mesh.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3)
        [m].
    faces : ndarray of int, shape (m, 3)
        Corners of the triangles, counter-clockwise as seen from above.
    """

    vertices: Floats
    faces: Array


def read_mesh(path: str | Path, scale: float, wanted: Wanted = FILE) -> Sheet:
    """Read a mesh in metres, or say what is wrong with it."""
    whole = content(path, wanted)
    kind = one_of("path", Path(path).suffix.casefold(), _FORMATS, "Convert the file.")
    import trimesh  # takes a second to import, and few need it

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # it logs tracebacks of damaged files
    try:
        # As bytes alone it can name no other file that would be read too.
        loaded: Any = trimesh.load_mesh(io.BytesIO(whole), file_type=kind[1:], process=False)
        vertices, faces = np.array(loaded.vertices, dtype=float), np.array(loaded.faces)
    except Exception as error:  # the reader raises whatever its formats do
        shown = described(f"{path} ({error or type(error).__name__})")
        raise invalid(
            "path", shown, "a mesh that can be read, such as an STL file", "Check it."
        ) from None
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise _refused("no triangles in space", "a mesh of triangles", "Check the file.")
    if faces.size and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise _refused("faces between corners that are not there", "a mesh", "Export it anew.")
    if not np.all(np.isfinite(vertices)):
        count = int(np.sum(~np.isfinite(vertices).all(axis=1)))
        raise _refused(
            f"{count} corners that are no numbers", "finite coordinates", "Export it anew."
        )
    return checked(scale * vertices, faces)


def checked(vertices: Floats, faces: Array) -> Sheet:
    """Join equal corners and refuse what is no sheet that can be polished from above."""
    size = float(np.max(np.ptp(vertices, axis=0))) if len(vertices) else 0.0
    if len(faces) < 2 or not size > 0:
        raise _refused(f"{len(faces)} faces", "a mesh of triangles", "Check the file.")
    check_size("path", vertices)
    # An STL file repeats every corner for every face that has it.
    _, kept, joined = np.unique(
        np.rint(vertices / (1e-7 * size)), axis=0, return_index=True, return_inverse=True
    )
    vertices, faces = vertices[kept], joined.ravel()[faces]
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    whole = area > 1e-12 * size**2
    faces, normal, area = faces[whole], normal[whole], area[whole]
    if len(faces) < 2:
        raise _refused("faces without area only", "a mesh of triangles", "Check the file.")
    upward = normal[:, 2] / area
    if np.sum(normal[:, 2]) < 0:  # drawn from below
        faces, upward, normal = faces[:, ::-1], -upward, -normal
    steep = np.flatnonzero(upward < _STEEPEST)
    if steep.size:
        x, y = 1e3 * vertices[faces[steep[0]], :2].mean(axis=0)
        where = f"one at x = {x:.4g} mm, y = {y:.4g} mm"
        what = f"{steep.size} faces that are vertical or hang over, {where}"
        raise _refused(what, "a surface that is seen from above everywhere", _REMEDY)
    used, renumbered = np.unique(faces, return_inverse=True)
    sheet = Sheet(vertices[used], renumbered.reshape(faces.shape))
    _check_edges(sheet)
    return sheet


def _check_edges(sheet: Sheet) -> None:
    """Refuse several pieces, holes, and edges at which more than two faces meet."""
    edges = np.concatenate([sheet.faces[:, [0, 1]], sheet.faces[:, [1, 2]], sheet.faces[:, [2, 0]]])
    count = len(sheet.vertices)
    pieces, _ = _connected(edges, count)
    if pieces > 1:
        raise _refused(f"{pieces} pieces", "one connected surface", _REMEDY)
    _, first, times = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    if times.max() > 2:
        raise _refused(
            "an edge at which more than two faces meet", "a sheet", "Repair the mesh first."
        )
    rim = edges[first[times == 1]]
    _, label = _connected(rim, count)
    loops = [rim[label[rim[:, 0]] == k] for k in np.unique(label[rim[:, 0]])]
    enclosed = [_enclosed(*(sheet.vertices[loop[:, k], :2] for k in (0, 1))) for loop in loops]
    holes = [k for k in range(len(loops)) if k != int(np.argmax(enclosed))]
    if holes:
        x, y = 1e3 * sheet.vertices[loops[holes[0]][:, 0], :2].mean(axis=0)
        what = f"{len(holes)} holes, one near x = {x:.4g} mm, y = {y:.4g} mm"
        raise _refused(what, "a surface without holes", "Close them, or cut the mould smaller.")


def _enclosed(start: Floats, end: Floats) -> float:
    """Area to the left of a closed loop of edges [m^2]."""
    return 0.5 * float(np.sum(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]))


def _connected(edges: Array, count: int) -> tuple[int, Array]:
    ones = np.ones(len(edges))
    graph = sparse.coo_array((ones, (edges[:, 0], edges[:, 1])), (count, count))
    return connected_components(graph, directed=False)


def _refused(what: str, wanted: str, remedy: str) -> Exception:
    return invalid("path", described(f"a mesh with {what}"), wanted, remedy)


def covered(sheet: Sheet, spacing: float | None) -> tuple[Floats, Floats, Floats]:
    """Return a grid over a sheet and the heights of its faces there; nan where there is none.

    Without a spacing [m] it is 1.2 times the median length of an edge, so that there are about as
    many vertices as unknowns. Faces above each other are refused.
    """
    corners = sheet.vertices[sheet.faces]
    plan = corners[:, :, :2]
    lengths = np.linalg.norm(plan - np.roll(plan, 1, axis=1), axis=2)
    low, high = plan.min(axis=(0, 1)), plan.max(axis=(0, 1))
    longest = float(np.max(high - low))
    own = max(1.2 * float(np.median(lengths)), longest / _MOST_CELLS)
    step = own if spacing is None else spacing
    if longest / step > _MOST_GIVEN:
        shown = described(f"{longest / step:.0f} cells along a side")
        raise invalid("spacing", shown, f"at most {_MOST_GIVEN}", "Give a larger spacing.")
    x, y = (
        np.linspace(a, b, max(8, round((b - a) / step)) + 1) for a, b in zip(low, high, strict=True)
    )
    heights, times = np.full((x.size, y.size), np.nan), np.zeros((x.size, y.size), dtype=np.int64)
    _draw(corners, x, y, heights, times)
    if times.max() > 1:
        i, j = np.argwhere(times > 1)[0]
        where = f"at x = {1e3 * x[i]:.4g} mm, y = {1e3 * y[j]:.4g} mm"
        raise _refused(f"faces above each other {where}", "one height at each place", _REMEDY)
    return x, y, heights


@njit(cache=True)
def _draw(corners, x, y, heights, times):  # pragma: no cover - compiled
    """Write the height of the triangles at places of the grid, and how many have it inside."""
    step_x, step_y = x[1] - x[0], y[1] - y[0]
    for k in range(corners.shape[0]):
        ax, ay, az = corners[k, 0]
        bx, by, bz = corners[k, 1]
        cx, cy, cz = corners[k, 2]
        twice = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        spare = 1e-7 * twice
        first = max(int(np.ceil((min(ax, bx, cx) - x[0]) / step_x - 1e-6)), 0)
        last = min(int(np.floor((max(ax, bx, cx) - x[0]) / step_x + 1e-6)), x.size - 1)
        lowest = max(int(np.ceil((min(ay, by, cy) - y[0]) / step_y - 1e-6)), 0)
        highest = min(int(np.floor((max(ay, by, cy) - y[0]) / step_y + 1e-6)), y.size - 1)
        for i in range(first, last + 1):
            for j in range(lowest, highest + 1):
                u = (bx - x[i]) * (cy - y[j]) - (by - y[j]) * (cx - x[i])
                v = (cx - x[i]) * (ay - y[j]) - (cy - y[j]) * (ax - x[i])
                nearest = min(u, v, twice - u - v)
                if nearest >= -spare:
                    heights[i, j] = (u * az + v * bz + (twice - u - v) * cz) / twice
                if nearest > spare:
                    times[i, j] += 1

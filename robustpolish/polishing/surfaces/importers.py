"""Import of moulds: formulas, maps of heights, and meshes.

A mesh becomes the spline of least bending through its vertices: least squares with a penalty on
second differences (P. H. C. Eilers and B. D. Marx, "Flexible smoothing with B-splines and
penalties", Statistical Science 11 (1996), here along two axes). The penalty is so small that it
decides only what the vertices leave open: between distant vertices, where the flat faces guide it
with a little more weight, and outside the mesh.
"""

from __future__ import annotations

import csv
import io
import logging
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.interpolate import NdBSpline
from scipy.sparse.linalg import splu

from robustpolish.base.arrays import AnyArray as Array
from robustpolish.base.checks import closest_name_remedy, described, invalid, one_of, positive
from robustpolish.base.input_files import FileSpec, content, text
from robustpolish.base.jit import njit
from robustpolish.machines.effects.formula_language import FUNCTIONS, PostfixProgram, read_formula
from robustpolish.polishing.surfaces.spline import FEWEST, coefficients
from robustpolish.polishing.surfaces.surface import Floats

# Formulas: read, never executed, and sampled until a spline keeps to them.

_CLOSE = 1e-9  # m: about the roughness that polishing reaches
_CELLS = (32, 1024)  # along the longer side, first and last
_EDGED = frozenset({"abs", "sign", "min", "max"})
_SMOOTH = tuple(name for name in FUNCTIONS if name not in _EDGED)


def sampled(
    text: str,
    x: tuple[float, float],
    y: tuple[float, float],
    parameters: Mapping[str, float],
) -> tuple[Floats, Floats, Floats, float]:
    """Return places along x and y, heights, and how far a spline through them is off [m]."""
    formula = _read(text, parameters)
    sides = checked_side("x", x), checked_side("y", y)
    longest = max(high - low for low, high in sides)
    count = _CELLS[0]
    while True:
        # An even number: the middle, where many formulas are sharpest, is a place of the grid.
        cells = [max(8, 2 * round(0.5 * count * (high - low) / longest)) for low, high in sides]
        # Twice as fine as the spline: what lies between its places judges it.
        along, across = (
            np.linspace(low, high, 2 * n + 1) for (low, high), n in zip(sides, cells, strict=True)
        )
        values = {"x": along[:, None], "y": across[None, :], **parameters}
        heights = np.broadcast_to(formula.value(values), (along.size, across.size)).astype(float)
        wrong = np.argwhere(~np.isfinite(heights))
        if wrong.size:
            where = f"x = {along[wrong[0, 0]]:g} m, y = {across[wrong[0, 1]]:g} m"
            shown = described(f"{formula.text!r} without a value at {where}")
            raise invalid("text", shown, "a finite height everywhere", "Take another area.")
        error = max(_between(heights[:, ::2]), _between(heights[::2].T))
        if error <= _CLOSE:
            return along[::2], across[::2], heights[::2, ::2], error
        if count >= _CELLS[1]:
            raise invalid(
                "text", described(f"{text!r}, {error:.2g} m off on a grid of {count} cells"),
                f"a smooth height, so that a spline keeps to it within {_CLOSE:g} m",
                "Smooth its edges and waves, or take a smaller area.",
            )  # fmt: skip
        count *= 2


def checked_side(name: str, ends: tuple[float, float]) -> tuple[float, float]:
    """Return where a side begins and where it ends [m]."""
    if len(ends) != 2 or not np.all(np.isfinite(ends)) or not ends[1] > ends[0]:
        expected = "where it begins and, behind that, where it ends [m]"
        raise invalid(name, ends, expected, "Give two numbers.")
    return float(ends[0]), float(ends[1])


def _read(text: str, parameters: Mapping[str, float]) -> PostfixProgram:
    """Read the formula of a height by the reader of laws, which wants every name to be used."""
    if not isinstance(text, str):
        raise invalid("text", text, "a formula such as '0.5*x**2'", "Write it as text.")
    for name, value in parameters.items():
        if not np.isfinite(value):
            raise invalid(("parameters", name), value, "a finite number", "Correct it.")
    expression = text.split("=", 1)[1] if re.match(r"\s*[zf]\s*=", text) else text
    written = dict.fromkeys(re.findall(r"(?<![\w.])[A-Za-z_]\w*", expression))
    known = {"x", "y", "pi", *_SMOOTH, *parameters}
    for name in written:
        if name not in known:
            edge = " It has an edge, on which no curvature exists." if name in _EDGED else ""
            what = f"x, y, pi, one of {', '.join(_SMOOTH)}, or a name in parameters"
            remedy = closest_name_remedy(name, known) + edge
            raise invalid("text", described(f"the name {name!r}"), what, remedy)
    for name in parameters:
        if name in ("q", "v", "t"):
            raise invalid("parameters", name, "a name other than q, v and t", "Rename it.")
    return read_formula(f"f = {expression}", [n for n in ("x", "y", *parameters) if n in written])


def _between(values: Floats) -> float:
    """Largest error of the spline through every second row at those between."""
    found = coefficients(values[::2])
    middle = (found[:-3] + 23 * found[1:-2] + 23 * found[2:-1] + found[3:]) / 48
    return float(np.max(np.abs(middle - values[1::2])))


# Maps of heights: checks and CSV files.

Unit = Literal["m", "mm", "um"]
_METRES = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
FILE = FileSpec("path", "a file that can be read", "Check the path.", 100_000_000)
"""Files of surfaces and paths."""

_ATOM, _TOWN = 1e-10, 1e4  # m; squares and their ratios stay far from the ends of doubles
_EVEN = 1e-4  # steps may differ by this share: files round their numbers


def scale_of(unit: str) -> float:
    """Return how many metres a unit is."""
    return _METRES[one_of("unit", unit, _METRES)]


def checked(heights: ArrayLike, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return places along x and y and the heights, or say what is wrong with them."""
    places = []
    for name, values in (("x", x), ("y", y)):
        given = np.array(values, dtype=float)
        if given.ndim != 1 or given.size < FEWEST or not np.all(np.isfinite(given)):
            shown = described(f"shape {given.shape}")
            raise invalid(name, shown, f"at least {FEWEST} finite numbers in a row", "Give more.")
        steps = np.diff(given)
        if not steps.min() > 0 or np.ptp(steps) > _EVEN * steps.mean():
            shown = described(f"steps from {steps.min():g} to {steps.max():g}")
            remedy = "Resample the map on an even grid."
            raise invalid(name, shown, "rising, equally spaced places", remedy)
        places.append(np.linspace(given[0], given[-1], given.size))
    along, across = places
    found = np.array(heights, dtype=float)
    if found.shape != (along.size, across.size):
        shown, wanted = described(f"shape {found.shape}"), f"shape {(along.size, across.size)}"
        remedy = "One row per place of x, one column per place of y."
        raise invalid("heights", shown, wanted, remedy)
    missing = np.argwhere(~np.isfinite(found))
    if missing.size:
        i, j = missing[0]
        shown = described(f"{len(missing)} that are no number, the first at x[{i}], y[{j}]")
        remedy = "Fill the holes, or cut the map down to where it was measured."
        raise invalid("heights", shown, "finite heights everywhere", remedy)
    return along, across, found


def csv_rows(
    path: str | Path, wanted: FileSpec, reader: Callable[..., Iterable[Any]], **options: Any
) -> list[Any]:
    """Return the rows of a CSV file."""
    lines = io.StringIO(text(path, wanted, "utf-8-sig"), newline="")
    try:
        return list(reader(lines, **options))
    except csv.Error as error:
        shown = described(f"{path} ({error})")
        raise invalid("path", shown, "a CSV file that can be read", "Check it.") from None


def read_csv(
    path: str | Path, spacing: float | None, wanted: FileSpec = FILE
) -> tuple[Floats, Floats, Floats]:
    """Return heights, x and y of a file; with a spacing, the file holds heights alone."""
    lines = csv_rows(path, wanted, csv.reader)
    path, rows = Path(path), [row for row in lines if any(cell.strip() for cell in row)]
    if len({len(row) for row in rows}) != 1:
        shown = described(f"{path.name} with {len(rows)} rows of unequal lengths or none")
        raise invalid("path", shown, "rows of the same length", "Check the file.")
    if spacing is None:
        rows[0][0] = ""  # the corner, which may have a name

    def number(text: str, row: int, column: int) -> float:
        try:
            return float(text if text.strip() else "nan")
        except ValueError:
            shown = described(f"{text!r} in row {row}, column {column} of {path.name}")
            raise invalid("path", shown, "a number", "Correct the file.") from None

    table = np.array(
        [[number(text, i, j) for j, text in enumerate(row, 1)] for i, row in enumerate(rows, 1)]
    )
    if spacing is None:
        return table[1:, 1:], table[1:, 0], table[0, 1:]
    step = positive("spacing", spacing)
    return table, step * np.arange(table.shape[0]), step * np.arange(table.shape[1])


# Meshes: one connected sheet without holes, steep faces or folds.

_STEEPEST = 0.05  # upward part of a face's normal: 87 degrees
_MOST_CELLS = 200  # along the longer side, unless a spacing is given
_MOST_GIVEN = 600
_FORMATS = (".stl", ".obj", ".off", ".ply")
_REMEDY = "Cut the polished side out of the model as one open sheet, z up."


def read_mesh(path: str | Path, scale: float, wanted: FileSpec = FILE) -> Any:
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
        wanted_file = "a mesh that can be read, such as an STL file"
        raise invalid("path", shown, wanted_file, "Check it.") from None
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise _refused("no triangles in space", "a mesh of triangles", "Check the file.")
    if faces.size and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise _refused("faces between corners that are not there", "a mesh", "Export it anew.")
    if not np.all(np.isfinite(vertices)):
        what = f"{int(np.sum(~np.isfinite(vertices).all(axis=1)))} corners that are no numbers"
        raise _refused(what, "finite coordinates", "Export it anew.")
    return checked_mesh(scale * vertices, faces)


def checked_mesh(vertices: Floats, faces: Array) -> Any:
    """Join equal corners and refuse what is no sheet that can be polished from above."""
    import trimesh

    size = float(np.max(np.ptp(vertices, axis=0))) if len(vertices) else 0.0
    if len(faces) < 2 or not size > 0:
        raise _refused(f"{len(faces)} faces", "a mesh of triangles", "Check the file.")
    largest = float(np.max(np.abs(vertices)))
    if not (largest < _TOWN and size > _ATOM):
        shown = described(f"places up to {largest:.3g} m, over {size:.3g} m")
        want = f"a size in metres from {_ATOM:g} to {_TOWN:g}"
        raise invalid("path", shown, want, "Check the unit.")
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
        faces, upward = faces[:, ::-1], -upward
    steep = np.flatnonzero(upward < _STEEPEST)
    if steep.size:
        x, y = 1e3 * vertices[faces[steep[0]], :2].mean(axis=0)
        where = f"one at x = {x:.4g} mm, y = {y:.4g} mm"
        what = f"{steep.size} faces that are vertical or hang over, {where}"
        raise _refused(what, "a surface that is seen from above everywhere", _REMEDY)
    used, renumbered = np.unique(faces, return_inverse=True)
    mesh = trimesh.Trimesh(vertices[used], renumbered.reshape(faces.shape), process=False)
    _check_edges(mesh)
    return mesh


def _check_edges(mesh: Any) -> None:
    """Refuse several pieces, holes, and edges at which more than two faces meet."""
    from trimesh.graph import connected_component_labels

    if mesh.body_count > 1:
        raise _refused(f"{mesh.body_count} pieces", "one connected surface", _REMEDY)
    times = np.bincount(mesh.edges_unique_inverse)
    if times.max() > 2:
        what = "an edge at which more than two faces meet"
        raise _refused(what, "a sheet", "Repair the mesh first.")
    rim = mesh.edges[times[mesh.edges_unique_inverse] == 1]
    label = connected_component_labels(rim, node_count=len(mesh.vertices))[rim[:, 0]]
    loops = [mesh.vertices[rim[label == k], :2] for k in np.unique(label)]  # edges, ends, x and y
    # The outer one has the largest area to its left.
    outer = int(np.argmax([np.sum(np.linalg.det(loop)) for loop in loops]))
    holes = [loop for k, loop in enumerate(loops) if k != outer]
    if holes:
        x, y = 1e3 * holes[0][:, 0].mean(axis=0)
        what = f"{len(holes)} holes, one near x = {x:.4g} mm, y = {y:.4g} mm"
        raise _refused(what, "a surface without holes", "Close them, or cut the mould smaller.")


def _refused(what: str, wanted: str, remedy: str) -> Exception:
    return invalid("path", described(f"a mesh with {what}"), wanted, remedy)


def covered(sheet: Any, spacing: float | None) -> tuple[Floats, Floats, Floats]:
    """Return a grid over a sheet and the heights of its faces there; nan where there is none.

    Without a spacing [m] it is 1.2 times the median length of an edge, so that there are about as
    many vertices as unknowns. Faces above each other are refused.
    """
    corners = np.array(sheet.triangles)
    plan = corners[:, :, :2]
    lengths = np.linalg.norm(plan - np.roll(plan, 1, axis=1), axis=2)
    low, high = plan.min(axis=(0, 1)), plan.max(axis=(0, 1))
    longest = float(np.max(high - low))
    own = max(1.2 * float(np.median(lengths)), longest / _MOST_CELLS)
    step = own if spacing is None else spacing
    if longest / step > _MOST_GIVEN:
        shown = described(f"{longest / step:.0f} cells along a side")
        raise invalid("spacing", shown, f"at most {_MOST_GIVEN}", "Give a larger spacing.")
    ends = zip(low, high, strict=True)
    x, y = (np.linspace(a, b, max(8, round((b - a) / step)) + 1) for a, b in ends)
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


_BENDING = 1e-6  # weight of a squared second difference, where a vertex has weight 1
_FACES = 1e-4  # weight of the faces at a place of the grid


def fitted(sheet: Any, x: Floats, y: Floats, faces: Floats) -> tuple[Floats, float]:
    """Return the coefficients of the spline on a grid, and its largest error at a vertex [m].

    `faces` are the heights of the faces on the grid, nan where there is none.
    """
    rows, columns = x.size + 2, y.size + 2
    vertices = np.array(sheet.vertices)
    knots = tuple(axis[0] + (axis[1] - axis[0]) * np.arange(-3, axis.size + 3) for axis in (x, y))

    def matrix(places: Floats) -> Any:
        """From coefficients to heights at places, shape (n, unknowns)."""
        found: Any = NdBSpline.design_matrix(np.ascontiguousarray(places), knots, 3)
        found.resize(len(places), rows * columns)  # its columns end at the last one in use
        return found

    i, j = np.nonzero(np.isfinite(faces))
    at_vertices, at_faces = matrix(vertices[:, :2]), matrix(np.stack([x[i], y[j]], axis=1))
    one, other = sparse.eye_array(rows), sparse.eye_array(columns)
    parts = [
        (sparse.kron(_difference(rows, 2), other), 1.0),
        (sparse.kron(one, _difference(columns, 2)), 1.0),
        (sparse.kron(_difference(rows, 1), _difference(columns, 1)), 2.0),
    ]
    system = at_vertices.T @ at_vertices + _FACES * (at_faces.T @ at_faces)
    for part, share in parts:
        system = system + _BENDING * share * (part.T @ part)
    middle = float(np.mean(vertices[:, 2]))
    known = at_vertices.T @ (vertices[:, 2] - middle)
    known = known + _FACES * (at_faces.T @ (faces[i, j] - middle))
    symmetric: dict[str, Any] = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    solver = splu(sparse.csc_array(system), permc_spec="MMD_AT_PLUS_A", **symmetric)
    found = solver.solve(known) + middle
    error = at_vertices @ found - vertices[:, 2]
    return found.reshape(rows, columns), float(np.max(np.abs(error)))


def _difference(count: int, order: int) -> sparse.csr_array:
    return sparse.csr_array(np.diff(np.eye(count), order, axis=0))

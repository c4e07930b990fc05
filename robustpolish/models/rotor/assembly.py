"""From parts to matrices: nodes, elements, and what holds the shaft.

One plane has deflection and slope of every node, then what moves within the elements. Both planes
stand one behind the other, (w_x; w_y), in a frame that does not turn. Gyroscopic moments come from
the angular momentum H of the spin, which slopes turn: it pushes the other plane,
G = [[0, H], [-H, 0]].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, null_space

from robustpolish.arrays import Matrix, Vector
from robustpolish.models.rotor.element import inertia, motion, stiffness
from robustpolish.models.rotor.parts import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.models.rotor.second_order import SecondOrder

_SAME_PLACE = 1e-9
"""Two places are one node if they are nearer than this share of the shaft's length."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Nodes along a shaft, and the element between each pair.

    Attributes
    ----------
    nodes : ndarray, shape (n,)
        In m from the first end.
    segments : tuple of ShaftSegment
        The one that each element belongs to, n - 1 of them.
    shear : bool
        Timoshenko's elements, or Euler and Bernoulli's.
    """

    nodes: Vector
    segments: tuple[ShaftSegment, ...]
    shear: bool

    @classmethod
    def of(cls, shaft: Sequence[ShaftSegment], places: Sequence[float], shear: bool) -> Mesh:
        """Divide a shaft, so that each of `places` along it is a node."""
        ends = np.concatenate([[0.0], np.cumsum([segment.length for segment in shaft])])
        near = _SAME_PLACE * ends[-1]
        nodes, owners = [0.0], []
        for segment, start, end in zip(shaft, ends[:-1], ends[1:], strict=True):
            inside = sorted(place for place in places if start + near < place < end - near)
            for stop in (*inside, float(end)):
                if stop - nodes[-1] <= near:
                    continue
                share = (stop - nodes[-1]) / segment.length
                count = max(1, round(share * segment.elements))
                nodes.extend(np.linspace(nodes[-1], stop, count + 1)[1:].tolist())
                owners.extend([segment] * count)
        return cls(np.array(nodes), tuple(owners), shear)

    def phi(self, element: int) -> float:
        """Shear parameter of an element."""
        if not self.shear:
            return 0.0
        length = float(self.nodes[element + 1] - self.nodes[element])
        return self.segments[element].shear_parameter(length)

    @property
    def size(self) -> int:
        """Coordinates of one plane."""
        return 2 * len(self.nodes) + (2 * len(self.segments) if self.shear else 0)

    def of_element(self, element: int) -> NDArray[np.intp]:
        """Return which coordinates of one plane an element has."""
        ends = 2 * element + np.arange(4)
        inner = 2 * (len(self.nodes) + element) + np.arange(2)
        return np.concatenate([ends, inner]) if self.shear else ends

    def motion_at(self, place: float) -> tuple[Vector, Vector]:
        """Return rows that give deflection and slope at a place from one plane's coordinates."""
        last = len(self.nodes) - 1
        deflection, slope = np.zeros(self.size), np.zeros(self.size)
        within = float(np.clip(place, 0.0, self.nodes[-1]))
        i = int(np.clip(np.searchsorted(self.nodes, within, side="right") - 1, 0, last - 1))
        length = float(self.nodes[i + 1] - self.nodes[i])
        share = (within - float(self.nodes[i])) / length
        here = self.of_element(i)
        deflection[here], slope[here] = motion(share, length, self.phi(i))
        return deflection + (place - within) * slope, slope


@dataclass(frozen=True, eq=False)
class Assembly:
    """The rotor's matrices in the coordinates that its supports leave free.

    Attributes
    ----------
    system : SecondOrder
        With 2 n coordinates, those of x before those of y.
    free : ndarray, shape (coordinates, n)
        From free coordinates of one plane to all of them, deflections and slopes of nodes first.
    mesh : Mesh
    """

    system: SecondOrder
    free: Matrix
    mesh: Mesh

    def ports(self, places: Sequence[float]) -> Matrix:
        """Return rows for x of each place, then y of each: outputs, and transposed force inputs."""
        rows = np.array([self.mesh.motion_at(place)[0] for place in places]) @ self.free
        return np.asarray(block_diag(rows, rows))


def assembled(
    mesh: Mesh,
    discs: Sequence[RotorDisc],
    bearings: Sequence[RotorBearing],
    internal_damping: float,
) -> Assembly:
    """Return the rotor's matrices.

    Parameters
    ----------
    mesh : Mesh
    discs : sequence of RotorDisc
    bearings : sequence of RotorBearing
    internal_damping : float
        Damping of the shaft over its stiffness, in s.

    Returns
    -------
    Assembly
    """
    size = mesh.size
    mass, momentum, shaft = (np.zeros((size, size)) for _ in range(3))
    for i, segment in enumerate(mesh.segments):
        length, phi = float(mesh.nodes[i + 1] - mesh.nodes[i]), mesh.phi(i)
        at = mesh.of_element(i)
        here = at[:, None], at
        turning = segment.density * segment.area_moment
        mass[here] += inertia(length, segment.density * segment.area, turning, phi)
        # A round section turns twice as heavily about the axis as about a diameter.
        momentum[here] += inertia(length, 0.0, 2 * turning, phi)
        shaft[here] += stiffness(length, segment.bending_stiffness, phi)
    for disc in discs:
        deflection, slope = mesh.motion_at(disc.position)
        mass += disc.mass * np.outer(deflection, deflection)
        mass += disc.diametral_inertia * np.outer(slope, slope)
        momentum += disc.polar_inertia * np.outer(slope, slope)
    damping, stiff = np.kron(np.eye(2), internal_damping * shaft), np.kron(np.eye(2), shaft)
    held: list[Vector] = []
    for bearing in bearings:
        deflection, slope = mesh.motion_at(bearing.position)
        across, tilting = np.outer(deflection, deflection), np.outer(slope, slope)
        stiff += np.kron(bearing.stiffness_matrix, across)
        damping += np.kron(bearing.damping_matrix, across)
        tilt = 0.0 if bearing.upright else bearing.tilting_stiffness
        stiff += np.kron(np.eye(2), tilt * tilting)
        damping += np.kron(np.eye(2), bearing.tilting_damping * tilting)
        held += [
            row for row, fixed in ((deflection, bearing.pinned), (slope, bearing.upright)) if fixed
        ]
    free = null_space(np.array(held)) if held else np.eye(size)
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    spin, inner = np.kron(turn, momentum), np.kron(turn, internal_damping * shaft)
    # A bearing that couples x and y makes one plane of both.
    apart = not stiff[:size, size:].any() and not stiff[size:, :size].any()
    planes = (size, size) if apart else (2 * size,)
    both: tuple[Any, ...] = (np.kron(np.eye(2), mass), damping, stiff, spin, inner)
    whole = SecondOrder(*both, planes=planes)
    bases = (free, free) if apart else (np.asarray(block_diag(free, free)),)
    return Assembly(whole.projected(*bases), free, mesh)

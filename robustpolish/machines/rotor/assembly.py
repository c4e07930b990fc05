"""From parts to matrices: nodes, elements, and what holds the shaft.

One plane has deflection and slope of every node, then what moves within the elements. Both planes
stand one behind the other, (w_x; w_y), in a frame that does not turn. Gyroscopic moments come from
the angular momentum H of the spin, which slopes turn: it pushes the other plane,
G = [[0, H], [-H, 0]].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigh, null_space

from robustpolish.base.arrays import AnyArray, AnyVector, Matrix, Vector
from robustpolish.base.checks import described, instance_of, invalid, matrix, positive, whole_number

# One beam element in one plane: its shapes, and the matrices that follow from them.
#
# The element has the deflections and slopes of its two ends, (w_1, a_1, w_2, a_2), a = dw/ds of the
# cross-section. The shear parameter phi = 12 E I / (kappa G A l^2) makes it a Timoshenko element;
# phi = 0 is Euler and Bernoulli's.
#
# Where shear counts, the shapes of the ends alone converge with the square of the length only: of
# short elements they become straight lines. So a Timoshenko element has two coordinates more, a
# parabola of deflection and one of slope that vanish at both ends; then both converge with the
# fourth power. Loads at the ends do not bend these shapes, so that statics stay exact.

# Four points integrate polynomials of degree 7; the products of two shapes have degree 6.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def motion(share: float, length: float, phi: float) -> tuple[Vector, Vector]:
    """Return how deflection and slope at a point follow from the coordinates, the inner ones last.

    Those of the ends satisfy the static beam equations exactly, so that loads at the ends deflect
    the element as the theory says, however long it is.

    Parameters
    ----------
    share : float
        Where, from 0 at the first end to 1 at the second.
    length : float
        In m.
    phi : float
        Shear parameter.

    Returns
    -------
    deflection, slope : ndarray, shape (4,), or (6,) with shear
        The slope is that of the cross-section; shear makes the axis steeper.

    References
    ----------
    Nelson (1980), A finite rotating shaft element using Timoshenko beam theory, J. Mech. Design
    102, 793-803; Przemieniecki (1968), Theory of matrix structural analysis, McGraw-Hill.

    Examples
    --------
    >>> deflection, slope = motion(0.5, 0.3, 0.0)
    >>> deflection.round(4).tolist(), slope.round(4).tolist()
    ([0.5, 0.0375, 0.5, -0.0375], [-5.0, -0.25, 5.0, -0.25])
    """
    x, left = share, 1.0 - share
    first, second = 1 + phi - phi * x - 3 * x**2 + 2 * x**3, phi * x + 3 * x**2 - 2 * x**3
    tilt = length * x * left
    deflection = [first, tilt * (left + phi / 2), second, -tilt * (x + phi / 2)]
    steep = 6 * x * left / length
    slope = [-steep, left * (1 + phi - 3 * x), steep, x * (3 * x - 2 + phi)]
    ends = np.array(deflection) / (1 + phi), np.array(slope) / (1 + phi)
    if phi == 0:
        return ends
    inner = 4 * share * left
    return np.append(ends[0], [inner, 0.0]), np.append(ends[1], [0.0, inner])


def stiffness(length: float, bending: float, phi: float) -> Matrix:
    """Return the stiffness matrix, shape (4, 4), or (6, 6) with shear.

    Parameters
    ----------
    length : float
    bending : float
        E I in N m^2.
    phi : float

    Returns
    -------
    ndarray
        In N/m, N and N m.
    """
    s = length
    rows = [
        [12, 6 * s, -12, 6 * s],
        [6 * s, (4 + phi) * s**2, -6 * s, (2 - phi) * s**2],
        [-12, -6 * s, 12, -6 * s],
        [6 * s, (2 - phi) * s**2, -6 * s, (4 + phi) * s**2],
    ]
    ends = bending / ((1 + phi) * s**3) * np.array(rows)
    if phi == 0:
        return ends
    shear = 12 * bending / (phi * s**2)  # kappa G A
    inner = 16 / (3 * s) * np.array([shear, bending + shear * s**2 / 10])
    return np.asarray(block_diag(ends, np.diag(inner)))


def inertia(length: float, line_mass: float, line_inertia: float, phi: float) -> Matrix:
    """Return the consistent mass matrix: what moves, and what turns with the cross-sections.

    Parameters
    ----------
    length : float
    line_mass : float
        Mass per length in kg/m.
    line_inertia : float
        Moment of inertia about a diameter per length, in kg m.
    phi : float

    Returns
    -------
    ndarray, shape (4, 4), or (6, 6) with shear
    """
    size = 4 if phi == 0 else 6
    total = np.zeros((size, size))
    for point, weight in zip(_POINTS, _WEIGHTS, strict=True):
        deflection, slope = motion((1 + point) / 2, length, phi)
        total += weight * line_mass * np.outer(deflection, deflection)
        total += weight * line_inertia * np.outer(slope, slope)
    return length / 2 * total


# What a rotor consists of: lengths of shaft, discs, bearings.

STEEL: dict[str, float] = {"young_modulus": 2.11e11, "shear_modulus": 8.12e10, "density": 7810.0}


@dataclass(frozen=True)
class ShaftSegment:
    """A length of shaft with one cross-section, solid or hollow.

    Parameters
    ----------
    length : float
        In m.
    diameter : float
        Outer diameter in m.
    bore : float, optional
        Inner diameter in m; 0 for a solid shaft.
    young_modulus, shear_modulus : float, optional
        In N/m^2; those of steel by default.
    density : float, optional
        In kg/m^3; 0 neglects the shaft's own mass.
    elements : int, optional
        Into how many beam elements it is divided. Discs and bearings within it divide it further.

    Raises
    ------
    InvalidInputError
        If a size is not positive, the bore not smaller than the diameter, the moduli not those of
        an isotropic material, or the number of elements not a whole one above 0.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rod = rp.rotor.ShaftSegment(0.02, 0.003, young_modulus=2e11)
    >>> round(3 * rod.bending_stiffness / rod.length**3)  # 3 E I / l^3 in N/m
    298206
    """

    length: float
    diameter: float
    bore: float = 0.0
    young_modulus: float = STEEL["young_modulus"]
    shear_modulus: float = STEEL["shear_modulus"]
    density: float = STEEL["density"]
    elements: int = 10

    def __post_init__(self) -> None:
        _checked(self, False, length="m", diameter="m", young_modulus="N/m^2",
                 shear_modulus="N/m^2")  # fmt: skip
        _checked(self, True, bore="m", density="kg/m^3")
        if self.bore >= self.diameter:
            raise invalid("bore", self.bore, "less than the diameter", "Give the inner diameter.")
        if not 0 <= self.poisson_ratio <= 0.5:
            ratio = described(f"a Poisson's ratio of {self.poisson_ratio:.3g}")
            remedy = "Check both moduli: E = 2 (1 + nu) G."
            raise invalid("shear_modulus", ratio, "one between 0 and 0.5", remedy)
        whole_number("elements", self.elements, 1, remedy="Take 10.")

    @property
    def area(self) -> float:
        """Cross-section in m^2."""
        return math.pi / 4 * (self.diameter**2 - self.bore**2)

    @property
    def area_moment(self) -> float:
        """Second moment of area about a diameter in m^4, (8.2) of the thesis."""
        return math.pi / 64 * (self.diameter**4 - self.bore**4)

    @property
    def bending_stiffness(self) -> float:
        """E I in N m^2."""
        return self.young_modulus * self.area_moment

    @property
    def poisson_ratio(self) -> float:
        """From the two moduli, E = 2 (1 + nu) G."""
        return self.young_modulus / (2 * self.shear_modulus) - 1

    @property
    def shear_coefficient(self) -> float:
        """Share of the section that carries shear, Cowper (1966), J. Appl. Mech. 33, 335-340."""
        nu, squared = self.poisson_ratio, (self.bore / self.diameter) ** 2
        full = (1 + squared) ** 2
        return 6 * (1 + nu) * full / ((7 + 6 * nu) * full + (20 + 12 * nu) * squared)

    def shear_parameter(self, length: float) -> float:
        """Return phi = 12 E I / (kappa G A l^2) of an element.

        Parameters
        ----------
        length : float
            Of the element, in m.

        Returns
        -------
        float

        Examples
        --------
        >>> import robustpolish as rp
        >>> round(rp.rotor.ShaftSegment(0.02, 0.003).shear_parameter(0.02), 4)
        0.0495
        """
        shear = self.shear_coefficient * self.shear_modulus * self.area
        return 12 * self.bending_stiffness / (shear * length**2)


@dataclass(frozen=True)
class RotorDisc:
    """A rigid body on the shaft, round about its axis.

    Parameters
    ----------
    position : float
        Where its centre of mass is along the shaft, in m from the first end. Before or behind
        the shaft's ends it sits on a rigid arm.
    mass : float
        In kg.
    diametral_inertia, polar_inertia : float, optional
        Moments of inertia about a diameter and about the shaft, in kg m^2; 0 for a point mass.

    Raises
    ------
    InvalidInputError
        If a value is negative, or the polar inertia more than twice the diametral one, which no
        body has.

    Examples
    --------
    >>> import robustpolish as rp
    >>> disc = rp.rotor.RotorDisc.cylinder(0.5, diameter=0.28, width=0.07, bore=0.05)
    >>> round(disc.mass, 2), round(disc.polar_inertia, 4)
    (32.59, 0.3296)
    """

    position: float
    mass: float
    diametral_inertia: float = 0.0
    polar_inertia: float = 0.0

    def __post_init__(self) -> None:
        _place(self)
        _checked(self, False, mass="kg")
        _checked(self, True, diametral_inertia="kg m^2", polar_inertia="kg m^2")
        if self.polar_inertia > 2 * self.diametral_inertia * (1 + 1e-12):
            want = f"at most twice the diametral inertia, {2 * self.diametral_inertia:.4g} kg m^2"
            raise invalid("polar_inertia", self.polar_inertia, want, "Check which is which.")

    @classmethod
    def cylinder(
        cls,
        position: float,
        *,
        diameter: float,
        width: float,
        bore: float = 0.0,
        mass: float | None = None,
        density: float = STEEL["density"],
    ) -> RotorDisc:
        """Return a cylinder with or without a bore.

        Parameters
        ----------
        position : float
            Of its middle, in m.
        diameter, width, bore : float
            In m.
        mass : float, optional
            In kg; by default from the density.
        density : float, optional
            In kg/m^3; that of steel by default.

        Returns
        -------
        RotorDisc
        """
        d = positive("diameter", diameter, "m")
        b, h = positive("width", width, "m"), positive("bore", bore, "m", zero=True)
        if h >= d:
            raise invalid("bore", bore, "less than the diameter", "Give the inner diameter.")
        volume = math.pi / 4 * (d**2 - h**2) * b
        m = volume * positive("density", density, "kg/m^3") if mass is None else mass
        m = positive("mass", m, "kg")
        about_axis = m / 8 * (d**2 + h**2)
        return cls(position, m, about_axis / 2 + m / 12 * b**2, about_axis)


@dataclass(frozen=True)
class RotorBearing:
    """A spring and a damper between shaft and ground, in both directions.

    Parameters
    ----------
    position : float
        In m from the shaft's first end. Before or behind its ends the bearing holds a rigid arm.
    stiffness : float, pair of float or array_like of shape (2, 2), optional
        In N/m: one for x and y, one each, or with cross-coupling (forces by displacements).
        ``inf`` holds the point in x and y.
    damping : float, pair of float or array_like of shape (2, 2), optional
        In N s/m.
    tilting_stiffness : float, optional
        Against tilting about x and y, in N m/rad; ``inf`` holds the slope.
    tilting_damping : float, optional
        In N m s/rad.

    Raises
    ------
    InvalidInputError
        If a value is of another shape, or negative on the diagonal.

    Examples
    --------
    >>> import math
    >>> import robustpolish as rp
    >>> clamp = rp.rotor.RotorBearing(0.0, math.inf, tilting_stiffness=math.inf)
    >>> rp.rotor.RotorBearing(0.0, (1e6, 8e5)).stiffness_matrix.tolist()
    [[1000000.0, 0.0], [0.0, 800000.0]]
    """

    position: float
    stiffness: float | Sequence[Any] = 0.0
    damping: float | Sequence[Any] = 0.0
    tilting_stiffness: float = 0.0
    tilting_damping: float = 0.0

    def __post_init__(self) -> None:
        _place(self)
        for name in ("stiffness", "damping"):
            if not (name == "stiffness" and self.pinned):
                _in_the_plane(name, getattr(self, name))
        _checked(self, True, tilting_damping="N m s/rad")
        if not self.upright:
            _checked(self, True, tilting_stiffness="N m/rad")

    @property
    def pinned(self) -> bool:
        """Whether it holds x and y."""
        given = self.stiffness
        return isinstance(given, float | int) and math.isinf(given) and given > 0

    @property
    def upright(self) -> bool:
        """Whether it holds the slopes."""
        given = self.tilting_stiffness
        return isinstance(given, float) and math.isinf(given) and given > 0

    @property
    def stiffness_matrix(self) -> Matrix:
        """Forces by displacements in N/m, shape (2, 2); zero where the point is held."""
        return np.zeros((2, 2)) if self.pinned else _in_the_plane("stiffness", self.stiffness)

    @property
    def damping_matrix(self) -> Matrix:
        """Forces by velocities in N s/m, shape (2, 2)."""
        return _in_the_plane("damping", self.damping)


def _in_the_plane(name: str, value: Any) -> Matrix:
    """Return a number, a pair or a matrix as a matrix of x and y."""
    try:
        given = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        given = np.full(0, np.nan)
    if given.shape in ((), (2,)):
        found = np.diag(np.broadcast_to(given, 2))
    else:
        found = matrix(name, value, (2, 2))
    if not np.isfinite(found).all() or (np.diag(found) < 0).any():
        raise invalid(name, value, "finite numbers, none negative for x or y", "Check its sign.")
    return found


def _place(part: RotorDisc | RotorBearing) -> None:
    instance_of("position", part.position, (float, int, np.floating), "a number in m", "Write 0.5.")
    if not math.isfinite(part.position):
        raise invalid("position", part.position, "a finite number in m", "Check it.")
    object.__setattr__(part, "position", float(part.position))


def _checked(part: Any, zero: bool, **units: str) -> None:
    """Set fields to finite floats above zero, or at least zero."""
    for name, unit in units.items():
        object.__setattr__(part, name, positive(name, getattr(part, name), unit, zero=zero))


# Equations of motion with gyroscopic terms, their normal modes, and their state matrix.
#
#     M q'' + (C + speed G) q' + (K + speed N) q = f
#
# M and the symmetric part of K store energy, C takes it out, the skew G turns motion without work,
# and N is what damping inside the shaft does because it turns with the shaft.

_MASSLESS = 1e-14
"""Below this ratio of the lowest squared frequency to its own, a mode has no mass but rounding."""
_LOOSE = 1e-13
"""Below this share of its largest eigenvalue, a scaled stiffness lets the rotor go."""


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """Matrices of the equation of motion, all of shape (n, n), in SI units.

    Attributes
    ----------
    mass, damping, stiffness, gyroscopic, circulatory : ndarray
        M, C, K, G and N.
    planes : tuple of int
        How many coordinates, one behind the other, neither M nor K couples with the rest.
    """

    mass: Matrix
    damping: Matrix
    stiffness: Matrix
    gyroscopic: Matrix
    circulatory: Matrix
    planes: tuple[int, ...]

    def projected(self, *bases: Matrix) -> SecondOrder:
        """Return the equations of the motions that a basis of each plane describes (Galerkin)."""
        basis = np.asarray(block_diag(*bases))
        parts = (self.mass, self.damping, self.stiffness, self.gyroscopic, self.circulatory)
        own = (basis.T @ part @ basis for part in parts)
        return SecondOrder(*own, planes=tuple(each.shape[1] for each in bases))

    @property
    def parts(self) -> list[slice]:
        """Where the coordinates of each plane are."""
        ends = np.cumsum((0, *self.planes))
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def normal_modes(self) -> tuple[Vector, Matrix]:
        """Natural frequencies in rad/s and shapes (n, m) of modal mass 1, at rest and undamped.

        Coordinates without mass move with the others and add no mode. Planes stay apart.
        """
        K = (self.stiffness + self.stiffness.T) / 2
        found = [_normal_modes(self.mass[part, part], K[part, part]) for part in self.parts]
        frequencies = np.concatenate([each for each, _ in found])
        order = np.argsort(frequencies, kind="stable")
        return frequencies[order], np.asarray(block_diag(*(s for _, s in found)))[:, order]

    def response(self, speed: float, s: AnyVector, forces: Matrix, seen: Matrix) -> AnyArray:
        """Return displacements by forces, shape (frequencies, outputs, inputs).

        Parameters
        ----------
        speed : float
        s : ndarray of complex
            Laplace's variable: j times frequencies in rad/s.
        forces, seen : ndarray, shapes (inputs, n) and (outputs, n)
            Rows that give the displacements at which forces act, and those that are seen.

        Returns
        -------
        ndarray of complex
        """
        shapes = self.normal_modes[1]
        stiff, damping = self.normal_forces(speed)
        B, C = (forces @ shapes).T, seen @ shapes
        s = s[:, None, None]
        return C @ np.linalg.solve(stiff + s**2 * np.eye(len(stiff)) + s * damping, B)

    def normal_forces(self, speed: float) -> tuple[Matrix, Matrix]:
        """Return stiffness and damping at a speed in normal coordinates."""
        frequencies, shapes = self.normal_modes
        skew = (self.stiffness - self.stiffness.T) / 2 + speed * self.circulatory
        damping = self.damping + speed * self.gyroscopic
        return shapes.T @ skew @ shapes + np.diag(frequencies**2), shapes.T @ damping @ shapes

    def state_matrix(self, speed: float) -> Matrix:
        """Return A of the states (w_i eta_i, eta_i'), shape (2 m, 2 m).

        eta are the normal coordinates and w_i their frequencies, so that all entries are of one
        size and poles keep their digits. A mode without stiffness takes the lowest other frequency
        for its own.

        Parameters
        ----------
        speed : float
            In rad/s.

        Returns
        -------
        ndarray
        """
        sizes = self.state_scale
        stiff, damping = self.normal_forces(speed)
        return np.block([[np.zeros_like(stiff), np.diag(sizes)], [-stiff / sizes, -damping]])

    @cached_property
    def state_scale(self) -> Vector:
        """What normal coordinates are multiplied by in the states, in rad/s, shape (m,)."""
        frequencies = self.normal_modes[0]
        moving = frequencies[frequencies > 0]
        lowest = moving.min() if moving.size else 1.0
        return np.where(frequencies > 0, frequencies, lowest)


def _normal_modes(mass: Matrix, stiffness: Matrix) -> tuple[Vector, Matrix]:
    sizes = np.sqrt(np.where(np.diag(stiffness) > 0, np.diag(stiffness), 1.0))
    M, K = mass / np.outer(sizes, sizes), stiffness / np.outer(sizes, sizes)
    own = np.linalg.eigvalsh(K)
    shift = 0.0
    if own[0] < _LOOSE * own[-1]:
        # Not held: a little stiffness in proportion to mass moves all squared frequencies alike.
        rough = float(np.trace(K) / np.trace(M)) if M.any() else 0.0
        squares = 1 / _inverse_squares(M, K, rough)[0] - rough
        shift = float(min((s for s in squares if s > 1e-6 * rough), default=rough))
    inverse, shapes = _inverse_squares(M, K, shift)
    squares = 1 / inverse - shift
    squares[np.abs(squares) < 1e-7 * shift] = 0.0
    shapes = shapes / sizes[:, None]
    shapes = shapes / np.sqrt(np.einsum("ij,ij->j", shapes, mass @ shapes))
    return np.sqrt(np.maximum(squares, 0.0)), shapes


def _inverse_squares(M: Matrix, K: Matrix, shift: float) -> tuple[Vector, Matrix]:
    """Return 1 / (w^2 + shift), largest first, and shapes, without those that have no mass."""
    try:
        inverse, shapes = eigh(M, K + shift * M)
    except np.linalg.LinAlgError:
        raise invalid(
            "discs",
            described("a part that nothing holds and that has no mass"),
            "a rotor in which all that is not held has mass and inertia",
            "Give the shaft a density, or the disc a mass and diametral inertia.",
        ) from None
    keep = inverse > _MASSLESS * inverse[-1]
    return inverse[keep][::-1], shapes[:, keep][:, ::-1]


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

    @property
    def size(self) -> int:
        """Coordinates of one plane."""
        return 2 * len(self.nodes) + (2 * len(self.segments) if self.shear else 0)

    def element(self, i: int) -> tuple[float, float, NDArray[np.intp]]:
        """Return length and shear parameter of an element, and its coordinates in one plane."""
        length, ends = float(self.nodes[i + 1] - self.nodes[i]), 2 * i + np.arange(4)
        if not self.shear:
            return length, 0.0, ends
        inner = 2 * (len(self.nodes) + i) + np.arange(2)
        return length, self.segments[i].shear_parameter(length), np.concatenate([ends, inner])

    def motion_at(self, place: float) -> tuple[Vector, Vector]:
        """Return rows that give deflection and slope at a place from one plane's coordinates."""
        deflection, slope = np.zeros(self.size), np.zeros(self.size)
        within = float(np.clip(place, 0.0, self.nodes[-1]))
        behind = np.searchsorted(self.nodes, within, side="right")
        i = int(np.clip(behind - 1, 0, len(self.segments) - 1))
        length, phi, here = self.element(i)
        deflection[here], slope[here] = motion(
            (within - float(self.nodes[i])) / length, length, phi
        )
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
        length, phi, at = mesh.element(i)
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

"""Random plants, ordinary and absurd, each made of a seed and a number alone."""

import zlib
from dataclasses import dataclass, replace

import numpy as np

import robustpolish as rp
from robustpolish.linear.systems import named_system

NAMES = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
# Every fifth plant is absurd.
ABSURD_EVERY = 5
EXTREMES = (5e-324, 1e-310, 1e-160, 1e160, 1e300, 1e308, -1.7e308)


@dataclass(frozen=True, eq=False)
class DrawnPlant:
    """Nine matrices with a word for each thing that is unusual about them."""

    matrices: dict[str, np.ndarray]
    kinds: tuple[str, ...]
    number: int
    seed: int

    @property
    def absurd(self):
        """Whether some of its numbers are beyond reason."""
        return any(kind.startswith("absurd") for kind in self.kinds)

    def plant(self):
        """Return it as a generalised plant; where that is refused, the error comes from us."""
        return rp.GeneralizedPlant.from_matrices(**self.matrices)

    def system(self):
        """Return the part from all inputs to all outputs as a plain system."""
        M = self.matrices
        return plain_system(
            M["A"],
            np.hstack([M["B1"], M["B2"]]),
            np.vstack([M["C1"], M["C2"]]),
            np.block([[M["D11"], M["D12"]], [M["D21"], M["D22"]]]),
        )

    def random(self, purpose):
        """Return the source of random numbers for what is done with the plant."""
        return np.random.default_rng([self.seed, self.number, zlib.crc32(purpose.encode())])

    def __str__(self):
        return f"plant {self.number} of seed {self.seed} ({', '.join(self.kinds) or 'plain'})"


def plain_system(A, B, C, D):
    """Return a continuous system, also one without states, inputs or outputs."""
    counts = {"u": D.shape[1], "y": D.shape[0], "x": len(A)}
    names = ([f"{letter}{i}" for i in range(count)] for letter, count in counts.items())
    return named_system((A, B, C, D), 0, *names)


def drawn_plant(seed, number):
    """Return plant `number` of a seed."""
    random = np.random.default_rng([seed, number])
    nx, nw, nu, nz, ny = (int(random.integers(1, top + 1)) for top in (6, 3, 2, 3, 2))
    shapes = {
        "A": (nx, nx),
        "B1": (nx, nw),
        "B2": (nx, nu),
        "C1": (nz, nx),
        "C2": (ny, nx),
        "D11": (nz, nw),
        "D12": (nz, nu),
        "D21": (ny, nw),
        "D22": (ny, nu),
    }
    matrices = {name: random.standard_normal(shape) for name, shape in shapes.items()}
    for name in ("D11", "D22"):
        if random.random() < 0.7:
            matrices[name] *= 0.0
    plant = DrawnPlant(matrices, (), number, seed)
    for change in _MODEST:
        if random.random() < 0.25:
            plant = _changed(plant, change, random)
    if number % ABSURD_EVERY == ABSURD_EVERY - 1:
        plant = _changed(plant, _ABSURD[int(random.integers(len(_ABSURD)))], random)
    return plant


def _changed(plant, change, random):
    matrices = {name: M.copy() for name, M in plant.matrices.items()}
    change(matrices, random)
    kind = change.__name__.strip("_").replace("_", " ")
    return replace(plant, matrices=matrices, kinds=(*plant.kinds, kind))


def _stable(M, random):
    A = M["A"]
    A -= (np.linalg.eigvals(A).real.max() + random.random()) * np.eye(len(A))


def _badly_scaled(M, random):
    """Scale all variables and time by up to 1e8 each way."""
    nx, nw, nu = len(M["A"]), M["B1"].shape[1], M["B2"].shape[1]
    nz, ny = len(M["C1"]), len(M["C2"])
    x, w, u, z, y = (10.0 ** random.uniform(-8, 8, n) for n in (nx, nw, nu, nz, ny))
    rate = 10.0 ** random.uniform(-5, 5)
    _in_units(M, {"x": x, "w": w, "u": u, "z": z, "y": y}, rate)


def _in_units(M, units, rate):
    row = {"A": "x", "B1": "x", "B2": "x", "C1": "z", "D11": "z", "D12": "z"}
    column = {"A": "x", "B1": "w", "B2": "u", "C1": "x", "C2": "x", "D11": "w", "D12": "u"}
    for name in M:
        left, right = (
            units[row.get(name, "y")],
            units[column.get(name, "w" if "1" in name else "u")],
        )
        M[name] = M[name] * right / left[:, None] * (rate if row.get(name) == "x" else 1.0)


def _singular_d12(M, random):
    M["D12"][:, 0] *= 0.0


def _singular_d21(M, random):
    M["D21"][0] *= 0.0


def _no_price_and_no_noise(M, random):
    M["D12"] *= 0.0
    M["D21"] *= 0.0


def _zeros_on_the_axis(M, random):
    """Give the first state dynamics of its own with a zero at 0 from u to z and w to y."""
    M["A"][0, :] = 0.0
    M["A"][0, 0] = -random.random()
    M["C1"][:, 0] *= 0.0
    M["B1"][0] *= 0.0


def _poles_on_the_axis(M, random):
    n = len(M["A"])
    if n > 1:
        M["A"][:2, :] = 0.0
        M["A"][0, 1], M["A"][1, 0] = 1.0, -random.integers(0, 3)
    else:
        M["A"][:] = 0.0


def _uncontrollable(M, random):
    M["A"][-1, :-1] = 0.0
    M["B2"][-1] = 0.0


def _unobservable(M, random):
    M["A"][:-1, -1] = 0.0
    M["C2"][:, -1] = 0.0


def _repeated_poles(M, random):
    M["A"] = np.triu(np.sign(M["A"]))


_MODEST = (
    _stable,
    _singular_d12,
    _singular_d21,
    _no_price_and_no_noise,
    _zeros_on_the_axis,
    _poles_on_the_axis,
    _uncontrollable,
    _unobservable,
    _repeated_poles,
    _badly_scaled,
)


def _extreme(random):
    if random.random() < 0.5:
        return float(random.choice(EXTREMES))
    sign = -1.0 if random.random() < 0.5 else 1.0
    return float(10.0 ** (sign * random.uniform(100, 308)))


def _absurd_entry(M, random):
    name = NAMES[int(random.integers(9))]
    if M[name].size:
        M[name].flat[int(random.integers(M[name].size))] = _extreme(random)


def _absurd_matrix(M, random):
    name = NAMES[int(random.integers(9))]
    with np.errstate(all="ignore"):
        M[name] = np.clip(M[name] * _extreme(random), -1.7e308, 1.7e308)


def _absurd_everywhere(M, random):
    for name in M:
        exponents = random.uniform(-300, 300, M[name].shape)
        M[name] = M[name] * 10.0**exponents


def _absurd_units(M, random):
    """Scale variables as one would for other units, so that the plant itself is ordinary."""
    big = random.uniform(20, 70)
    sizes = {"x": len(M["A"]), "w": M["B1"].shape[1], "u": M["B2"].shape[1]}
    sizes |= {"z": len(M["C1"]), "y": len(M["C2"])}
    units = {name: 10.0 ** random.uniform(-big, big, n) for name, n in sizes.items()}
    _in_units(M, units, 10.0 ** random.uniform(-big, big))


def _absurd_whole(M, random):
    factor = _extreme(random)
    with np.errstate(all="ignore"):
        for name in M:
            M[name] = np.clip(M[name] * factor, -1.7e308, 1.7e308)


def _absurd_zeros(M, random):
    for name in NAMES:
        if random.random() < 0.7:
            M[name] *= 0.0


def _absurd_nothing(M, random):
    """Take all states, or all signals of a kind, away."""
    which = "xwuzy"[int(random.integers(5))]
    axes = {
        "x": {"A": (0, 1), "B1": (0,), "B2": (0,), "C1": (1,), "C2": (1,)},
        "w": {"B1": (1,), "D11": (1,), "D21": (1,)},
        "u": {"B2": (1,), "D12": (1,), "D22": (1,)},
        "z": {"C1": (0,), "D11": (0,), "D12": (0,)},
        "y": {"C2": (0,), "D21": (0,), "D22": (0,)},
    }[which]
    for name, along in axes.items():
        for axis in along:
            M[name] = np.take(M[name], [], axis=axis)


_ABSURD = (
    _absurd_entry,
    _absurd_entry,
    _absurd_matrix,
    _absurd_everywhere,
    _absurd_units,
    _absurd_whole,
    _absurd_zeros,
    _absurd_nothing,
)

"""A loop with a witness in it, in arithmetic of more than 50 digits."""

import flint
import numpy as np

from robustpolish.linear.arithmetic.balls import precision

BITS = 250


def closed(loop, witness):
    """A of the loop with a witness in it, and its response at a frequency: as functions.

    Numbers of the witness and all matrices are taken as they are; only this is computed anew.
    """
    one, n = loop.matrices, loop.nstates
    parts = [_delta(block, witness[block.element.name]) for block in loop.blocks]
    a, b, c, d = (_diagonal([part[i] for part in parts]) for i in range(4))
    A, B = _flint(one.F[:n, :n]), _flint(one.F[:n, n:])
    C, D = _flint(one.F[n:, :n]), _flint(one.F[n:, n:])
    B2, C2 = _flint(one.G[:n]), _flint(one.H[:, :n])
    D12, D21, D22 = _flint(one.G[n:]), _flint(one.H[:, n:]), _flint(one.J)
    # z = C x + D w + D12 u, w = c s + d z, s' = a s + b z: solved for z
    back = (_eye(D.nrows()) - D * d).inv()
    zx, zs, zu = back * C, back * D * c, back * D12
    rows = [[A + B * d * zx, B * (c + d * zs)], [b * zx, a + b * zs]]
    into = [B2 + B * d * zu, b * zu]
    out = [C2 + D21 * d * zx, D21 * (c + d * zs)]
    return _joined(rows), _joined([[one] for one in into]), _joined([out]), D22 + D21 * d * zu


def distance(loop, witness):
    """The least distance of a pole from the boundary of stability, relative to its size."""
    with precision(BITS):
        found = closed(loop, witness)[0].eig(algorithm="approx")
        return min(float(abs(pole.real) / abs(pole)) for pole in found)


def gain(loop, witness, omega):
    """The largest singular value at a frequency."""
    with precision(BITS):
        A, B, C, D = closed(loop, witness)
        value = D + C * (flint.acb(0, omega) * _eye(A.nrows()) - A).inv() * B
        whole = np.array([[complex(entry) for entry in row] for row in value.tolist()])
        return float(np.linalg.norm(whole, 2))


def _delta(block, value):
    """a, b, c, d of all copies of a block; of a complex number the value alone."""
    element, copies = block.element, block.copies
    if hasattr(value, "A"):
        return tuple(_flint(np.kron(np.eye(copies), getattr(value, name))) for name in "ABCD")
    if element.kind == "real":
        change = flint.arb(value) - flint.arb(element.nominal)
        delta = change / (flint.arb(element.slope) + flint.arb(element.skew) * change)
    else:
        delta = (flint.acb(value) - element.nominal) / element.radius
    return (
        flint.acb_mat(0, 0),
        flint.acb_mat(0, copies),
        flint.acb_mat(copies, 0),
        _eye(copies) * delta,
    )


def _flint(matrix):
    array = np.atleast_2d(np.asarray(matrix, dtype=complex))
    return flint.acb_mat(array.shape[0], array.shape[1], array.ravel().tolist())


def _eye(n):
    return _flint(np.eye(n)) if n else flint.acb_mat(0, 0)


def _diagonal(parts):
    rows, columns = sum(p.nrows() for p in parts), sum(p.ncols() for p in parts)
    whole, i, j = flint.acb_mat(rows, columns), 0, 0
    for part in parts:
        for k in range(part.nrows()):
            for m in range(part.ncols()):
                whole[i + k, j + m] = part[k, m]
        i, j = i + part.nrows(), j + part.ncols()
    return whole


def _joined(table):
    rows, columns = sum(line[0].nrows() for line in table), sum(one.ncols() for one in table[0])
    whole, i = flint.acb_mat(rows, columns), 0
    for line in table:
        j = 0
        for part in line:
            for k in range(part.nrows()):
                for m in range(part.ncols()):
                    whole[i + k, j + m] = part[k, m]
            j += part.ncols()
        i += line[0].nrows()
    return whole

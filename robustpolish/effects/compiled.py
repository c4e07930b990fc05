"""Force laws as machine code that kernels call by address.

All laws have one signature, of plain pointers: a kernel compiled for each law anew would fill
Numba's cache with an entry from every process, and arrays as arguments would cost more than most
laws do.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import lru_cache
from typing import Any, Protocol, runtime_checkable

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from robustpolish.compiling import cache_of
from robustpolish.effects.kind import EffectKind
from robustpolish.validation import invalid

POINTER = types.CPointer(types.float64)
"""How a law sees motions, internal states, parameters, forces and rates."""
_ARRAY = types.float64[::1]
_SIGNATURE = types.void(types.float64, *[POINTER] * 6)


@runtime_checkable
class CompilesItself(Protocol):
    """A law that no file holds as a function, and that therefore compiles itself."""

    def compiled(self) -> Any:
        """Return the law as :func:`machine_code` does."""
        ...


def machine_code(law: Callable[..., None], cache: bool = True) -> Any:
    """Return a law ``law(t, q, v, z, p, f, dz)`` as a C function with an ``address``.

    Parameters
    ----------
    law : callable
        It reads and writes single entries of what it is given, and asks for no lengths.
    cache : bool, optional
        Whether a file keeps the result for the next process.
    """
    with cache_of(law) if cache else nullcontext():
        return numba.cfunc(_SIGNATURE, cache=cache, error_model="numpy")(law)


@lru_cache(maxsize=256)
def compiled_law(kind: EffectKind) -> Any:
    """Return the law of a kind as a C function; its address holds as long as it is kept."""
    if kind.law is None:
        raise invalid("kind", kind.kind, "an effect with a force law", "Choose another kind.")
    if isinstance(kind.law, CompilesItself):
        return kind.law.compiled()
    return machine_code(kind.law)


def _call(typing_context, address, t, q, iq, v, iv, z, iz, p, ip, f, jf, dz, jz):  # type: ignore[no-untyped-def]  # compiled
    """Call the law at an address; every array comes with the entry at which the law's own begin."""
    places = [_ARRAY, types.intp] * 6

    def generate(context, builder, _, given):  # type: ignore[no-untyped-def]
        number = ir.DoubleType()
        pointers = [
            builder.gep(context.make_array(_ARRAY)(context, builder, array).data, [first])
            for array, first in zip(given[2::2], given[3::2], strict=True)
        ]
        law = ir.FunctionType(ir.VoidType(), [number, *[number.as_pointer()] * 6])
        builder.call(builder.inttoptr(given[0], law.as_pointer()), [given[1], *pointers])
        return context.get_dummy_value()

    return types.void(types.intp, types.float64, *places), generate


call_law: Any = intrinsic(_call)

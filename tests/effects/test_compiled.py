"""Laws as machine code, called by address."""

import ctypes

import numba
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.effect import lookup
from robustpolish.machines.effects.evaluate import call_law, compiled_law
from robustpolish.machines.effects.kind import EffectKind, Parameter


def test_a_law_may_compile_itself():
    class Pull:
        def __call__(self, t, q, v, z, p, f, dz):
            f[0] = -p[0]

        def compiled(self):
            return "compiled by itself"

    kind = EffectKind("pull", "Pull", "pair", (Parameter("force", "F", "of it"),), Pull())
    assert compiled_law(kind) == "compiled by itself"


def test_a_law_is_compiled_once_and_does_what_its_source_says():
    law = compiled_law(lookup("cubic_stiffness"))
    assert law is compiled_law(lookup("cubic_stiffness"))
    q, v, p, f, none = np.array([2.0]), np.zeros(1), np.array([3.0]), np.zeros(1), np.zeros(1)
    pointer = ctypes.POINTER(ctypes.c_double)
    law.ctypes(0.0, *(a.ctypes.data_as(pointer) for a in (q, v, none, p, f, none)))
    assert f[0] == -24.0


def test_a_kernel_calls_a_law_somewhere_within_its_arrays():
    @numba.njit
    def kernel(law, q, v, z, p, f, dz):
        call_law(law, 0.0, q, 2, v, 1, z, 0, p, 1, f, 3, dz, 0)

    q, v, p = np.array([9.0, 9.0, 2.0]), np.zeros(2), np.array([9.0, 3.0])
    f, none = np.zeros(5), np.zeros(0)
    kernel(compiled_law(lookup("cubic_stiffness")).address, q, v, none, p, f, none)
    assert f.tolist() == [0.0, 0.0, 0.0, -24.0, 0.0]


def test_a_kind_without_a_force_law_has_no_code():
    with pytest.raises(InvalidInputError, match="sensor_offset"):
        compiled_law(lookup("sensor_offset"))

"""Two things that kernels cannot say in Python. Without the compiler (``NUMBA_DISABLE_JIT``) plain functions stand in.

==========  ======================================================================================================
name        meaning
==========  ======================================================================================================
muladd      a * b + c, rounded once where the processor can; a loop of these is vectorised
borrowed    the same array without its reference count, which every function that is given the array would raise and
            lower with a locked instruction (half the time of a kernel of small functions); the caller keeps it alive
==========  ======================================================================================================
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def _muladd(_context, a, b, c):
    def code(context, builder, signature, args):
        shape = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()] * 3)
        return builder.call(cgutils.get_or_insert_function(builder.module, shape, "llvm.fmuladd.f64"), args)

    return types.float64(types.float64, types.float64, types.float64), code


@intrinsic
def _borrowed(_context, array):
    def code(context, builder, signature, args):
        meminfo = args[0].type.elements[0]  # the first member of an array
        return builder.insert_value(args[0], cgutils.get_null_value(meminfo), 0)

    return array(array), code


def _plain_muladd(a, b, c):
    return a * b + c


def _plain_borrowed(array):
    return array


_INTERPRETED: bool = config.DISABLE_JIT  # pyright: ignore[reportAttributeAccessIssue]

muladd: Any = _plain_muladd if _INTERPRETED else _muladd
borrowed: Any = _plain_borrowed if _INTERPRETED else _borrowed

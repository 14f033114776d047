"""Eight float64 lanes as one value inside kernels.

A plain loop is vectorised only when the compiler can rule out that its arrays overlap, which it gives up with more
than a few of them. These operations are vectors from the start; the processor's own width is chosen below them, by the
compiler. Without the compiler (``NUMBA_DISABLE_JIT``) NumPy does the same on slices.

=============  ===========================================================
name           meaning, x a 1-D array, i an index, a b c lanes
=============  ===========================================================
load, store    x[i : i + 8], and its assignment
store_pairs    x[i : i + 16] = a[0], b[0], a[1], b[1], ...
splat          one number in all lanes
add, sub, mul  a + b, a - b, a * b
fma            a * b + c, rounded once where the processor can
=============  ===========================================================
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, config, types
from numba.extending import intrinsic, models, register_model

WIDTH = 8
_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)


class _Lanes(types.Type):
    def __init__(self):
        super().__init__(name="float64x8")


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _VECTOR)


_LANES = _Lanes()


def _pointer(context, builder, array_type, array, index):
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def _shuffle(builder, a, b, order):
    mask = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [ir.Constant(ir.IntType(32), i) for i in order])
    return builder.shuffle_vector(a, b, mask)


@intrinsic
def _load(_context, x, i):
    def code(context, builder, signature, args):
        value = builder.load(_pointer(context, builder, signature.args[0], args[0], args[1]))
        value.align = 8
        return value

    return _LANES(x, types.intp), code


@intrinsic
def _store(_context, x, i, a):
    def code(context, builder, signature, args):
        pointer = _pointer(context, builder, signature.args[0], args[0], args[1])
        builder.store(args[2], pointer, align=8)
        return context.get_dummy_value()

    return types.void(x, types.intp, _LANES), code


@intrinsic
def _store_pairs(_context, x, i, a, b):
    def code(context, builder, signature, args):
        pointer = _pointer(context, builder, signature.args[0], args[0], args[1])
        order = [lane // 2 + WIDTH * (lane % 2) for lane in range(2 * WIDTH)]
        for half in range(2):
            pairs = _shuffle(builder, args[2], args[3], order[WIDTH * half : WIDTH * (half + 1)])
            place = builder.gep(pointer, [ir.Constant(ir.IntType(64), half)])
            builder.store(pairs, place, align=8)
        return context.get_dummy_value()

    return types.void(x, types.intp, _LANES, _LANES), code


@intrinsic
def _splat(_context, value):
    def code(context, builder, signature, args):
        one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), args[0], ir.Constant(ir.IntType(32), 0))
        return _shuffle(builder, one, one, [0] * WIDTH)

    return _LANES(types.float64), code


def _binary(operation) -> Any:
    @intrinsic
    def operate(_context, a, b):
        def code(context, builder, signature, args):
            return getattr(builder, operation)(*args)

        return _LANES(_LANES, _LANES), code

    return operate


@intrinsic
def _fma(_context, a, b, c):
    def code(context, builder, signature, args):
        shape = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        function = cgutils.get_or_insert_function(builder.module, shape, f"llvm.fmuladd.v{WIDTH}f64")
        return builder.call(function, args)

    return _LANES(_LANES, _LANES, _LANES), code


def _plain_load(x, i):
    return x[i : i + WIDTH].copy()


def _plain_store(x, i, a):
    x[i : i + WIDTH] = a


def _plain_store_pairs(x, i, a, b):
    x[i : i + 2 * WIDTH : 2], x[i + 1 : i + 2 * WIDTH : 2] = a, b


def _plain_splat(value):
    return np.full(WIDTH, value)


def _plain_fma(a, b, c):
    return a * b + c


_PLAIN: tuple[Any, ...] = (_plain_load, _plain_store, _plain_store_pairs, _plain_splat, _plain_fma)
_COMPILED: tuple[Any, ...] = (_load, _store, _store_pairs, _splat, _fma)

_INTERPRETED: bool = config.DISABLE_JIT  # pyright: ignore[reportAttributeAccessIssue]

load, store, store_pairs, splat, fma = _PLAIN if _INTERPRETED else _COMPILED
add: Any = np.add if _INTERPRETED else _binary("fadd")
sub: Any = np.subtract if _INTERPRETED else _binary("fsub")
mul: Any = np.multiply if _INTERPRETED else _binary("fmul")

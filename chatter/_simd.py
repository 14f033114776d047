"""Eight float64 lanes as one value inside kernels, and bare memory.

A plain loop is vectorised only when the compiler can rule out that its arrays overlap, which it gives up with more
than a few of them. These operations are vectors from the start; the processor's own width is chosen below them, by the
compiler. Memory has neither a length nor a count of its users: nothing is checked, so nothing is spent on it. Without
the compiler (``NUMBA_DISABLE_JIT``) NumPy does the same on slices.

===============  ===========================================================
name             meaning, m memory, i an index, a b c lanes
===============  ===========================================================
memory           the numbers of a contiguous float64 or complex128 array
get, put         m[i], and its assignment
load, store      m[i : i + 8], and its assignment
store_pairs      m[i : i + 16] = a[0], b[0], a[1], b[1], ...
splat, spread    one number, and m[i], in all lanes
add, sub, mul    a + b, a - b, a * b
fma              a * b + c, rounded once where the processor can
larger           the larger of a and b
scan             for each lane of a the sum of those up to it
scan_back        for each lane of a the sum of those from it on
first, last      the first, or last, lane of a in all lanes
===============  ===========================================================
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, config, types
from numba.extending import intrinsic, models, register_model

WIDTH = 8
_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_MEMORY = types.CPointer(types.float64)


class _Lanes(types.Type):
    def __init__(self):
        super().__init__(name="float64x8")


@register_model(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, _VECTOR)


_LANES = _Lanes()


def _lanes_at(builder, memory, index):
    return builder.bitcast(builder.gep(memory, [index]), _VECTOR.as_pointer())


def _shuffle(builder, a, b, order):
    mask = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [ir.Constant(ir.IntType(32), i) for i in order])
    return builder.shuffle_vector(a, b, mask)


def _in_all(builder, value):
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    return _shuffle(builder, one, one, [0] * WIDTH)


@intrinsic
def _memory(_context, array):
    def code(context, builder, signature, args):
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        return builder.bitcast(data, ir.DoubleType().as_pointer())

    return _MEMORY(array), code


@intrinsic
def _get(_context, m, i):
    def code(_, builder, _signature, args):
        return builder.load(builder.gep(args[0], [args[1]]))

    return types.float64(_MEMORY, types.intp), code


@intrinsic
def _put(_context, m, i, value):
    def code(context, builder, _signature, args):
        builder.store(args[2], builder.gep(args[0], [args[1]]))
        return context.get_dummy_value()

    return types.void(_MEMORY, types.intp, types.float64), code


@intrinsic
def _load(_context, m, i):
    def code(_, builder, _signature, args):
        value = builder.load(_lanes_at(builder, *args))
        value.align = 8
        return value

    return _LANES(_MEMORY, types.intp), code


@intrinsic
def _store(_context, m, i, a):
    def code(context, builder, _signature, args):
        builder.store(args[2], _lanes_at(builder, *args[:2]), align=8)
        return context.get_dummy_value()

    return types.void(_MEMORY, types.intp, _LANES), code


@intrinsic
def _store_pairs(_context, m, i, a, b):
    def code(context, builder, _signature, args):
        pointer = _lanes_at(builder, *args[:2])
        order = [lane // 2 + WIDTH * (lane % 2) for lane in range(2 * WIDTH)]
        for half in range(2):
            pairs = _shuffle(builder, args[2], args[3], order[WIDTH * half : WIDTH * (half + 1)])
            place = builder.gep(pointer, [ir.Constant(ir.IntType(64), half)])
            builder.store(pairs, place, align=8)
        return context.get_dummy_value()

    return types.void(_MEMORY, types.intp, _LANES, _LANES), code


@intrinsic
def _splat(_context, value):
    def code(_, builder, _signature, args):
        return _in_all(builder, args[0])

    return _LANES(types.float64), code


@intrinsic
def _spread(_context, m, i):
    def code(_, builder, _signature, args):
        return _in_all(builder, builder.load(builder.gep(args[0], [args[1]])))

    return _LANES(_MEMORY, types.intp), code


def _binary(operation) -> Any:
    @intrinsic
    def operate(_context, a, b):
        def code(_, builder, _signature, args):
            return getattr(builder, operation)(*args)

        return _LANES(_LANES, _LANES), code

    return operate


@intrinsic
def _larger(_context, a, b):
    def code(_, builder, _signature, args):
        return builder.select(builder.fcmp_ordered(">", *args), *args)

    return _LANES(_LANES, _LANES), code


def _scanned(steps) -> Any:
    @intrinsic
    def scan(_context, a):
        def code(_, builder, _signature, args):
            total = args[0]
            for step in steps:  # a rotation and an addition in some lanes: the processor has both
                order = [(lane - step) % WIDTH for lane in range(WIDTH)]
                there = ir.Constant(ir.VectorType(ir.IntType(1), WIDTH), [0 <= k - step < WIDTH for k in range(WIDTH)])
                total = builder.select(there, builder.fadd(total, _shuffle(builder, total, total, order)), total)
            return total

        return _LANES(_LANES), code

    return scan


def _all_of(lane) -> Any:
    @intrinsic
    def pick(_context, a):
        def code(_, builder, _signature, args):
            return _shuffle(builder, args[0], args[0], [lane] * WIDTH)

        return _LANES(_LANES), code

    return pick


@intrinsic
def _fma(_context, a, b, c):
    def code(_, builder, _signature, args):
        shape = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        function = cgutils.get_or_insert_function(builder.module, shape, f"llvm.fmuladd.v{WIDTH}f64")
        return builder.call(function, args)

    return _LANES(_LANES, _LANES, _LANES), code


def _plain_memory(array):
    return array.view(np.float64).reshape(-1)


def _plain_get(m, i):
    return m[i]


def _plain_put(m, i, value):
    m[i] = value


def _plain_load(m, i):
    return m[i : i + WIDTH].copy()


def _plain_store(m, i, a):
    m[i : i + WIDTH] = a


def _plain_store_pairs(m, i, a, b):
    m[i : i + 2 * WIDTH : 2], m[i + 1 : i + 2 * WIDTH : 2] = a, b


def _plain_splat(value):
    return np.full(WIDTH, value)


def _plain_spread(m, i):
    return np.full(WIDTH, m[i])


def _plain_fma(a, b, c):
    return a * b + c


def _plain_scanned(steps) -> Any:
    def scan(a):
        total = a.copy()
        for step in steps:
            moved = np.roll(total, step)
            there = [0 <= k - step < WIDTH for k in range(WIDTH)]
            total[there] += moved[there]
        return total

    return scan


def _plain_all_of(lane) -> Any:
    return lambda a: np.full(WIDTH, a[lane])


_PLAIN: tuple[Any, ...] = (
    _plain_memory, _plain_get, _plain_put, _plain_load, _plain_store, _plain_store_pairs, _plain_splat, _plain_spread,
    _plain_fma, np.add, np.subtract, np.multiply, np.maximum, _plain_scanned((1, 2, 4)), _plain_scanned((-1, -2, -4)),
    _plain_all_of(0), _plain_all_of(WIDTH - 1),
)  # fmt: skip
_COMPILED: tuple[Any, ...] = (
    _memory, _get, _put, _load, _store, _store_pairs, _splat, _spread,
    _fma, _binary("fadd"), _binary("fsub"), _binary("fmul"), _larger, _scanned((1, 2, 4)), _scanned((-1, -2, -4)),
    _all_of(0), _all_of(WIDTH - 1),
)  # fmt: skip

_INTERPRETED: bool = config.DISABLE_JIT  # pyright: ignore[reportAttributeAccessIssue]

(memory, get, put, load, store, store_pairs, splat, spread, fma, add, sub, mul, larger, scan, scan_back, first,
 last) = _PLAIN if _INTERPRETED else _COMPILED  # fmt: skip

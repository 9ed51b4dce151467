"""Calling compiled right-hand sides by address.

The integrators take a limb's program as numbers. Numba would take functions too, but looks up
their types anew at every call, which costs more than a whole tick.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from llvmlite import ir
from numba import cfunc, types
from numba.core import cgutils
from numba.extending import intrinsic

f8, i8 = types.float64, types.int64
numbers, whole_numbers = types.CPointer(f8), types.CPointer(i8)
# t, y, parameters, index, input, rows of input, context, result
SIGNATURE = types.void(f8, numbers, numbers, whole_numbers, numbers, i8, numbers, numbers)


class Callback:
    """A function that is compiled, or loaded, when its address is first asked for."""

    def __init__(self, function: Callable[..., None], signature: Any = SIGNATURE) -> None:
        self.function = function
        self.signature = signature

    @cached_property
    def compiled(self) -> Any:
        """The compiled function, kept on disk between processes."""
        return cfunc(self.signature, cache=True, error_model="numpy")(self.function)

    @property
    def address(self) -> int:
        """Where the compiled function is."""
        return int(self.compiled.address)


def callback(*arguments: Any) -> Callable[[Callable[..., None]], Callback]:
    """Makes a `Callback` of a function with arguments of other types."""
    return lambda function: Callback(function, types.void(*arguments))


@intrinsic
def invoke(typingctx, address, *arguments):
    """Call the function at `address` with numbers, and for each array with where its numbers are."""
    signature = types.none(address, types.StarArgTuple(arguments))

    def generate(context, builder, signature, given):
        kinds, values = [], []
        tuple_type = signature.args[1]
        for index, kind in enumerate(tuple_type):
            value = builder.extract_value(given[1], index)
            if isinstance(kind, types.Array):
                value = context.make_array(kind)(context, builder, value).data
            kinds.append(value.type)
            values.append(value)
        function = builder.inttoptr(given[0], ir.FunctionType(ir.VoidType(), kinds).as_pointer())
        builder.call(function, values)
        return context.get_dummy_value()

    return signature, generate


@intrinsic
def call(typingctx, address, t, y, p, k, u, c, out):
    """Call the right-hand side at `address`: rates `out` at time t and state y."""
    signature = types.void(address, t, y, p, k, u, c, out)

    def generate(context, builder, signature, arguments):
        double, integer = ir.DoubleType(), ir.IntType(64)
        pointer, integers = double.as_pointer(), integer.as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [double, pointer, pointer, integers, pointer, integer, pointer, pointer])
        arrays = [
            context.make_array(array_type)(context, builder, value)
            for array_type, value in zip(signature.args[2:], arguments[2:], strict=True)
        ]
        y_, p_, k_, u_, c_, out_ = arrays
        rows = cgutils.unpack_tuple(builder, u_.shape)[0]
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        builder.call(function, [arguments[1], y_.data, p_.data, k_.data, u_.data, rows, c_.data, out_.data])
        return context.get_dummy_value()

    return signature, generate

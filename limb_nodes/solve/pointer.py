"""Calling compiled functions by address.

The integrators take a limb's program, and the driver takes a method, as numbers. Numba would take functions too,
but looks up their types anew at every call, which costs more than a whole tick.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic

f8, i8 = types.float64, types.int64
numbers = types.CPointer(f8)


class Callback:
    """A function that is compiled, or loaded, when its address is first asked for. arguments: their numba types."""

    def __init__(self, function: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        self.function = function
        self.signature = types.void(*arguments)

    @cached_property
    def compiled(self) -> Any:
        """The compiled function, kept on disk between processes."""
        return cfunc(self.signature, cache=True, error_model="numpy")(self.function)

    @property
    def address(self) -> int:
        """Where the compiled function is."""
        return int(self.compiled.address)


def callback(*arguments: Any) -> Callable[[Callable[..., None]], Callback]:
    """Makes a `Callback` of a function with arguments of these types."""
    return lambda function: Callback(function, arguments)


@intrinsic
def invoke(typingctx, address, *arguments):
    """Call the function at `address` with numbers, and with the address of the numbers of each array or record."""
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
def numbers_at(typingctx, address):
    """The float64 numbers at an address, as a pointer for `carray`."""

    def generate(context, builder, signature, given):
        return builder.inttoptr(given[0], context.get_value_type(signature.return_type))

    return numbers(address), generate


def _record_at(typingctx, address, kind):
    """The record of a numba type at an address."""

    def generate(context, builder, signature, given):
        return builder.inttoptr(given[0], context.get_value_type(signature.return_type))

    return kind.instance_type(address, kind), generate


record_at: Any = intrinsic(_record_at)

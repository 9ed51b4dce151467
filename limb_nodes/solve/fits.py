"""Whether a serialised message looks like another one and holds the numbers that it may, compiled."""

from __future__ import annotations

from numba import njit, types

BYTES = types.Array(types.uint8, 1, "C", readonly=True)
PLACES = types.int64[::1]
# Bits of a double: its exponent, 1, and -0.
EXPONENT, ONE, MINUS_ZERO = 0x7FF0000000000000, 0x3FF0000000000000, 0x8000000000000000
LIKE, OTHER_FORM, OTHER_NUMBERS = 0, 1, 2


@njit(types.int64(BYTES, BYTES, PLACES, PLACES, types.boolean), cache=True)
def fits(data, example, constant, numbers, share):
    """Whether a message is like an example.

    data, example: bytes. constant: where they must be the same. numbers: where doubles stand that must be finite, or
    from 0 to 1 if they are a share.
    """
    if data.size != example.size:
        return OTHER_FORM
    for at in constant:
        if data[at] != example[at]:
            return OTHER_FORM
    for at in numbers:
        bits = types.uint64(0)
        for k in range(8):
            bits |= types.uint64(data[at + k]) << types.uint64(8 * k)
        if share:
            good = bits <= types.uint64(ONE) or bits == types.uint64(MINUS_ZERO)
        else:
            good = bits & types.uint64(EXPONENT) != types.uint64(EXPONENT)
        if not good:
            return OTHER_NUMBERS
    return LIKE

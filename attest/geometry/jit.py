"""Compilation of kernels, cached on disk where there is a disk to cache on."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a function of scalars, tuples and arrays for the machine.

    Compiled code is kept beside the source or in the user's cache folder; where neither can be
    written, it is compiled anew in each process.
    """
    # numpy's error model: a division by zero gives infinity, and costs no branch
    compiled = numba.njit(nogil=True, error_model="numpy")
    try:
        cached = numba.njit(nogil=True, error_model="numpy", cache=True)
        return cast(F, cached(function))
    except RuntimeError:  # numba: "cannot cache function: no locator available"
        return cast(F, compiled(function))

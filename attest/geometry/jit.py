"""Compilation of kernels, cached on disk where there is a disk to cache on."""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a function of scalars, tuples and arrays for the machine, when it is called first.

    Compiled code is kept beside the source or in the user's cache folder; where neither can be
    written, it is compiled anew in each process.
    """
    return cast(F, _Kernel(function))


def inlined(function: F) -> F:
    """Compile a function as `kernel` does, into the midst of the kernels that call it.

    Tuples then stay in registers where a call passes them by memory: for what is called at each
    step, and at one place or two.
    """
    return cast(F, _Kernel(function, forceinline=True))


class _Kernel:
    """A function that numba meets when it is called, or by another kernel that calls it.

    numba takes a quarter of a second to import: what runs no kernel does without it.
    """

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        update_wrapper(self, function)
        self._function = function
        # numpy's error model: a division by zero gives infinity, and costs no branch
        self._options = {"nogil": True, "error_model": "numpy", **options}

    def __call__(self, *arguments: Any) -> Any:
        return self._compiled(*arguments)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes this for in the code of other kernels: what it compiled itself."""
        return self._compiled._numba_type_

    @cached_property
    def _compiled(self) -> Any:
        import numba

        contract = {"contract"}
        try:
            return numba.njit(cache=True, fastmath=contract, **self._options)(self._function)
        except RuntimeError:  # numba: "cannot cache function: no locator available"
            return numba.njit(**self._options)(self._function)

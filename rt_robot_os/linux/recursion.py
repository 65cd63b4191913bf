# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Python's recursion limit, seen from the handler of a signal.

The handler is called on top of whatever runs, which may be at Python's recursion limit already.
No call is possible there, so the limit is raised before the handler begins.
"""

from __future__ import annotations

from collections.abc import Callable
import ctypes
from itertools import repeat
from operator import itemgetter
import sys
from types import BuiltinMethodType
from typing import Any

# Since Python 3.12 native calls have a limit of their own, so that they work where a Python
# function has no room left.
SEPARATE_LIMITS = sys.version_info >= (3, 12)
_ROOMY = 1_000_000

_set_limit = ctypes.pythonapi.Py_SetRecursionLimit
_set_limit.argtypes = (ctypes.c_int,)
_set_limit.restype = None


def force_recursion_limit(limit: int) -> None:
    """
    Set the limit also where the stack is as deep already, which :mod:`sys` refuses to do.

    Safe in the real-time loop.
    """
    _set_limit(limit)


def restore_recursion_limit(limit: int) -> None:
    """Set the limit at the end of a handler of signals, however deep the stack is."""
    try:
        sys.setrecursionlimit(limit)
    except RecursionError:
        try:
            force_recursion_limit(limit)
        except RecursionError:  # the handler has no stack left; the limit is set all the same
            pass


class _WithRoom(map):  # type: ignore[type-arg]
    """
    A handler of signals that begins by raising the recursion limit, in native code alone.

    To call it takes its attribute ``__call__``, which takes its next element: one that sets the
    limit on the way and is the handler in Python, which is called then.
    """

    __call__ = property(next)


def with_room(handler: Callable[..., Any]) -> Callable[..., Any]:
    """
    Let a handler of signals work at the recursion limit of what it interrupts.

    It finds the limit raised and must set it to what it was before it returns. A handler that is
    written in C needs no room. Before Python 3.12 nothing can be done. Both are given back.
    """
    if not SEPARATE_LIMITS or isinstance(handler, BuiltinMethodType):
        return handler
    raised = map(sys.setrecursionlimit, repeat(_ROOMY))
    found: Any = _WithRoom(itemgetter(1), zip(raised, repeat(handler)))
    return found  # type: ignore[no-any-return]

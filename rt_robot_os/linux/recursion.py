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
Python's recursion limit in signal handlers.

A handler is called on top of the running code, which may be at Python's recursion limit already.
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

# Since Python 3.12 native calls have a separate limit, so they work where a Python function has no
# stack left.
SEPARATE_LIMITS = sys.version_info >= (3, 12)
_ROOMY = 1_000_000

_set_checked_limit = sys.setrecursionlimit
_set_limit = ctypes.pythonapi.Py_SetRecursionLimit
_set_limit.argtypes = (ctypes.c_int,)
_set_limit.restype = None


def force_recursion_limit(limit: int) -> None:
    """
    Set the limit even if the stack is as deep already, which :mod:`sys` does not allow.

    Safe in the real-time loop.
    """
    _set_limit(limit)


def restore_recursion_limit(limit: int) -> None:
    """Set the limit at the end of a handler of signals, however deep the stack is."""
    try:
        _set_checked_limit(limit)
    except RecursionError:
        try:
            force_recursion_limit(limit)
        except RecursionError:  # the handler has no stack left; the limit is set all the same
            pass


class _WithRoom(map):  # type: ignore[type-arg]
    """
    A signal handler that first raises the recursion limit, using only native code.

    Calling it reads its attribute ``__call__``, which fetches the next element: that sets the
    limit as a side effect and is the Python handler, which is called then.
    """

    __call__ = property(next)


def with_room(handler: Callable[..., Any]) -> Callable[..., Any]:
    """
    Make a signal handler work at the recursion limit of the code that it interrupts.

    It runs with a raised limit, which it must restore before it returns. A handler in C is
    returned unmodified, as it needs no stack. So is any handler before Python 3.12, where this is
    not possible.
    """
    if not SEPARATE_LIMITS or isinstance(handler, BuiltinMethodType):
        return handler
    raised = map(sys.setrecursionlimit, repeat(_ROOMY))
    found: Any = _WithRoom(itemgetter(1), zip(raised, repeat(handler)))
    return found  # type: ignore[no-any-return]

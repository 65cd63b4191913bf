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

"""Raise an exception from a signal handler so that the signal is sent again."""

from __future__ import annotations

from collections.abc import Iterator
import ctypes
from itertools import repeat

from rt_robot_os.linux import _libc

_set_exception = ctypes.pythonapi.PyErr_SetObject
_set_exception.argtypes = (ctypes.py_object, ctypes.py_object)
_set_exception.restype = None


def signal_and_raise(signo: int, error: BaseException) -> Iterator[object]:
    """
    Prepare to raise an exception from a signal handler with another signal pending.

    Python runs the handler of that signal as soon as Python code continues: at the first function
    call and at the first backward jump of a loop, also in the ``except`` clause that catches the
    exception. If the handler raises in the same way, code that catches everything can neither call
    nor loop, so each exception ends at least one ``try``.

    The signal is sent and the exception is raised within one native call. Between two calls, the
    handler would run too early, in the code that is about to raise.

    :param signo: a signal with a Python handler that is not masked.
    :return: an iterator whose first step sends the signal to this thread and raises the exception;
        safe in the real-time loop. RecursionError when the stack has no room for a native call.
    """
    return zip(map(_libc.send_to_self, repeat(signo)),
               map(_set_exception, (type(error),), (error,)))

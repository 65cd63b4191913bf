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

"""The libc functions in use, with their types and their error check."""

from __future__ import annotations

import ctypes
import os
from typing import Any

SIGEV_SIGNAL = 0
SIGEV_THREAD_ID = 4
CLOCK_MONOTONIC = 1
TIMER_ABSTIME = 1
MCL_CURRENT = 1
MCL_FUTURE = 2
MCL_ONFAULT = 4
PR_SET_PDEATHSIG = 1
PR_SET_TIMERSLACK = 29
FALLOC_FL_KEEP_SIZE = 1
SIG_BLOCK = 0
SIG_UNBLOCK = 1

# PyDLL keeps the interpreter lock: for calls that never block; 100 ns cheaper.
_quick = ctypes.PyDLL(None, use_errno=True)
_blocking = ctypes.CDLL(None, use_errno=True)


class SigEvent(ctypes.Structure):
    """``struct sigevent`` of Linux, with the thread id of SIGEV_THREAD_ID."""

    _fields_ = [
        ('value', ctypes.c_void_p),
        ('signo', ctypes.c_int),
        ('notify', ctypes.c_int),
        ('thread_id', ctypes.c_int),
        ('padding', ctypes.c_int * 11),
    ]


class Timex(ctypes.Structure):
    """``struct timex`` of Linux."""

    _fields_ = [
        ('modes', ctypes.c_uint),
        ('offset', ctypes.c_long),
        ('freq', ctypes.c_long),
        ('maxerror', ctypes.c_long),
        ('esterror', ctypes.c_long),
        ('status', ctypes.c_int),
        ('constant', ctypes.c_long),
        ('precision', ctypes.c_long),
        ('tolerance', ctypes.c_long),
        ('time', ctypes.c_long * 2),
        ('tick', ctypes.c_long),
        ('statistics', ctypes.c_long * 8),
        ('tai', ctypes.c_int),
        ('padding', ctypes.c_int * 11),
    ]


def _raise_errno(result: int, function: Any, arguments: tuple[Any, ...]) -> int:
    if result < 0:
        code = ctypes.get_errno()
        raise OSError(code, f'{function.__name__}: {os.strerror(code)}')
    return result


def _declare(library: Any, name: str, *argtypes: Any) -> Any:
    function = getattr(library, name)
    function.argtypes = argtypes
    function.restype = ctypes.c_int
    function.errcheck = _raise_errno
    return function


timer_create = _declare(_quick, 'timer_create', ctypes.c_int, ctypes.POINTER(SigEvent),
                        ctypes.POINTER(ctypes.c_void_p))
timer_delete = _declare(_quick, 'timer_delete', ctypes.c_void_p)
mlockall = _declare(_blocking, 'mlockall', ctypes.c_int)
munlockall = _declare(_blocking, 'munlockall')
adjtimex = _declare(_quick, 'adjtimex', ctypes.POINTER(Timex))
prctl = _declare(_quick, 'prctl', ctypes.c_int, ctypes.c_ulong, ctypes.c_ulong, ctypes.c_ulong,
                 ctypes.c_ulong)
fallocate = _declare(_blocking, 'fallocate', ctypes.c_int, ctypes.c_int, ctypes.c_long,
                     ctypes.c_long)

# On the hot path: called with prepared ctypes objects, without conversion and without an error
# check in Python. The arguments are valid by construction. An interrupted sigwaitinfo is not an
# error.
timer_settime = _quick.timer_settime
pthread_sigmask = _quick.pthread_sigmask
sigwaitinfo = _blocking.sigwaitinfo
clock_nanosleep = _blocking.clock_nanosleep
send_to_self = _quick['raise']  # raise(3)

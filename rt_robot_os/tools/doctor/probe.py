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
What is found out in a short-lived child, so that the doctor itself stays light and unchanged.

Run as ``python -m rt_robot_os.tools.doctor.probe NAME ARGUMENTS``; the last line of the output is
JSON.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import json
import os
import platform
import sys
import sysconfig
import time
from typing import Any

_READS = 20000
_ROUNDS = 5


def scheduler(priority: str, cpu: str) -> dict[str, Any]:
    """
    Ask Linux for what the core would ask.

    :param cpu: -2 for none in particular.
    """
    from rt_robot_os.linux import realtime
    answer: dict[str, Any] = {'affinity_ok': True, 'affinity_reason': ''}
    if cpu != '-2':
        affinity = realtime.set_affinity(int(cpu))
        answer.update(affinity_ok=affinity.ok, affinity_reason=affinity.reason)
    lock = realtime.lock_memory()
    answer.update(lock_ok=lock.ok, lock_reason=lock.reason.partition(';')[0])
    if priority != '0':
        fifo = realtime.set_fifo(int(priority))
        answer.update(fifo_ok=fifo.ok, fifo_reason=fifo.reason.partition(';')[0])
    return answer


def clock() -> dict[str, Any]:
    """Measure the clock, and ask Linux what disciplines it."""
    from rt_robot_os.linux.clock_discipline import clock_state
    now_ns = time.monotonic_ns
    loops_ns, reads_ns = [], []
    # The best of several rounds: what disturbs one makes it longer, never shorter.
    for _ in range(_ROUNDS):
        begin_ns = now_ns()
        for _ in range(_READS):
            now_ns()
        reads_ns.append(now_ns() - begin_ns)
        begin_ns = now_ns()
        for _ in range(_READS):
            pass
        loops_ns.append(now_ns() - begin_ns)
    answer: dict[str, Any] = {
        'resolution_ns': round(time.clock_getres(time.CLOCK_MONOTONIC) * 1e9),
        'read_ns': max(0, min(reads_ns) - min(loops_ns)) // _READS, 'adjtimex': None}
    try:
        state = clock_state()
        answer['adjtimex'] = {'status': state.status, 'max_error_us': state.max_error_us}
    except OSError:
        pass
    return answer


def _observers() -> list[str]:
    found = []
    if sys.gettrace() is not None:
        found.append(f'sys.settrace ({sys.gettrace()!r})')
    if sys.getprofile() is not None:
        found.append(f'sys.setprofile ({sys.getprofile()!r})')
    monitoring = getattr(sys, 'monitoring', None)
    for tool in range(6):
        name = monitoring.get_tool(tool) if monitoring else None
        if name:
            found.append(f'sys.monitoring ({name})')
    if sys.flags.dev_mode:
        found.append('development mode')
    tracemalloc = sys.modules.get('tracemalloc')
    if tracemalloc is not None and tracemalloc.is_tracing():
        found.append('tracemalloc')
    return found


def _jit() -> bool:
    if os.environ.get('PYTHON_JIT', '1') == '0':
        return False
    module = getattr(sys, '_jit', None)
    if module is not None:
        return bool(module.is_enabled())
    return '--enable-experimental-jit' in (sysconfig.get_config_var('CONFIG_ARGS') or '')


def python() -> dict[str, Any]:
    """Describe this interpreter."""
    variable = sysconfig.get_config_var
    return {
        'implementation': platform.python_implementation(), 'version': list(sys.version_info[:3]),
        'executable': sys.executable, 'debug': bool(variable('Py_DEBUG')),
        'free_threaded': bool(variable('Py_GIL_DISABLED')), 'jit': _jit(),
        'flags': f'{variable("OPT") or ""} {variable("PY_CFLAGS") or ""}',
        'config': variable('CONFIG_ARGS') or '', 'observers': _observers(),
        'switch_interval': sys.getswitchinterval(),
    }


def core() -> dict[str, Any]:
    """Import what the core imports, as the program `core` does, and count threads."""
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    try:
        import numpy
        from rt_robot_os.core import app  # noqa: F401
    except Exception as error:  # whatever is wrong with it is the answer
        return {'error': f'{type(error).__name__}: {error}'.splitlines()[0]}
    return {'numpy': numpy.__version__, 'threads': len(os.listdir('/proc/self/task'))}


def compiled() -> dict[str, Any]:
    """Say which build of the package runs, and why this machine could not compile it."""
    from rt_robot_os.base.compiled import state
    known = state()
    answer: dict[str, Any] = {'compiled': known.compiled, 'text': known.text}
    try:
        from rt_robot_os.base.compiled.build import obstacle
        answer['obstacle'] = obstacle() or ''
    except ImportError:  # without setuptools
        answer['obstacle'] = 'no setuptools: sudo apt install python3-setuptools'
    return answer


def rclpy() -> dict[str, Any]:
    """Import rclpy and let it load its middleware."""
    import importlib
    from importlib import metadata
    try:
        # By name: only rt_robot_os.ros uses it; this only checks whether it would work.
        module = importlib.import_module('rclpy')
        utilities = importlib.import_module('rclpy.utilities')
        rmw = utilities.get_rmw_implementation_identifier()
    except Exception as error:  # whatever is wrong with it is the answer
        return {'error': f'{type(error).__name__}: {error}'.splitlines()[0]}
    version = ''
    for name in ('rclpy', 'ros-rclpy'):
        try:
            version = version or metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return {'file': module.__file__ or '', 'rmw': rmw, 'version': version}


def room(folder: str, size_bytes: str) -> dict[str, Any]:
    """Try whether disk space can be reserved in a folder, with an unnamed temporary file."""
    from rt_robot_os.linux.disk_space import is_full
    from rt_robot_os.linux.disk_space import reserve_space
    try:
        fd = os.open(folder, os.O_TMPFILE | os.O_WRONLY | os.O_CLOEXEC, 0o600)
    except OSError as error:
        return {'tried': False, 'reason': error.strerror or str(error), 'full': False}
    try:
        reserve_space(fd, int(size_bytes))
    except OSError as error:
        return {'tried': True, 'reason': error.strerror or str(error), 'full': is_full(error)}
    return {'tried': True, 'reason': '', 'full': False}


PROBES: Mapping[str, Callable[..., dict[str, Any]]] = {
    'scheduler': scheduler, 'clock': clock, 'python': python, 'core': core,
    'compiled': compiled, 'rclpy': rclpy, 'room': room}


if __name__ == '__main__':
    print(json.dumps(PROBES[sys.argv[1]](*sys.argv[2:])))

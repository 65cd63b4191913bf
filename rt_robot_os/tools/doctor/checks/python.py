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

"""The interpreter that would run the core, and NumPy; examined in a child process."""

from __future__ import annotations

from collections.abc import Iterator

from rt_robot_os.base.compiled import SWITCH
from rt_robot_os.tools.doctor.facts import container
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import bad
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.system import System

_OLDEST, _NEWEST = (3, 10), (3, 13)
_NUMPY_OLDEST = (1, 26)
_USUAL_PYTHON = Remedy(('sudo apt install python3 python3-venv',
                        'RT_ROBOT_OS_PYTHON=/usr/bin/python3 ./scripts/run'),
                       'Ubuntu 24.04 has 3.12')
# Each makes the interpreter slower or keeps it busy besides the core's work.
_DEBUG_VARIABLES = ('PYTHONDEVMODE', 'PYTHONTRACEMALLOC', 'PYTHONMALLOC', 'PYTHONASYNCIODEBUG',
                    'PYTHONPROFILEIMPORTTIME', 'PYTHONDUMPREFS', 'PYTHONPERFSUPPORT',
                    'COVERAGE_PROCESS_START', 'PYTHONSTARTUP_TRACE')
_THREAD_VARIABLES = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS')


def version(system: System) -> Iterator[Finding]:
    """Compare the version with those that are supported."""
    facts = system.probe('python')
    pair = tuple(facts['version'][:2])
    text = f'{facts["implementation"]} {".".join(map(str, facts["version"][:3]))}'
    if facts['implementation'] != 'CPython':
        yield bad(text, _USUAL_PYTHON, weight=95)
    elif not _OLDEST <= pair <= _NEWEST:
        yield bad(f'{text}; supported are 3.10 to 3.13', _USUAL_PYTHON, weight=95)
    else:
        yield ok(f'{text}, {facts["executable"]}')


def build(system: System) -> Iterator[Finding]:
    """Look at how the interpreter was built."""
    facts = system.probe('python')
    if facts['free_threaded']:
        yield bad('free-threaded (no GIL)', _USUAL_PYTHON, weight=90,
                  why='the kernel relies on the interpreter lock: one bytecode after another')
        return
    if facts['debug']:
        yield warn('debug build (Py_DEBUG)', _USUAL_PYTHON, weight=60)
        return
    flags = facts['flags'].split()
    levels = [flag for flag in flags if flag.startswith('-O')]
    if levels and levels[-1] in ('-O0', '-Og'):
        yield warn(f'not optimised ({levels[-1]})', _USUAL_PYTHON, weight=60)
        return
    if facts['jit']:
        yield warn('experimental JIT', Remedy(('export PYTHON_JIT=0',)), weight=20,
                   why='the package is not tested with it')
        return
    guided = '--enable-optimizations' in facts['config']
    text = ' '.join(filter(None, ('release', levels[-1] if levels else '',
                                  'with profile' if guided else 'without profile (PGO)')))
    yield ok(text, None if guided else Remedy(
        ("PYTHON_CONFIGURE_OPTS='--enable-optimizations --with-lto' pyenv install 3.12",),
        'or the interpreter of the distribution: some 10 to 20 % faster'))


def compiled(system: System) -> Iterator[Finding]:
    """Look whether the C core of this package was compiled."""
    facts = system.probe('compiled')
    if facts['compiled']:
        yield ok(facts['text'])
        return
    if system.environ.get(SWITCH) == '0':
        yield ok(facts['text'], Remedy((f'unset {SWITCH}',)))
    else:
        yield warn(facts['text'], _compile(system, facts['obstacle']), weight=40)


def _compile(system: System, obstacle: str) -> Remedy:
    """
    Make the remedy for a C core that is not compiled.

    :param obstacle: why this machine cannot, ``what: command``; empty when it can.
    """
    _, colon, command = obstacle.partition(': ')
    command, _, other = command.partition(', or ')
    inside = bool(container(system))
    if inside:  # sudo is neither needed nor installed there
        command = command.removeprefix('sudo ')
    build = 'colcon build --packages-select rt_robot_os'
    return Remedy((command, build) if colon else (build,), '; '.join(filter(None, (
        'in the image of this container' if inside and colon else '',
        f'or {other}' if other else '',
        'in the workspace; ./scripts/run does the same'))))


def observers(system: System) -> Iterator[Finding]:
    """Look for debuggers, profilers and debug modes that a core would inherit."""
    facts = system.probe('python')
    active = list(facts['observers'])
    found = [name for name in _DEBUG_VARIABLES if system.environ.get(name, '') not in ('', '0')]
    if not active and not found:
        yield ok('none')
        return
    text = ', '.join(active + [f'{name}={system.environ[name]}' for name in found])
    yield warn(text, Remedy((f'unset {" ".join(found)}',) if found else (),
                            '' if found else 'something in sitecustomize.py or usercustomize.py '
                            'installs it: python3 -m site'), weight=55)


def switch_interval(system: System) -> Iterator[Finding]:
    """Report how long one thread may keep the interpreter from another."""
    seconds = system.probe('python')['switch_interval']
    yield ok(f'{seconds * 1000:g} ms; the core has one thread, so it never waits for this')


def numpy(system: System) -> Iterator[Finding]:
    """Look at the version of NumPy."""
    facts = system.probe('core')
    if facts.get('error'):
        yield bad(f'the core cannot be imported: {facts["error"]}', Remedy(
            ('./scripts/run doctor',), 'sets up what is missing; in a workspace: '
            'rosdep install --from-paths src -y'), weight=100)
        return
    text = facts['numpy']
    numbers = tuple(int(part) for part in text.split('.')[:2] if part.isdigit())
    if numbers < _NUMPY_OLDEST:
        yield warn(f'{text}; tested are 1.26 and 2.x', Remedy(
            ("python3 -m pip install 'numpy>=1.26'",)), weight=30)
    else:
        yield ok(text)


def threads(system: System) -> Iterator[Finding]:
    """Count the threads in a process that imported what the core does."""
    facts = system.probe('core')
    if facts.get('error'):
        yield absent('the core cannot be imported')
        return
    set_here = ', '.join(f'{name}={system.environ[name]}' for name in _THREAD_VARIABLES
                         if name in system.environ)
    extra = facts['threads'] - 1
    if extra:
        yield warn(f'{extra} besides that of the core' + (f' ({set_here})' if set_here else ''),
                   Remedy((f'export {" ".join(f"{name}=1" for name in _THREAD_VARIABLES)}',),
                          'the node does that for the core that it starts; a core started by '
                          'hand has what the shell sets'), weight=35)
    else:
        yield ok('one, with everything imported' + (f' ({set_here})' if set_here else ''))


CHECKS = (
    Check('python.version', 'Python version', 'the package is tested with these', version),
    Check('python.build', 'Python build',
          'each job takes two to ten times as long in a debug build', build),
    Check('python.compiled', 'C core',
          'a message or a job takes several times as long in pure Python', compiled),
    Check('python.observers', 'debugging tools',
          'every call and line of the core would call another function', observers),
    Check('python.switch_interval', 'switch interval',
          'threads of one interpreter hand it over this often', switch_interval),
    Check('python.numpy', 'NumPy', 'the topics of the core are NumPy arrays', numpy),
    Check('python.threads', 'threads of the core',
          'threads of a BLAS library compete with the core for its CPU and its lock', threads),
)

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
All that the checks may see of a machine: files below a root, environment, child processes.

A test gives them a recorded machine instead, by another root and other answers.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
import glob
import grp
import json
import os
from pathlib import Path
import pwd
import subprocess
import sys
from typing import Any
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rt_robot_os.settings.run_on import MovingBoard

PROBE = 'rt_robot_os.tools.doctor.probe'
_PROBE_TIMEOUT_S = 20.0
_PART_BYTES = 1 << 14
_PARTS = 256


@dataclass(frozen=True)
class Wanted:
    """
    What the core would ask of this machine.

    :ivar cpu: -1 the last one allowed, -2 none.
    :ivar priority: SCHED_FIFO 1..99; 0 stays an ordinary process.
    :ivar ports: serial ports and I2C buses of the configured devices.
    :ivar cpu_latency_us: asked of ``/dev/cpu_dma_latency``; -1 nothing.
    :ivar spin_us: how early the kernel wakes to spin.
    :ivar watchdog: a watchdog of the machine that is fed; empty without.
    :ivar unwatched: what is critical to no effect, without a watchdog; empty without.
    :ivar black_box_folder: where it is written; empty for ROS's folder of logs.
    :ivar journals: folder of each journal of alarms, and the bytes that it takes.
    :ivar boards: that move the robot.
    :ivar source: where that is written.
    """

    cpu: int = -1
    priority: int = 80
    lock_memory: bool = True
    ports: tuple[str, ...] = ()
    cpu_latency_us: int = -1
    spin_us: float = 0.0
    watchdog: str = ''
    unwatched: str = ''
    black_box_folder: str = ''
    journals: tuple[tuple[str, int], ...] = ()
    boards: tuple[MovingBoard, ...] = ()
    source: str = 'the default configuration'


class ProbeError(Exception):
    """A child process that was to examine something did not answer."""


class System:
    """
    The machine.

    :param wanted: what the core would ask of it.
    :param root: the folder that stands for ``/``.
    :param environ: the environment of the core.
    """

    def __init__(self, wanted: Wanted | None = None, root: Path = Path('/'),
                 environ: Mapping[str, str] | None = None) -> None:
        self.wanted = wanted or Wanted()
        self.root = root
        self.environ = dict(os.environ if environ is None else environ)
        self._probed: dict[tuple[str, ...], Mapping[str, Any]] = {}

    # ---- files -------------------------------------------------------------------------------

    def path(self, path: str) -> Path:
        """Return the real place of a path of this machine."""
        return self.root / path.lstrip('/')

    def raw(self, path: str) -> bytes:
        """
        Read a file of at most four megabytes.

        :raises OSError: it is not there or may not be read; the line becomes ``unknown``.
        """
        try:
            # In small parts: some files of /proc want a buffer as large as what is requested.
            with open(self.path(path), 'rb', buffering=0) as file:
                parts: list[bytes] = []
                while len(parts) < _PARTS and (part := file.read(_PART_BYTES)):
                    parts.append(part)
                return b''.join(parts)
        except OSError as error:
            raise type(error)(error.errno, error.strerror, path) from None

    def text(self, path: str) -> str:
        """
        Read a file as text, without the blanks around it.

        :raises OSError: as for :meth:`raw`.
        """
        return self.raw(path).decode(errors='replace').strip(' \t\n\0')

    def read(self, path: str, default: str = '') -> str:
        """Read a file as text; what cannot be read gives the default."""
        try:
            return self.text(path)
        except OSError:
            return default

    def exists(self, path: str) -> bool:
        """Return whether there is such a file."""
        try:
            return self.path(path).exists()
        except OSError:
            return False

    def names(self, folder: str) -> list[str]:
        """List a folder, sorted; empty when it is not there or may not be read."""
        try:
            return sorted(os.listdir(self.path(folder)))
        except OSError:
            return []

    def glob(self, pattern: str) -> list[str]:
        """Find paths by a pattern, sorted."""
        found = glob.glob(glob.escape(str(self.root).rstrip('/')) + pattern)
        prefix = len(str(self.root).rstrip('/'))
        return sorted(path[prefix:] for path in found)

    def may(self, path: str, mode: int) -> bool:
        """
        Return whether this user may open a file, without opening it.

        Opening a serial port would reset many a board.

        :param mode: of ``os.R_OK``, ``os.W_OK``.
        """
        return os.access(self.path(path), mode, effective_ids=True)

    def group_of(self, path: str) -> str:
        """Return the group of a file; empty when it is not there or has no name."""
        try:
            return grp.getgrgid(self.path(path).stat().st_gid).gr_name
        except (OSError, KeyError):
            return ''

    def free_bytes(self, path: str) -> int:
        """
        Return the space that this user may fill there.

        :raises OSError: the folder is not there.
        """
        found = os.statvfs(self.path(path))
        return found.f_bavail * found.f_frsize

    # ---- user and machine ---------------------------------------------------------------------

    @property
    def release(self) -> str:
        """Return the output of ``uname -r``."""
        return os.uname().release

    @property
    def version(self) -> str:
        """Return the output of ``uname -v``."""
        return os.uname().version

    @property
    def machine(self) -> str:
        """Return the output of ``uname -m``."""
        return os.uname().machine

    @property
    def uid(self) -> int:
        """Return the effective user."""
        return os.geteuid()

    @property
    def user(self) -> str:
        """Return the name of the user, or its number."""
        try:
            return pwd.getpwuid(self.uid).pw_name
        except KeyError:
            return str(self.uid)

    @property
    def own_pids(self) -> frozenset[int]:
        """Return the processes that belong to the doctor."""
        return frozenset((os.getpid(), os.getppid()))

    # ---- child processes -----------------------------------------------------------------------

    def probe(self, name: str, *arguments: object) -> Mapping[str, Any]:
        """
        Let a short-lived Python find something out; it runs once, the answer is cached.

        :param name: a function of :mod:`rt_robot_os.tools.doctor.probe`.
        :raises ProbeError: it did not answer.
        """
        key = (name, *map(str, arguments))
        if key not in self._probed:
            self._probed[key] = self._ask(key)
        return self._probed[key]

    def _ask(self, key: Sequence[str]) -> Mapping[str, Any]:
        try:
            ended = subprocess.run(
                [sys.executable, '-m', PROBE, *key], stdin=subprocess.DEVNULL,
                capture_output=True, timeout=_PROBE_TIMEOUT_S, env=self.environ, check=False)
        except OSError as error:
            raise ProbeError(f'{sys.executable} could not be started: {error.strerror}') from error
        except subprocess.TimeoutExpired:
            raise ProbeError(f'the probe {key[0]!r} did not end in {_PROBE_TIMEOUT_S:g} s'
                             ) from None
        try:
            answer = json.loads(ended.stdout.decode().splitlines()[-1])
        except (ValueError, IndexError):
            lines = ended.stderr.decode(errors='replace').strip().splitlines()
            raise ProbeError(f'the probe {key[0]!r} ended with code {ended.returncode}'
                             + (f': {lines[-1]}' if lines else '')) from None
        return dict(answer)

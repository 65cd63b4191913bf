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

"""Channels on this machine: the console, a file, a program."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.features.alarms.notifier import bounded_run
from rt_robot_os.features.alarms.notifier.channel import DeliveryError
from rt_robot_os.features.alarms.notifier.wording import json_of
from rt_robot_os.features.alarms.notifier.wording import title_of
from rt_robot_os.messages.notification import Notification

# How much of the end of a file is searched for a line that was written before.
_LOOK_BACK_BYTES: Final = 1 << 20


class ConsoleChannel:
    """Print a line."""

    SETTINGS = ()

    def __init__(self, values: Mapping[str, Any], environ: Mapping[str, str]) -> None:
        pass

    def deliver(self, notification: Notification, again: bool) -> str:
        """Print it; whether a person reads it is unknown."""
        at = datetime.now().strftime('%H:%M:%S')
        text = notification.text or title_of(notification)
        try:
            print(f'{at} {text}{" (perhaps again)" if again else ""}', file=sys.stdout, flush=True)
        except (OSError, ValueError) as error:
            raise DeliveryError(f'the console cannot be written: {error}') from error
        return 'printed'


class FileChannel:
    """Append a line of JSON to a file, on the disk before it counts as delivered."""

    SETTINGS = (
        Field('path', str, REQUIRED, 'File that a line of JSON is appended to for each '
              'notification', is_file=True),)

    def __init__(self, values: Mapping[str, Any], environ: Mapping[str, str]) -> None:
        self._path = Path(values['path']).expanduser()

    def deliver(self, notification: Notification, again: bool) -> str:
        """Append it, unless the line is there already."""
        line = json.dumps({'at': datetime.now().astimezone().isoformat(timespec='milliseconds'),
                           **notification.to_dict()}, ensure_ascii=True).encode() + b'\n'
        try:
            fd = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
                         | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
        except OSError as error:
            raise DeliveryError(f'{self._path.name}: {error.strerror}') from error
        try:
            return self._append(fd, line, notification.key, again)
        except OSError as error:
            raise DeliveryError(f'{self._path.name}: {error.strerror}') from error
        finally:
            os.close(fd)

    @staticmethod
    def _append(fd: int, line: bytes, key: str, again: bool) -> str:
        size = os.fstat(fd).st_size
        start = max(0, size - (_LOOK_BACK_BYTES if again else 1))
        tail = os.pread(fd, size - start, start)
        if again and any(f'"key": {json.dumps(key)}'.encode() in each and each.endswith(b'}')
                         for each in tail.split(b'\n')):
            os.fsync(fd)
            return 'was written before'
        cut = b'' if not tail or tail.endswith(b'\n') else b'\n'
        try:
            if os.write(fd, cut + line) != len(cut) + len(line):
                raise OSError(28, 'No space left on device')
            os.fsync(fd)
        except OSError:
            os.ftruncate(fd, size)
            raise
        return 'written'


class CommandChannel:
    """Run a program of the user, with the notification as JSON on its standard input."""

    SETTINGS = (
        Field('command', list, REQUIRED, 'Program and its arguments, run without a shell; it gets '
              'the notification as JSON on standard input, and exit code 0 means that it is '
              'delivered'),)

    def __init__(self, values: Mapping[str, Any], environ: Mapping[str, str]) -> None:
        """
        Check the command.

        :raises ValueError: it is empty.
        """
        self._command = [str(each) for each in values['command']]
        self._timeout_s = float(values['timeout_s'])
        self._environ = dict(environ)
        if not self._command or not self._command[0]:
            raise ValueError('command is empty: name a program, such as [/usr/local/bin/page]')

    def deliver(self, notification: Notification, again: bool) -> str:
        """Run it; it is ended, with its children, after its time-out or with this process."""
        program = self._command[0]
        if shutil.which(program, path=self._environ.get('PATH')) is None:
            raise DeliveryError(f'{program}: No such file that can be run')
        # The kernel closes the end of this process when the process ends, even by SIGKILL.
        life, held = os.pipe()
        try:
            self._run(life, json_of(notification, again).encode())
        finally:
            os.close(life)
            os.close(held)
        return 'the program took it'

    def _run(self, life: int, given: bytes) -> None:
        try:
            process = subprocess.Popen(
                [sys.executable, '-I', bounded_run.__file__, str(life), *self._command],
                stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                env=self._environ, start_new_session=True, pass_fds=[life])
        except OSError as error:
            raise DeliveryError(f'{self._command[0]}: {error.strerror}') from error
        try:
            process.communicate(given, timeout=self._timeout_s)
        except subprocess.TimeoutExpired:
            raise DeliveryError(f'the program was not done in {self._timeout_s:g} s') from None
        except OSError:
            pass  # it has not read all of it: its exit code counts
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()
        if process.returncode:
            raise DeliveryError(f'the program ended with code {process.returncode}')

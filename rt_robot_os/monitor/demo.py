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
Processes that run next to the server on request.

`monitor --demo`: a simulated flat in which a person falls: the robot (or its core alone, where
ROS 2 is missing), the notifier and a gateway. `monitor --with-gateway NODE`: the gateway of a
robot of this machine. They are processes that end with the server, whatever ends it. Run as a
module this is one of them.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
from importlib.util import find_spec
import os
from pathlib import Path
import subprocess
import sys
import threading
from typing import Final
from typing import NamedTuple
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import StartError
from rt_robot_os.base.programs import warn
from rt_robot_os.linux.process import end_child
from rt_robot_os.linux.process import run_child
from rt_robot_os.linux.process import start_child
from rt_robot_os.monitor.security.accounts import Accounts
from rt_robot_os.monitor.story import DemoStory
from rt_robot_os.settings.files import default_path

if TYPE_CHECKING:
    from rt_robot_os.monitor.live.hub import Hub

#: Name that differs from that of a robot of the same machine.
NAMESPACE: Final = '/demo'
ROBOT: Final = 'demo'
_PATIENCE_S: Final = 10.0
#: Long, since a program starts slowly on a busy machine.
_ORDER_S: Final = 60.0


class Companions(NamedTuple):
    """
    The processes next to the server.

    :ivar name: displayed name of the robot.
    :ivar ros: arguments of all of them, from ``--ros-args`` on.
    :ivar robot: further arguments of the robot only.
    :ivar node: node of an existing robot, such as ``/robot``; empty to start one.
    """

    name: str
    ros: tuple[str, ...]
    node: str = ''
    robot: tuple[str, ...] = ()


def demo() -> Companions:
    """Return the simulated flat."""
    return Companions(ROBOT, ('--ros-args', '-r', f'__ns:={NAMESPACE}', '--params-file',
                              str(default_path('assisted_living.yaml'))),
                      # The story orders the fall.
                      robot=('-p', 'world.events:=[]'))


def story_of(companions: Companions, hub: Hub) -> DemoStory | None:
    """Return the story of the simulated flat; None with an existing robot."""
    if companions.node:
        return None
    return DemoStory(hub, companions.name, _order, lambda line: warn('monitor', line))


def _order(what: str) -> None:
    """
    Trigger an event in the simulated flat.

    :raises OSError: the simulator failed or did not answer.
    """
    try:
        done = subprocess.run(
            [sys.executable, '-m', 'rt_robot_os.core.simulator_program', '--robot',
             f'{NAMESPACE}/robot',
             '--tell', f'world {what}'], capture_output=True, text=True, timeout=_ORDER_S)
    except subprocess.TimeoutExpired:
        raise OSError(f'the simulator has not answered for {_ORDER_S:g} s') from None
    if done.returncode:
        raise OSError(done.stderr.strip() or f'the simulator ended with {done.returncode}')


def gateway_of(node: str, params_files: Iterable[Path]) -> Companions:
    """
    Return the gateway of an existing robot.

    :param params_files: parameter files, which may have its section.
    """
    return Companions(node.strip('/').replace('/', '.') or ROBOT, (
        '--ros-args', *(word for path in params_files for word in ('--params-file', str(path)))),
        node)


@contextmanager
def running(companions: Companions, accounts: Accounts, folder: Path, url: str, ca_file: str = ''
            ) -> Iterator[None]:
    """
    Run processes next to a server.

    :param folder: of the server; the token of the robot is stored there.
    :param url: of the server, such as ``ws://127.0.0.1:8080``.
    :param ca_file: the authority that the gateway trusts for the server's certificate.
    :raises StartError: the token cannot be written.
    """
    name, ros, node, robot_only = companions
    token = token_file(accounts, folder, name)
    accounts.residents.accept_first_hello(name)
    more = ('-p', f'ca_file:={ca_file}') if ca_file else ()
    ended: list[str] = []
    children = {}
    if not node:
        robot = 'ros' if find_spec('rclpy') is not None else 'core'
        children = {'robot': _start(robot, *ros, *robot_only),
                    'notifier': _start('features.alarms.notifier', *ros)}
    children['gateway'] = _start(
        'gateway', '--server', url, *(('--robot', node) if node else ()), *ros,
        '-p', f'token_file:={token}', '-p', f'folder:={folder / name}-gateway', *more)
    for name, child in children.items():
        threading.Thread(target=_tell_end, args=(name, child, ended), daemon=True).start()
    try:
        yield
    finally:
        ended += children
        for child in reversed(children.values()):
            end_child(child, _PATIENCE_S)


def token_file(accounts: Accounts, folder: Path, robot: str = ROBOT) -> Path:
    """
    Return the file with the token of a robot; a new robot is added.

    :raises StartError: it cannot be written.
    """
    path = folder / f'{robot}.token'
    try:
        known = accounts.robots.find(path.read_text().strip())
        if known is not None and known.name == robot:
            return path
    except OSError:
        pass
    if any(each['name'] == robot and not each['revoked_ns'] for each in accounts.robots.all()):
        accounts.robots.revoke(robot)
    _, token = accounts.robots.add(robot)
    try:
        path.unlink(missing_ok=True)
        with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), 'w') as file:
            file.write(f'{token}\n')
    except OSError as error:
        raise StartError(f'{path} cannot be written: {error.strerror}') from error
    return path


def _start(part: str, *arguments: object) -> subprocess.Popen[bytes]:
    return start_child(__name__, os.getpid(), f'rt_robot_os.{part}.program', *arguments)


def _tell_end(name: str, child: subprocess.Popen[bytes], ended: list[str]) -> None:
    code = child.wait()
    if name not in ended:
        warn('monitor', f'the {name} beside it has ended with code {code}; what it had shown '
             'stays, as with any robot that is away')


def _become(arguments: Sequence[str]) -> int:
    """Become the program; that it ends with its parent outlasts that."""
    os.execv(sys.executable, [sys.executable, '-m', *arguments])


if __name__ == '__main__':
    sys.exit(run_child(_become))

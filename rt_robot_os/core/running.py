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

"""Run a core, from its settings to its exit code."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from collections.abc import Sequence
from contextlib import contextmanager
from contextlib import ExitStack
from functools import partial
import os
from pathlib import Path
import signal
import sys
from types import FrameType

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import END_SIGNALS
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import importing
from rt_robot_os.base.programs import OK
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.core.black_box_saver import BlackBoxWriter
from rt_robot_os.core.part import Host
from rt_robot_os.core.part import installed_parts
from rt_robot_os.core.placement import choose_cpu
from rt_robot_os.core.preload import preload
from rt_robot_os.core.simulators import device_folder
from rt_robot_os.core.simulators import Simulators
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.service import RunningServices
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.link.robots import lock_core
from rt_robot_os.link.robots import remove_dead_lock
from rt_robot_os.linux.lock_file import LockFile
from rt_robot_os.linux.paths import robot_name
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.settings import from_json
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import SIM_PORT
from rt_robot_os.settings.command_line import tell
from rt_robot_os.settings.command_line import told_simulated

ENDED_BY_FORCE = 3
# Saves the black box, see rt_robot_os.core.black_box_saver.
DUMP_SIGNAL = signal.SIGUSR1


def _settings(arguments: argparse.Namespace, argv: Sequence[str]
              ) -> tuple[RobotSettings, RobotSettings, Path] | None:
    """Return the settings and the socket's path; None if the node ended before it sent them."""
    if arguments.settings:
        # The second line: the settings as they were loaded, before changes at run time.
        now, _, loaded = _text(arguments.settings).strip().partition('\n')
        if arguments.parent is not None and not now:
            return None
        return from_json(now), from_json(loaded or now), arguments.socket or socket_path()
    # Late: parsing YAML needs memory, which a core with a node does not.
    from rt_robot_os.settings.load import load_from_arguments
    settings, ros = load_from_arguments(argv, arguments.simulate, arguments.files)
    path = arguments.socket or socket_path(robot_name(ros.node_name, ros.namespace))
    return settings, settings, path


def _text(file: str) -> str:
    if file == '-':
        return sys.stdin.read()
    try:
        return Path(file).read_text()
    except OSError as error:
        raise ConfigError([f'--settings {file}: cannot be read: {error.strerror}']) from error
    except UnicodeDecodeError:
        raise ConfigError([f'--settings {file}: not JSON: not UTF-8']) from None


def run_core(arguments: argparse.Namespace, argv: Sequence[str]) -> int:
    """
    Run a core until it is stopped.

    :param arguments: of :mod:`rt_robot_os.core.command`.
    :param argv: the command line that they were parsed from.
    :return: the exit code.
    """
    simulators = Simulators()
    if arguments.ahead:
        with importing():
            preload(sys.stdin, simulators, arguments.socket)
    try:
        given = _settings(arguments, argv)
        if given is None:
            simulators.stop()
            return OK
        settings, loaded, path = given
        lock = lock_core(path, arguments.parent or 0)
    except RtRobotError as error:
        simulators.stop()
        tell('core', error)
        return BAD_USE
    by_hand = arguments.settings is None
    if by_hand and settings.simulated:
        print(f'core: {told_simulated(settings)}', file=sys.stderr)
    # Until the end: the death of the parent is signalled twice, possibly during the clean-up.
    with ExitStack() as signals:
        try:
            return _run(settings, loaded, path, lock, arguments, by_hand, signals, simulators)
        finally:
            lock.release()
            remove_dead_lock(path)


def _run(settings: RobotSettings, loaded: RobotSettings, path: Path, lock: LockFile,
         arguments: argparse.Namespace, by_hand: bool, signals: ExitStack,
         simulators: Simulators) -> int:
    duration_s: float | None = arguments.duration
    services = RunningServices()
    writer: BlackBoxWriter | None = None
    try:
        ports = simulators.start(settings, device_folder(path))
        offered = services.start([DRIVERS.load(device.type) for device in settings.devices
                                  if device.port != SIM_PORT], path)
        cooperative = settings.core.dispatcher == 'cooperative'
        clock = None if cooperative else MonotonicClock((*END_SIGNALS, DUMP_SIGNAL))
        writer = BlackBoxWriter(path.stem, settings.core.black_box_folder)
        core = Core(settings, path, ports=ports, clock=clock, writer=writer, loaded=loaded,
                    services=offered, parts=installed_parts(),
                    cpu=choose_cpu(settings.core.cpu, lock), liveness_fd=arguments.life)
        simulators.attach(core.host)
        _watch(services, core.host)
        signals.enter_context(_signals_to(core))
        if arguments.ready >= 0:
            core.on_open = partial(os.close, arguments.ready)
        simulators.wait()  # they have started in parallel
        core.prepare_process()
        if by_hand:
            core.watch.write_reports_to(sys.stderr.fileno())
        core.run(None if duration_s is None else round(duration_s * NS_PER_S))
        if core.tripped:
            return settings.watchdog.exit_code
        if core.forced:
            return ENDED_BY_FORCE
    except (RtRobotError, OSError) as error:
        tell('core', error)
        return BAD_USE if isinstance(error, ValueError | StartError) else FAILED
    finally:
        if writer is not None:
            writer.close()
        simulators.stop()
        services.stop()
    return OK


def _watch(services: RunningServices, host: Host) -> None:
    """Restart and report services that have ended."""
    def check() -> None:
        for text in services.check():
            host.note(Severity.WARN, 'services', text)

    host.watch.add(check)


@contextmanager
def _signals_to(core: Core) -> Iterator[None]:
    def dump(signum: int, frame: FrameType | None) -> None:
        core.black_box.ask(signal.Signals(signum).name)

    with ended_by_signals(lambda signo: core.stop(signal.Signals(signo).name)):
        previous = signal.signal(DUMP_SIGNAL, dump)
        try:
            yield
        finally:
            signal.signal(DUMP_SIGNAL, previous)

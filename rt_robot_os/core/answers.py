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

"""What the core does when a client asks: one small method a request."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from dataclasses import asdict
from enum import Enum
import itertools
import os
from typing import Any
from typing import TYPE_CHECKING

from rt_robot_os.core.tasks import held
from rt_robot_os.core.tasks import resource_names
from rt_robot_os.dumps.parts import live_parts
from rt_robot_os.errors import LinkError
from rt_robot_os.errors import RtRobotError
from rt_robot_os.kernel import TaskState
from rt_robot_os.link.mirror import Policy
from rt_robot_os.link.protocol import decode_request
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import Kind
from rt_robot_os.link.protocol import MORE
from rt_robot_os.link.records import encode_task
from rt_robot_os.link.session import Session
from rt_robot_os.logger import LEVELS
from rt_robot_os.reports import Severity
from rt_robot_os.settings import to_json
from rt_robot_os.text import encodable
from rt_robot_os.text import safe_line
from rt_robot_os.text import safe_text

if TYPE_CHECKING:
    from rt_robot_os.core.app import Core
    from rt_robot_os.modules import Module

Arguments = dict[str, Any]

_TEXT_A_PACKET = 16_384
_SHOWN_MAXIMUM = 200
# Of what a module tells of itself; more would hold up whoever else reads the statistics.
_VALUES_MAXIMUM = 256
_VALUE_TEXT_MAXIMUM = 500


def _plain(value: Any) -> Any:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(f'{value!r} is no plain value')


def _text(arguments: Arguments, key: str) -> str:
    value = arguments.get(key)
    if not isinstance(value, str) or not encodable(value):
        raise LinkError(f'{key} = {shown(value)}: must be a text')
    return value


def shown(value: Any) -> str:
    """Show what a client has sent, which may be anything, in a message."""
    text = repr(value)
    return text if len(text) <= _SHOWN_MAXIMUM else f'{text[:_SHOWN_MAXIMUM]}...'


def _value(arguments: Arguments) -> Any:
    """Give the new value of a parameter; no parameter is a text that others cannot read."""
    value = arguments.get('value')
    for item in value if isinstance(value, list) else (value,):
        if isinstance(item, str) and not encodable(item):
            raise LinkError(f'value = {shown(value)}: is no text that can be encoded')
    return value


def _number(arguments: Arguments, key: str, default: float) -> float:
    value = arguments.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < 1e9:
        raise LinkError(f'{key} = {shown(value)}: must be a number from 0')
    return float(value)


def statistics_of(module: Module) -> dict[str, str | int | float]:
    """Ask a module, which may be anybody's, for its statistics; bounded, and fit to be sent."""
    try:
        told = module.statistics()
        kept = {safe_line(str(name)): _plain_value(value)
                for name, value in itertools.islice(told.items(), _VALUES_MAXIMUM)}
        if len(told) > _VALUES_MAXIMUM:
            kept['warning'] = kept.get('warning') or (
                f'statistics() gives {len(told)} values; {_VALUES_MAXIMUM} are shown')
        return kept
    except Exception as error:
        return {'warning': safe_line(f'statistics() failed: {type(error).__name__}: {error}')}


def _plain_value(value: Any) -> str | int | float:
    if isinstance(value, int | float):
        return value
    return safe_text(str(value)[:_VALUE_TEXT_MAXIMUM])


class Answers:
    """
    Answer requests; called by the link's low-priority task.

    :param core: what the requests are about.
    """

    def __init__(self, core: Core) -> None:
        self._core = core
        self._known: dict[str, Callable[[Session, Arguments], Arguments]] = {
            'hello': self._hello, 'tap': self._tap, 'mirror': self._mirror,
            'unmirror': self._unmirror, 'advertise': self._advertise, 'set_rate': self._set_rate,
            'set_parameter': self._set_parameter, 'change': self._change,
            'reset_statistics': self._reset_statistics,
            'rearm': self._rearm, 'stop': self._stop,
        }
        # What takes several packets.
        self._long: dict[str, Callable[[Session, int, Arguments], None]] = {
            'black_box': self._black_box, 'parameters': self._parameters,
            'settings': self._settings, 'statistics': self._statistics,
        }

    def __call__(self, session: Session, packet: bytes) -> None:
        """Answer one request; nonsense is a reason to part."""
        try:
            arguments = decode_request(packet)
        except LinkError as error:
            session.gone = f'refused: {error}'
            return
        number = arguments.get('id')
        if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 1 << 63:
            session.gone = f'refused: a request with id {shown(number)}'
            return
        do = str(arguments.get('do'))
        try:
            if do in self._long:
                self._long[do](session, number, arguments)
                return
            answer = self._known.get(do)
            if answer is None:
                raise LinkError(f'unknown request {shown(do)}; there are '
                                f'{", ".join(sorted([*self._known, *self._long]))}')
            reply = answer(session, arguments)
        except RtRobotError as error:
            reply = {'error': str(error)}
        session.post(encode_json(Kind.REPLY, reply, seq=number))

    # ---- requests ----------------------------------------------------------------------------

    def _hello(self, session: Session, arguments: Arguments) -> Arguments:
        name = arguments.get('name')
        if not isinstance(name, str):
            raise LinkError(f'name = {shown(name)}: must be a text')
        core = self._core
        core.link.greet(session, name)
        return {
            'pid': os.getpid(), 'start_ns': core.kernel.start_ns,
            'tasks': [task.name for task in core.kernel.tasks], 'taps': list(core.taps.topics),
            'topics': self._topics()}

    def _topics(self) -> list[Arguments]:
        return [{
            'name': topic.name, 'channel': channel, 'type_name': topic.layout.type_name,
            'size': topic.layout.size, 'max_size': topic.layout.max_size,
            'stamp_offset': topic.layout.stamp_offset, 'depth': topic.depth,
            'rate_hz': topic.rate_hz,
        } for channel, topic in enumerate(self._core.bus.topics)]

    def _tap(self, session: Session, arguments: Arguments) -> Arguments:
        """Turn the taps on, for a recorder; they stay on."""
        self._core.turn_on_taps()
        return {'taps': list(self._core.taps.topics), 'topics': self._topics()}

    def _mirror(self, session: Session, arguments: Arguments) -> Arguments:
        name = _text(arguments, 'topic')
        wanted = arguments.get('policy', 'drain')
        try:
            policy = Policy(wanted)
        except ValueError:
            raise LinkError(f'policy = {shown(wanted)}: must be drain or latest') from None
        channel = self._core.link.mirror(
            session, name, policy, _number(arguments, 'max_rate_hz', 0.0),
            bool(arguments.get('initial', False)), bool(arguments.get('oldest', False)),
            bool(arguments.get('patient', False)))
        return {'channel': channel}

    def _unmirror(self, session: Session, arguments: Arguments) -> Arguments:
        self._core.link.unmirror(session, _text(arguments, 'topic'))
        return {}

    def _advertise(self, session: Session, arguments: Arguments) -> Arguments:
        return {'channel': session.advertise(_text(arguments, 'topic'))}

    def _set_rate(self, session: Session, arguments: Arguments) -> Arguments:
        task = self._core.kernel.task(_text(arguments, 'task'))
        task.set_rate_hz(arguments.get('rate_hz', 0.0))
        return {'rate_hz': task.rate_hz}

    def _set_parameter(self, session: Session, arguments: Arguments) -> Arguments:
        owner, name = _text(arguments, 'owner'), _text(arguments, 'name')
        if name == 'log_level' and owner in self._core.loggers:
            level = _text(arguments, 'value')
            if level not in LEVELS:
                raise LinkError(f'{owner}.log_level = {level!r}: must be one of '
                                f'{", ".join(LEVELS)}')
            self._core.loggers[owner].level = int(Severity[level.upper()])
            return {'value': level}
        for module in self._core.modules:
            if module.name == owner:
                return {'value': module.change(name, _value(arguments))}
        for managed in self._core.sensors.devices:
            if managed.device.name == owner:
                return {'value': managed.device.change(name, _value(arguments))}
        names = [m.name for m in self._core.modules]
        names += [d.device.name for d in self._core.sensors.devices]
        raise LinkError(f'no module {owner!r} and no such device; there are '
                        f'{", ".join(names) or "none"}')

    def _change(self, session: Session, arguments: Arguments) -> Arguments:
        name = _text(arguments, 'name')
        return {'value': self._core.parameters.change(name, _value(arguments))}

    def _parameters(self, session: Session, number: int, arguments: Arguments) -> None:
        def post(content: Arguments) -> None:
            session.post(encode_json(Kind.REPLY, content, seq=number, more=True))

        settings = self._core.settings
        post({'file': settings.parameters_file, 'files': settings.files})
        for facts in self._core.parameters.facts():
            post(facts)
        session.post(encode_json(Kind.REPLY, {}, seq=number))

    def _rearm(self, session: Session, arguments: Arguments) -> Arguments:
        """Let a task that is held make jobs again, or all of them."""
        kernel = self._core.kernel
        name = arguments.get('task', '')
        tasks = [kernel.task(_text(arguments, 'task'))] if name else held(kernel)
        names = [task.name for task in tasks if task.state is not TaskState.ACTIVE]
        for task in tasks:
            kernel.rearm(task)
        if names:
            self._core.note(Severity.INFO, 'core', f'{session.name} re-armed {", ".join(names)}')
        return {'tasks': names}

    def _reset_statistics(self, session: Session, arguments: Arguments) -> Arguments:
        for task in self._core.kernel.tasks:
            task.reset_statistics()
        self._core.kernel.stolen.reset()
        return {}

    def _stop(self, session: Session, arguments: Arguments) -> Arguments:
        self._core.stop(
            safe_line(str(arguments.get('reason', f'asked by {session.name}'))))
        return {}

    # ---- the black box -----------------------------------------------------------------------

    def _black_box(self, session: Session, number: int, arguments: Arguments) -> None:
        reason = safe_line(str(arguments.get('reason', f'asked by {session.name}')))
        live = live_parts(self._core.kernel, reason, self._core.black_box.facts())

        def packets() -> Iterator[bytes]:
            for part in live:
                yield encode_json(Kind.REPLY, part, seq=number, more=True)
            yield encode_json(Kind.REPLY, {}, seq=number)

        session.post_all(packets())

    # ---- settings ----------------------------------------------------------------------------

    def _settings(self, session: Session, number: int, arguments: Arguments) -> None:
        text = to_json(self._core.settings)

        def packets() -> Iterator[bytes]:
            for start in range(0, len(text), _TEXT_A_PACKET):
                yield encode_json(Kind.REPLY, {'text': text[start:start + _TEXT_A_PACKET]},
                                  seq=number, more=True)
            yield encode_json(Kind.REPLY, {}, seq=number)

        session.post_all(packets())

    # ---- statistics --------------------------------------------------------------------------

    def _statistics(self, session: Session, number: int, arguments: Arguments) -> None:
        core = self._core

        def packets() -> Iterator[bytes]:
            for task in core.kernel.tasks:
                yield header(Kind.TASK, MORE, seq=number) + encode_task(task)
            for part, content in self._parts():
                yield encode_json(Kind.REPLY, {'part': part, **content}, seq=number, more=True,
                                  default=_plain)
            yield encode_json(Kind.REPLY, {}, seq=number)

        session.post_all(packets())

    def _parts(self) -> Iterator[tuple[str, Arguments]]:
        core = self._core
        for topic in core.bus.statistics():
            yield 'topic', asdict(topic)
        for device in core.sensors.statistics():
            yield 'device', asdict(device)
        for module in core.modules:
            core.link.occupied_by = f'statistics() of {module.name}'
            try:
                values = statistics_of(module)
            finally:
                core.link.occupied_by = ''
            yield 'module', {'name': module.name, 'values': values}
        for client in core.link.statistics():
            yield 'client', client.as_json()
        for name in resource_names(core.settings):
            yield 'resource', asdict(core.kernel.resource(name).statistics())
        watchdog, stolen = core.watchdog, core.kernel.stolen
        yield 'core', {
            'pid': os.getpid(), 'now_ns': core.kernel.now_ns(),
            'elapsed_ns': core.kernel.now_ns() - core.kernel.start_ns,
            'wakeups': core.kernel.wakeups, 'overhead_ns': core.kernel.overhead_ns,
            'failures_total': core.kernel.failures_total,
            'threads': list(core.threads.found),
            'stolen': stolen.events, 'stolen_total_ns': stolen.total_ns,
            'stolen_maximum_ns': stolen.times.maximum_ns,
            'parameters': core.parameters.digest(),
            'watchdog': 'off' if watchdog is None else watchdog.reason or 'healthy',
            'black_box': core.black_box.statistics(), 'log_lines': core.reports.total,
            'simulators_restarted': core.simulators.restarts if core.simulators else 0,
            'tap_dropped': core.taps.dropped,
            'accepted': core.link.accepted, 'refused': core.link.refused,
            'simulated': core.settings.simulated,
            'simulation_asked': core.settings.simulation_asked,
            'realtime': [asdict(result) for result in core.realtime]}

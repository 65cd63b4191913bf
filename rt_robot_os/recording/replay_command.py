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

"""The program `replay`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
import time
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RecordingError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import warn
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.recording.library import need_mcap

if TYPE_CHECKING:
    from rt_robot_os.recording.reading import Recording
    from rt_robot_os.recording.replay import Replay
    from rt_robot_os.settings import RobotSettings

IDENTICAL, DIFFERS = 0, 1
# The most names of newer settings in a message.
_NAMED: Final = 6


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='replay', description='Replay a recording of record: the same drivers and modules, '
        'with the recorded bytes at the recorded times, faster than real time. Each publication '
        'is compared with the recorded one. Exit code: 0 when all are identical, 1 when some '
        'differ, 2 when it cannot be replayed.')
    parser.add_argument('recording', type=Path, metavar='PATH', help='folder or .mcap file')
    parser.add_argument('--params-file', type=Path, action='append', default=[], metavar='FILE',
                        help='use this configuration instead of the recorded one')
    parser.add_argument('--node', default='robot',
                        help='name of the node in the file (%(default)s)')
    parser.add_argument('--allow', action='append', default=[], metavar='TYPE',
                        help='permit the recording to import this module, package.module:Class; '
                        'registered modules need no permission')
    parser.add_argument('--from', dest='source', choices=('auto', 'bytes', 'topics'),
                        default='auto', help='auto: replay the drivers, except those of motor '
                        'boards; bytes: replay all drivers; topics: start with the publications '
                        'of the drivers (%(default)s)')
    parser.add_argument('--session', type=int, metavar='N',
                        help='number of the session, if the core was restarted while recording')
    parser.add_argument('--output', type=Path, metavar='FILE',
                        help='write the publications of the replay as MCAP')
    return parser


def _settings(arguments: argparse.Namespace, recording: Recording
              ) -> tuple[RobotSettings, list[str]]:
    """Return the settings, and the keys that are newer than the recording."""
    from rt_robot_os.recording.newer_settings import completed
    from rt_robot_os.recording.trust import check_trusted
    from rt_robot_os.settings import from_json
    from rt_robot_os.settings import load
    if arguments.params_file:
        return load(arguments.params_file, node=arguments.node), []
    if recording.settings is None:
        raise RecordingError('the recording has no configuration: give one with --params-file')
    try:
        settings = from_json(recording.settings)
        check_trusted(settings, arguments.allow)
        return completed(settings)
    except ConfigError as error:
        raise RecordingError(
            f'the configuration in the recording cannot be read: {error} (it was recorded with '
            f'release {recording.facts.versions["rt_robot_os"]}); give one with '
            '--params-file') from error


def _replay(arguments: argparse.Namespace) -> int:
    from rt_robot_os.recording.reading import Recording
    from rt_robot_os.recording.replay import Replay
    from rt_robot_os.recording.replay_output import ReplayOutput
    recording = Recording(arguments.recording, arguments.session)
    settings, newer = _settings(arguments, recording)
    begin = time.perf_counter()
    replay = Replay(recording, settings, from_bytes=arguments.source != 'topics',
                    boards_too=arguments.source == 'bytes')
    output = None
    if arguments.output is not None:
        output = ReplayOutput(arguments.output, replay, recording)
    try:
        replay.run()
    finally:
        if output is not None:
            output.close()
    code = _report(replay, recording, time.perf_counter() - begin)
    if code == DIFFERS and newer:
        more = ', ...' if len(newer) > _NAMED else ''
        _print_error(f'{len(newer)} settings are newer than the recording: '
                     f'{", ".join(newer[:_NAMED])}{more}')
    return code


def _print_error(text: str) -> None:
    """Print text that may come from the recording, without control characters."""
    print(''.join(each if each.isprintable() or each == '\n' else '?' for each in text),
          file=sys.stderr)


def _report(replay: Replay, recording: Recording, took_s: float) -> int:
    comparison, timeline = replay.comparison, replay.timeline
    for line in (*recording.problems, *timeline.problems, *replay.notes):
        _print_error(line)
    for topic, gap in timeline.gaps.items():
        _print_error(f'{topic}: {gap} messages are missing; the rest may differ')
    if timeline.dropped:
        _print_error(f'the core dropped {timeline.dropped} records of its schedule before they '
                     'could be recorded; the rest may differ')
    for failure in replay.core.kernel.failures:
        _print_error(f'task {failure.task} failed: {failure.error}')
    length_s = (replay.end_ns - replay.start_ns) / NS_PER_S
    print(f'{length_s:.1f} s replayed in {took_s:.2f} s: {length_s / took_s:.0f} times real time')
    if not timeline.cold:
        print('The recording started in the middle of the run, so the replay started in another '
              'state.\nDifferences before the first identical sample count as settling '
              '(core.record_bytes: true records everything).')
    print(f'{"topic":32} {"same":>8} {"differ":>8} {"missing":>8} {"extra":>8} {"settling":>8} '
          f'{"not recorded":>12}')
    for topic, c in sorted(comparison.counts.items()):
        print(f'{topic:32} {c.same:8} {c.different:8} {c.missing:8} {c.extra:8} {c.settling:8} '
              f'{c.unrecorded:12}')
    first = comparison.first
    if first is not None:
        number = '' if first.number is None else f' number {first.number}'
        after_s = (first.at_ns - replay.start_ns) / NS_PER_S
        print(f'first difference: {first.topic}{number}, {after_s:.6f} s after the start')
        for line in first.lines:
            print(f'  {line}')
    if not any(c.compared or c.missing or c.extra for c in comparison.counts.values()):
        print('no recorded sample could be compared with the publications of the replay',
              file=sys.stderr)
        return BAD_USE
    for topic, c in sorted(comparison.counts.items()):
        if c.never_same:
            print(f'{topic}: never identical; its state before the recording is unknown')
    print('identical' if comparison.identical else 'different')
    return IDENTICAL if comparison.identical else DIFFERS


def run(argv: Sequence[str]) -> int:
    """
    Replay and compare.

    :param argv: without the program's name.
    :return: the exit code: 0 identical, 1 different, 2 when it cannot be replayed.
    :raises BrokenPipeError: the output is no longer read.
    """
    arguments = _parser().parse_args(argv)
    try:
        need_mcap()
        return _replay(arguments)
    except RtRobotError as error:
        _print_error(str(error))
    except BrokenPipeError:
        raise
    except OSError as error:
        warn('replay', error)
    except Exception as error:  # noqa: B902 - a malicious recording may cause any error
        what = ' '.join(f'{type(error).__name__}: {error}'.split())
        _print_error(f'{arguments.recording} cannot be replayed: it is damaged, or this release '
                     f'cannot run its configuration ({what:.300})')
    return BAD_USE

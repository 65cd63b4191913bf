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

"""What the attacks have in common: arguments, a line for each run, JSON, and the exit code."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
import os
from pathlib import Path
from typing import Any

from robot import BOARDS

_WIDTH = 11


def parser(text: str) -> argparse.ArgumentParser:
    """Return a parser with what all attacks take."""
    made = argparse.ArgumentParser(description=text)
    made.add_argument('--boards', default=','.join(BOARDS), help='names, with commas (default: '
                      'all)')
    made.add_argument('--whole', action='store_true', help='all of config/service_robot.yaml but '
                      'its camera; default: from commands to wheels')
    made.add_argument('--node', action='store_true', help='with the ROS 2 node')
    made.add_argument('--no-realtime', dest='realtime', action='store_false',
                      help='as ordinary processes')
    made.add_argument('--out', type=Path, help='write all runs as JSON')
    return made


def boards(arguments: argparse.Namespace) -> list[str]:
    """
    Return the boards that were asked for.

    :raises SystemExit: there is no such board.
    """
    names = [each for each in arguments.boards.split(',') if each]
    unknown = [each for each in names if each not in BOARDS]
    if unknown or not names:
        raise SystemExit(f'--boards {arguments.boards}: choose of {", ".join(BOARDS)}')
    return names


class Report:
    """
    A table: a line for each run as it ends.

    :param columns: names of the columns, also keys of the JSON.
    """

    def __init__(self, columns: Sequence[str]) -> None:
        self.runs: list[dict[str, Any]] = []
        self.failed = 0
        self._columns = columns
        print(' '.join(f'{each[:_WIDTH * 2]:>{_width(each)}}' for each in (*columns, 'result')),
              flush=True)

    def add(self, problem: str = '', **run: Any) -> None:
        """Print a run; with a problem it has failed."""
        self.runs.append({**run, 'problem': problem, 'load': round(os.getloadavg()[0], 2)})
        self.failed += bool(problem)
        values = [*(run.get(each, '') for each in self._columns), problem or 'ok']
        print(' '.join(f'{_text(value):>{_width(each)}}' for each, value in zip(
            (*self._columns, 'result'), values)), flush=True)

    def end(self, out: Path | None) -> int:
        """Print the sum, write the JSON, and return the exit code: 1 when a run has failed."""
        print(f'{len(self.runs)} runs, {self.failed} failed', flush=True)
        if out is not None:
            out.write_text(json.dumps(self.runs, indent=1) + '\n')
        return 1 if self.failed or not self.runs else 0


def _width(column: str) -> int:
    return max(len(column), _WIDTH)


def _text(value: Any) -> str:
    return f'{value:.3f}' if isinstance(value, float) else str(value)

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

"""The output folder: raw samples, the document, the page, Markdown and the pictures."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import json
from pathlib import Path
from typing import Any

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.tools.bench import plot_drawing
from rt_robot_os.tools.bench.blocks import PictureBlock
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.html_report import page
from rt_robot_os.tools.bench.json_report import read_samples
from rt_robot_os.tools.bench.json_report import write_json
from rt_robot_os.tools.bench.markdown_report import markdown
from rt_robot_os.tools.bench.report import report
from rt_robot_os.tools.bench.result import CaseResult

DOCUMENT_FILE = 'bench.json'
PAGE_FILE = 'index.html'
MARKDOWN_FILE = 'benchmarks.md'
IMAGES = 'images/bench/'


def write_results(folder: Path, content: Mapping[str, Any], results: Sequence[CaseResult]) -> None:
    """
    Write everything but the samples, which are written after each case.

    :raises OSError: it cannot be written.
    """
    write_json(folder / DOCUMENT_FILE, content)
    blocks = list(report(content, results))
    (folder / PAGE_FILE).write_text(page(blocks))
    (folder / MARKDOWN_FILE).write_text(markdown(blocks, IMAGES))
    pictures = [block for block in blocks if isinstance(block, PictureBlock)]
    if pictures:
        (folder / IMAGES).mkdir(parents=True, exist_ok=True)
    for picture in pictures:
        plot_drawing.save(picture.plot, folder / IMAGES / f'{picture.unique}.svg')


class EarlierRun:
    """
    The results of an earlier call, evaluated again from its raw samples.

    :raises RtRobotError: the folder holds none, or they are of another version.
    """

    def __init__(self, folder: Path, cases: Mapping[str, Case]) -> None:
        self._folder = folder
        try:
            self.content = json.loads((folder / DOCUMENT_FILE).read_text())
            self.options = BenchOptions(**self.content['options'], out=str(folder))
        except OSError as error:
            raise RtRobotError(f'{folder / DOCUMENT_FILE}: {error.strerror}; name a folder that '
                               '--out has written') from error
        except (ValueError, KeyError, TypeError) as error:
            raise RtRobotError(f'{folder / DOCUMENT_FILE}: not a file that this version of bench '
                               f'has written: {type(error).__name__}: {error}') from error
        self.results = [result for case in cases.values()
                        if (result := self._evaluate(case)) is not None]
        self.content['cases'] = [result.as_json() for result in self.results]

    def _evaluate(self, case: Case) -> CaseResult | None:
        outcomes = self._outcomes(case)
        return None if outcomes is None else case.evaluate(self.options, outcomes)

    def _outcomes(self, case: Case) -> Outcomes | None:
        path = self._folder / f'{case.name}.npz'
        if not path.exists():
            return case.partial(self.options) if case.partial else None
        try:
            return read_samples(self._folder, case.name, case.plan(self.options))
        except (OSError, ValueError, KeyError) as error:
            raise RtRobotError(f'{path}: cannot be read: {error}') from error

    def write(self) -> None:
        """
        Write page, Markdown, pictures and document again.

        :raises OSError: it cannot be written.
        """
        write_results(self._folder, self.content, self.results)

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

"""The traces in the documentation are those of the tests."""

from __future__ import annotations

from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r'<!-- (test/golden/\w+\.trace) -->\n```text\n(.*?)```\n', re.DOTALL)


def test_the_timing_model_shows_the_golden_traces_as_they_are() -> None:
    blocks = BLOCK.findall((ROOT / 'docs' / 'timing_model.md').read_text())
    assert len(blocks) >= 4
    for path, text in blocks:
        assert text == (ROOT / path).read_text(), f'{path} differs from docs/timing_model.md'

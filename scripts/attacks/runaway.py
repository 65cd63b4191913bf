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

"""The module of ``runaway_module.py``: it runs away once, when the file ``run_away`` is there."""

from __future__ import annotations

from pathlib import Path

from rt_robot_os.base.schema import Field
from rt_robot_os.modules import Module

_FLAG = Path('run_away')
# Some tens of seconds in one native call.
_NATIVE = 3 * 10**9


class Runaway(Module):
    """Run away in one of three ways; the next core finds the file gone."""

    SETTINGS = (Field('how', str, 'loop', 'How it runs away.',
                      choices=('loop', 'swallow', 'native')),)

    def step(self) -> None:
        """Run away when it is asked to."""
        if not _FLAG.exists():
            return
        _FLAG.unlink()
        if self.settings['how'] == 'native':
            sum(range(_NATIVE))
        elif self.settings['how'] == 'swallow':
            _swallow()
        while True:
            pass


def _swallow() -> None:
    try:
        _swallow()
    except BaseException:
        _swallow()

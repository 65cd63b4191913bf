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

"""Which build of this package a measured process runs, and why it is not the compiled one."""

from __future__ import annotations

from collections.abc import Mapping

from rt_robot_os.base.compiled import state
from rt_robot_os.base.compiled import SWITCH
from rt_robot_os.tools.bench.case import COMPILED
from rt_robot_os.tools.bench.case import PURE

#: Of each outcome: 1 when the child ran the compiled build.
FIGURE = 'env compiled'


def environment(environ: Mapping[str, str], build: str) -> dict[str, str]:
    """
    Return an environment in which this build runs.

    :param build: where it is ``COMPILED`` but there is none, the child runs the other one and
        says why, see :func:`why_not`: the demand itself would only end it. Empty leaves the
        user's choice.
    """
    made = dict(environ)
    if build == COMPILED:
        made.pop(SWITCH, None)
    elif build == PURE:
        made[SWITCH] = '0'
    return made


def why_not(build: str) -> str:
    """Return in a line why this process does not run the build; empty when it does."""
    known = state()
    return known.text if build == COMPILED and not known.compiled else ''


def figures() -> dict[str, float]:
    """Return what the samples say of the build that ran."""
    return {FIGURE: float(state().compiled)}

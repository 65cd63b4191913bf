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

"""Timers lie in their order, whatever comes in which order."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rt_robot_os.kernel.timers import insert

LAST = [(1 << 61, number) for number in range(3)]


@given(st.lists(st.tuples(st.integers(0, 5), st.one_of(st.none(), st.integers(-3, 3)))))
def test_entries_are_sorted_before_their_sentinels(steps: list[tuple[int, int | None]]) -> None:
    entries, model = LAST.copy(), LAST.copy()
    for due_ns, level in steps:
        if level is None:
            if len(entries) > len(LAST):
                assert entries.pop(0) == model.pop(0)
        else:
            insert(entries, (due_ns, level))
            model = sorted([*model, (due_ns, level)])
        assert entries == model

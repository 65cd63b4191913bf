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


"""The ring of records against a plain list, on whichever build runs."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.kernel import BlackBox
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import BLOCKED
from rt_robot_os.kernel.black_box import CEILING
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.black_box import MARK
from rt_robot_os.kernel.black_box import MISS
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.black_box import PUBLISH

times = st.integers(0, 1 << 62)
who = st.sampled_from([None, 'a task'])
texts = st.text(max_size=3)
records = st.one_of(
    st.tuples(st.just(JOB), who, times, times, times, st.integers(0, 2)),
    st.tuples(st.just(PUBLISH), who, times, texts, times),
    st.tuples(st.just(INTERRUPT), who, times, texts),
    st.tuples(st.just(CEILING), who, times, times, texts),
    *(st.tuples(st.just(kind), who, times, times) for kind in (OVERRUN, ABORT, BLOCKED, MISS)),
    # What is no record of these is stored as it is.
    st.sampled_from([(), ('nonsense',), (JOB,), (JOB, None, 'x', 1, 2, 0), (99, 1), (-1, 2)]))
steps = st.one_of(st.tuples(st.just('add'), records), st.tuples(st.just('mark'), times, texts),
                  st.tuples(st.just('pop')), st.tuples(st.just('latest'), st.integers(0, 5)),
                  st.tuples(st.just('copy')))


@given(st.integers(0, 4), st.lists(steps, max_size=30))
def test_it_holds_the_last_records_whatever_is_done(
        capacity: int, program: list[tuple[Any, ...]]) -> None:
    box, model = BlackBox(capacity), list[Any]()
    for step in program:
        if step[0] in ('add', 'mark'):
            record = step[1] if step[0] == 'add' else (MARK, None, step[1], step[2])
            if step[0] == 'add':
                box.add(record)
            else:
                box.mark(*step[1:])
            model = [*model, record][-capacity:] if capacity else []
        elif step[0] == 'pop':
            assert box.pop_oldest() == (model.pop(0) if model else None)
        elif step[0] == 'latest':
            assert box.latest(step[1]) == tuple(reversed(model))[:step[1]]
        else:
            box = box.copy()
        assert (len(box), box.records) == (len(model), tuple(model))
    assert box.capacity == capacity


@pytest.mark.parametrize('capacity', [-1, 'many'])
def test_a_capacity_that_is_none_is_refused(capacity: Any) -> None:
    with pytest.raises((TypeError, ValueError)):
        BlackBox(capacity)

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

"""NEWS2 against its chart, written down here in another way, and against those of others."""

from __future__ import annotations

from itertools import product
import os
import random
import re

from broad import examples
from broad import VARIABLE
from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.features.health.assessment.news2 import PARAMETERS
from rt_robot_os.features.health.assessment.news2 import Risk
from rt_robot_os.features.health.assessment.news2 import rounded
from rt_robot_os.features.health.assessment.news2 import score
from rt_robot_os.messages.signs import SIGNS

# As it is printed: a column for each score, from 3 over 0 to 3.
CHART = """
respiration_per_min | <=8  |          | 9-11    | 12-20     |           | 21-24    | >=25
spo2 scale 1        | <=91 | 92-93    | 94-95   | >=96      |           |          |
spo2 scale 2 air    | <=83 | 84-85    | 86-87   | >=88      |           |          |
spo2 scale 2 oxygen | <=83 | 84-85    | 86-87   | 88-92     | 93-94     | 95-96    | >=97
systolic_mmhg       | <=90 | 91-100   | 101-110 | 111-219   |           |          | >=220
pulse_per_min       | <=40 |          | 41-50   | 51-90     | 91-110    | 111-130  | >=131
body_temperature    | <=35.0 |        | 35.1-36.0 | 36.1-38.0 | 38.1-39.0 | >=39.1 |
"""
COLUMNS = (3, 2, 1, 0, 1, 2, 3)
NORMAL = {'respiration_per_min': 18.0, 'spo2_percent': 97.0, 'oxygen_l_per_min': 0.0,
          'systolic_mmhg': 120.0, 'pulse_per_min': 70.0, 'consciousness': 0.0,
          'body_temperature': 36.8}


def _chart() -> dict[str, list[tuple[int, int, int]]]:
    """Return (first, last, score) of each row, in tenths."""
    found: dict[str, list[tuple[int, int, int]]] = {}
    for line in CHART.strip().splitlines():
        name, *cells = (cell.strip() for cell in line.split('|'))
        for cell, points in zip(cells, COLUMNS, strict=True):
            if cell:
                numbers = [round(10 * float(each)) for each in re.findall(r'[0-9.]+', cell)]
                first = 0 if cell.startswith('<=') else numbers[0]
                last = 10_000 if cell.startswith('>=') else numbers[-1]
                found.setdefault(name, []).append((first, last, points))
    return found


ROWS = _chart()


def _by_chart(row: str, tenths: int) -> int:
    found, = [points for first, last, points in ROWS[row] if first <= tenths <= last]
    return found


def _edges(row: str) -> list[int]:
    """Return the first and the last value of each band, in tenths."""
    return sorted({tenths for first, last, _ in ROWS[row] for tenths in (first, last)}
                  - {0, 10_000})


def _rows(scale: int, oxygen: float) -> dict[str, str]:
    """Return the row of each parameter that is measured."""
    spo2 = 'spo2 scale 1' if scale == 1 else f'spo2 scale 2 {"oxygen" if oxygen else "air"}'
    return {'respiration_per_min': 'respiration_per_min', 'spo2_percent': spo2,
            'systolic_mmhg': 'systolic_mmhg', 'pulse_per_min': 'pulse_per_min',
            'body_temperature': 'body_temperature'}


def _risk(points: list[int]) -> str:
    total = sum(points)
    return ('High' if total >= 7 else 'Medium' if total >= 5 else
            'Low-Medium' if 3 in points else 'Low')


def test_every_band_has_neighbours_without_a_gap() -> None:
    for row, bands in ROWS.items():
        step = 1 if row == 'body_temperature' else 10
        for (_, last, _), (first, _, _) in zip(bands, bands[1:]):
            assert first - last == step, row


@pytest.mark.parametrize('scale, oxygen', [(1, 0.0), (1, 2.0), (2, 0.0), (2, 2.0)])
def test_all_edges_of_a_band_with_all_edges_of_each_other(scale: int, oxygen: float) -> None:
    """Each pair of parameters over all their edges, the others at random edges of theirs."""
    rows = _rows(scale, oxygen)
    edges = {name: _edges(row) for name, row in rows.items()}
    chance = random.Random(f'{scale} {oxygen}')
    names = list(rows)
    for place, first in enumerate(names):
        for second in names[place + 1:]:
            for pair in product(edges[first], edges[second]):
                tenths = {name: chance.choice(edges[name]) for name in names}
                tenths[first], tenths[second] = pair
                mind = chance.randrange(5)
                wanted = {name: _by_chart(rows[name], value) for name, value in tenths.items()}
                wanted['oxygen_l_per_min'] = 2 if oxygen else 0
                wanted['consciousness'] = 3 if mind else 0
                found = score({**{name: value / 10 for name, value in tenths.items()},
                               'oxygen_l_per_min': oxygen, 'consciousness': mind}, scale)
                assert found.scores == wanted
                assert found.total == sum(wanted.values())
                assert found.risk is not None
                assert found.risk.title == _risk(list(wanted.values()))


@pytest.mark.parametrize('row', ROWS)
def test_every_value_near_an_edge_is_rounded_half_up_before_it_is_looked_up(row: str) -> None:
    name = 'spo2_percent' if row.startswith('spo2') else row
    scale, oxygen = (2 if 'scale 2' in row else 1), 2.0 if 'oxygen' in row else 0.0
    step = 1 if name == 'body_temperature' else 10
    for edge in _edges(row):
        for hundredths in range(10 * (edge - 2 * step), 10 * (edge + 2 * step) + 1):
            tenths = (hundredths + 5 * step) // (10 * step) * step
            found = score({**NORMAL, 'oxygen_l_per_min': oxygen, name: hundredths / 100}, scale)
            assert found.scores[name] == _by_chart(row, tenths), hundredths / 100


VECTORS = [
    (18, 97, 0, 120, 70, 0, 36.8, 1, 0), (22, 93, 2, 105, 115, 1, 38.5, 1, 13),
    (8, 91, 2, 90, 131, 4, 35.0, 1, 20), (16, 95, 2, 120, 80, 0, 37.0, 2, 4),
    (16, 93, 0, 120, 80, 0, 37.0, 2, 0), (25, 96, 0, 220, 41, 0, 39.1, 1, 9),
    (16, 96, 0, 219, 90, 0, 38.04, 1, 0)]


@pytest.mark.parametrize('vector', VECTORS)
def test_published_vectors(vector: tuple[float, ...]) -> None:
    *values, scale, total = vector
    assert score(dict(zip(PARAMETERS, values)), int(scale)).total == total


@pytest.mark.parametrize('value, tenths', [
    (38.05, 38.1), (38.04, 38.0), (38.049, 38.0), (35.05, 35.1), (36.05, 36.1), (39.05, 39.1),
    (311.2 - 273.15, 38.1), (38.04999923706055, 38.1)])
def test_a_temperature_is_rounded_by_its_decimal_digits(value: float, tenths: float) -> None:
    assert rounded('body_temperature', value) == tenths


def test_what_is_missing_is_never_normal() -> None:
    for name in PARAMETERS:
        for nothing in (None, float('nan'), float('inf'), -1.0):
            found = score({**NORMAL, name: nothing})
            assert (found.complete, found.total, found.risk) == (False, None, None)
            assert found.missing == (name,)
            assert not found.frequency
        if name not in ('oxygen_l_per_min', 'consciousness'):
            assert score({**NORMAL, name: 0.0}).missing == (name,), 'a sensor that is off'
    empty = score({})
    assert empty.missing == PARAMETERS and empty.total is None and empty.at_least == 0


def test_an_incomplete_set_says_what_its_score_is_at_least() -> None:
    found = score({'spo2_percent': 88.0, 'pulse_per_min': 135.0, 'respiration_per_min': 22.0})
    assert found.total is None and found.at_least == 8
    assert found.least_risk is Risk.HIGH and found.risk is None
    assert (found.response, found.frequency) == ('emergency response', 'continuous')


def test_scale_2_above_92_without_knowing_of_oxygen_is_missing() -> None:
    values = {**NORMAL, 'oxygen_l_per_min': None}
    assert score({**values, 'spo2_percent': 96.0}, 2).missing == (
        'spo2_percent', 'oxygen_l_per_min')
    assert score({**values, 'spo2_percent': 92.4}, 2).scores['spo2_percent'] == 0


def test_a_scale_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match='must be 1, or 2'):
        score(NORMAL, 3)


ANY = st.one_of(st.none(), st.floats(), st.floats(0.0, 250.0))


@given(st.fixed_dictionaries({name: ANY for name in PARAMETERS}), st.sampled_from((1, 2)))
def test_more_knowledge_never_lowers_what_the_score_is_at_least(
        values: dict[str, float | None], scale: int) -> None:
    found = score(values, scale)
    assert 0 <= found.at_least <= 20
    assert set(found.scores) | set(found.missing) == set(PARAMETERS)
    assert not set(found.scores) & set(found.missing)
    for name in PARAMETERS:
        less = score({**values, name: None}, scale)
        assert less.at_least <= found.at_least
        assert less.least_risk <= found.least_risk


@given(st.sampled_from(sorted(SIGNS)), st.floats())
def test_rounding_never_goes_further_than_half_a_step(name: str, value: float) -> None:
    if SIGNS[name].is_plausible(value):
        step = 0.1 if name == 'body_temperature' else 1.0
        assert abs(rounded(name, value) - value) <= step / 2 + 1e-4


def test_another_implementation_agrees() -> None:
    peer = pytest.importorskip('vitalscore.scores.news2', reason='vitalscore is not installed')
    chance = random.Random(2)
    for _ in range(examples(500)):
        values = {'respiration_per_min': chance.randint(4, 35),
                  'spo2_percent': chance.randint(80, 100),
                  'oxygen_l_per_min': chance.choice((0, 2)),
                  'systolic_mmhg': chance.randint(70, 240),
                  'pulse_per_min': chance.randint(30, 150),
                  'consciousness': chance.randrange(5),
                  'body_temperature': chance.randint(340, 410) / 10}
        respiration, spo2, oxygen, systolic, pulse, mind, temperature = values.values()
        for scale in (1, 2):
            other = peer.score_news2(
                respiration, spo2, bool(oxygen), systolic, pulse, 'ACVPU'[int(mind)], temperature,
                use_spo2_scale2=scale == 2)
            assert score(values, scale).total == other.total, values


@pytest.mark.skipif(not os.environ.get(VARIABLE), reason=f'long: set {VARIABLE}')
@pytest.mark.parametrize('scale, oxygen', [(1, 0.0), (1, 2.0), (2, 0.0), (2, 2.0)])
def test_every_combination_of_all_edges(scale: int, oxygen: float) -> None:
    rows = _rows(scale, oxygen)
    tables = [[(tenths / 10, _by_chart(row, tenths)) for tenths in _edges(row)]
              for row in rows.values()]
    for *measured, mind in product(*tables, [(each, 3 if each else 0) for each in range(5)]):
        values = dict(zip((*rows, 'consciousness'), (value for value, _ in (*measured, mind))))
        points = [points for _, points in (*measured, mind)] + [2 if oxygen else 0]
        found = score({**values, 'oxygen_l_per_min': oxygen}, scale)
        assert found.total == sum(points), values
        assert found.risk is not None and found.risk.title == _risk(points), values

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

"""Reader of NEWS2 cases: values in many notations, and the expected scores."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
import json
import math
from pathlib import Path
import re
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.assessment.news2 import CONSCIOUSNESS
from rt_robot_os.features.health.assessment.news2 import OXYGEN
from rt_robot_os.features.health.assessment.news2 import PULSE
from rt_robot_os.features.health.assessment.news2 import RESPIRATION
from rt_robot_os.features.health.assessment.news2 import Risk
from rt_robot_os.features.health.assessment.news2 import Score
from rt_robot_os.features.health.assessment.news2 import SPO2
from rt_robot_os.features.health.assessment.news2 import SYSTOLIC
from rt_robot_os.features.health.assessment.news2 import TEMPERATURE
from rt_robot_os.messages.signs import Consciousness
from rt_robot_os.messages.signs import SIGNS

#: Accepted names of each parameter, in lower case without _, - and spaces.
NAMES: Final[Mapping[str, tuple[str, ...]]] = {
    RESPIRATION: ('resp', 'respiration', 'respirationpermin', 'respirations', 'respirationrate',
                  'respiratoryrate', 'rr'),
    SPO2: ('spo2', 'spo2percent', 'sats', 'oxygensaturation', 'sao2'),
    OXYGEN: ('oxygen', 'oxygenlpermin', 'o2', 'onoxygen', 'ono2', 'airoroxygen',
             'supplementaloxygen', 'supplementalo2', 'inspiredoxygen'),
    SYSTOLIC: ('systolic', 'systolicmmhg', 'sbp', 'sys', 'systolicbp', 'systolicbloodpressure',
               'bpsystolic', 'nbpsys'),
    PULSE: ('pulse', 'pulsepermin', 'hr', 'heartrate', 'pulserate'),
    CONSCIOUSNESS: ('consciousness', 'acvpu', 'avpu', 'loc', 'levelofconsciousness', 'mind'),
    TEMPERATURE: ('temperature', 'bodytemperature', 'temp'),
}
_SCALE: Final = ('scale', 'spo2scale')
_TOTAL: Final = ('total', 'news2', 'news', 'score', 'totalscore', 'news2total')
_NOTHING: Final = ('', '-', 'nan', 'none', 'null', 'na', 'n/a', 'missing', 'unknown', '?')
_AIR: Final = ('air', 'room air', 'roomair', 'false', 'no', 'off', 'ra', 'a', 'n')
_GIVEN: Final = ('oxygen', 'true', 'yes', 'on', 'o2', 'y', 'supplemental oxygen')
_NUMBER: Final = re.compile(
    r'([+-]?\d{1,9}(?:[.,]\d{1,9})?)\s*(?:%|/min|bpm|mmhg|°?\s*c|l/min)?')
#: Value for supplemental oxygen of an unknown flow.
_SOME_OXYGEN: Final = 1.0
_MINDS: Final[tuple[tuple[str, Consciousness], ...]] = (
    (r'a|alert.*', Consciousness.ALERT),
    (r'c|cvpu|not alert.*|.*confus.*', Consciousness.CONFUSION),
    (r'v|.*(voice|verbal).*', Consciousness.VOICE),
    (r'u|.*(un-?respon|unconscious).*', Consciousness.UNRESPONSIVE),
    (r'p|.*pain.*', Consciousness.PAIN))
# Patterns of the texts about response and frequency; the first that matches counts.
_RESPONSES: Final = (
    (r'emergen', Risk.HIGH), (r'urgent.*ward', Risk.LOW_MEDIUM), (r'urgent', Risk.MEDIUM),
    (r'nurse|ward|routine|assess', Risk.LOW))
_FREQUENCIES: Final = (
    (r'continuous', 'continuous'), (r'\b12\b', 'minimum 12-hourly'),
    (r'4\s*(-|to)\s*6', 'minimum 4-6-hourly'), (r'\b1\b|hourly|\bhr\b|\bhour\b', 'minimum hourly'))


class Case(NamedTuple):
    """
    A case.

    :ivar name: its name, or its number.
    :ivar values: by parameter; None if missing.
    :ivar scale: SpO2 scale, 1 or 2.
    :ivar expected: expected scores, by key in lower case.
    :ivar problems: values that could not be parsed.
    """

    name: str
    values: Mapping[str, float | None]
    scale: int
    expected: Mapping[str, Any]
    problems: list[str]

    def compare(self, found: Score) -> tuple[int, list[str]]:
        """Return the number of expected values, and those that differ."""
        compared, differences = 0, []
        for title, wanted, got in self._pairs(found):
            compared += 1
            if wanted != got:
                differences.append(f'{title}: {got} instead of {wanted}')
        return compared, differences

    def _pairs(self, found: Score) -> Iterable[tuple[str, Any, Any]]:
        if (total := _first(self.expected, _TOTAL)) is not None:
            yield 'total', _whole(total), found.total
        for name, names in NAMES.items():
            points = _first(self.expected, tuple(f'{each}score' for each in names))
            if points is not None:
                yield f'{name} score', _whole(points), found.scores.get(name)
        if (risk := _first(self.expected, ('risk', 'clinicalrisk'))) is not None:
            yield 'risk', _risk(str(risk)), found.risk.title if found.risk is not None else None
        if (response := _first(self.expected, ('response',))) is not None:
            meant = _known(str(response), _RESPONSES)
            yield 'response', meant.title if isinstance(meant, Risk) else meant, (
                found.risk.title if found.risk is not None else None)
        if (frequency := _first(self.expected, ('frequency', 'monitoring'))) is not None:
            yield 'frequency', _known(str(frequency), _FREQUENCIES), (
                found.frequency if found.complete else None)
        if (complete := _first(self.expected, ('complete',))) is not None:
            yield 'complete', complete, found.complete


def read_cases(path: Path) -> list[Case]:
    """
    Read the cases of a file: a JSON list, an object with such a list, or an object in each line.

    :raises ConfigError: the file cannot be read, or contains no cases.
    """
    try:
        text = path.read_text(encoding='utf-8-sig')
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError([f'{str(path)!r} cannot be read: {error}']) from error
    found = _loaded(text, str(path))
    if isinstance(found, dict):
        lists = [each for each in found.values() if isinstance(each, list)]
        found = lists[0] if len(lists) == 1 else [found]
    if not isinstance(found, list) or not found or not all(
            isinstance(each, dict) for each in found):
        raise ConfigError([f'{str(path)!r} contains no cases: must be a JSON list of objects such '
                           'as {"resp": 18, "spo2": 97, ...}'])
    return [case_of(each, place) for place, each in enumerate(found, 1)]


def case_of(found: Mapping[str, Any], place: int) -> Case:
    """
    Parse one case.

    :param place: its number, the default of its name.
    """
    keys: dict[str, Any] = {}
    for key, value in found.items():
        # Some files have the values, or the expected ones, in an object of their own.
        inner = value.items() if isinstance(value, dict) else ((key, value),)
        keys.update((re.sub(r'[\W_]', '', str(name).lower()), each) for name, each in inner)
    problems: list[str] = []
    values: dict[str, float | None] = {}
    for name, names in NAMES.items():
        try:
            values[name] = _value(name, _first(keys, names))
        except ValueError as error:
            values[name] = None
            problems.append(f'{name}: {error}')
    scale = 1
    try:
        scale = _scale(_first(keys, _SCALE))
    except ValueError as error:
        problems.append(str(error))
    name = _first(keys, ('id', 'name', 'case', 'title'))
    return Case(str(place if name is None else name), values, scale, keys, problems)


def _loaded(text: str, name: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        try:
            return [json.loads(line) for line in text.splitlines() if line.strip()]
        except (ValueError, RecursionError):
            raise ConfigError([f'{name!r} is not JSON: {error}']) from None


def _first(found: Mapping[str, Any], names: Iterable[str]) -> Any:
    return next((found[name] for name in names
                 if str(found.get(name, '')).strip().lower() not in _NOTHING), None)


def _value(name: str, given: Any) -> float | None:
    """Return a value; None for none. Raise ValueError if it cannot be parsed."""
    text = str(given).strip().lower()
    if given is None or text in _NOTHING:
        return None
    if name == OXYGEN and text in (*_AIR, *_GIVEN):
        return 0.0 if text in _AIR else _SOME_OXYGEN
    if name == CONSCIOUSNESS:
        for form, mind in _MINDS:
            if re.fullmatch(form, text, re.DOTALL):
                return float(mind)
    try:
        # With a unit after it, and a decimal comma.
        number = _NUMBER.fullmatch(text)
        value = math.nan if isinstance(given, bool) else float(
            number[1].replace(',', '.') if number else text)
    except (ValueError, OverflowError):
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f'{str(given)[:40]!r} cannot be parsed as a value')
    sign = SIGNS[name]
    if not sign.is_plausible(value) and not sign.is_off(value):
        raise ValueError(f'{value:g} {sign.unit} is not plausible: must be {sign.low:g} to '
                         f'{sign.high:g}; it counts as missing')
    return value


def _scale(given: Any) -> int:
    if given is None or str(given).strip().lower() in _NOTHING:
        return 1
    found = re.fullmatch(r'(?:spo2)?\s*(?:scale)?\s*([12])(?:\.0*)?', str(given).strip().lower())
    if not found:
        raise ValueError(f'scale {str(given)[:20]!r}: must be 1 or 2; 1 was used')
    return int(found[1])


def _whole(given: Any) -> Any:
    try:
        number = float(given)
    except (ValueError, TypeError, OverflowError):
        return given
    return int(number) if number.is_integer() else number


def _risk(given: str) -> str:
    plain = re.sub(r'[\W_]|risk', '', given.lower())
    return next((each.title for each in Risk if re.sub(r'\W', '', each.title.lower()) == plain),
                given)


def _known(given: str, forms: Iterable[tuple[str, Any]]) -> Any:
    return next((meant for form, meant in forms if re.search(form, given.lower())), given)

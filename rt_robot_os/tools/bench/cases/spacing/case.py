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

"""The case `spacing`: what a job costs by how far releases lie apart, and a thousand tasks."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.tools.bench import facts
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import BUILDS
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.cases import common
from rt_robot_os.tools.bench.cases.spacing.subjects import tasks_at
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target

TASKS, RATE_HZ = 100, 200
SPACINGS_US = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500)
_QUICK_US = (0, 2, 10, 50, 500)
# Closer ones are no sleep: a wake-up takes longer.
_WAKES_US, _QUICK_WAKES_US = (50, 100, 200, 500), (50, 500)
MANY = 1000
_MANY = (('together', 'released together'), ('spread', 'spread over the period'))
_PERIOD_NS = NS_PER_S // RATE_HZ
# Over the whole period, and far from everybody else.
_SPREAD_US, _ALONE_US = 50, 500
_TOGETHER_RATIO = 0.25
# Of a bare wake-up: releases that lie close share one. How much that saves is decided by what a
# wake-up takes on the machine, 5 us or 40 us.
_WAKE_RATIO = 1.0
# Of what a plain loop reaches on the same CPU: 199.9 and 195 of 200 Hz.
_RATE_RATIOS = {'together': 0.9995, 'spread': 0.975}
_WARMUP_NS, _MANY_WARMUP_NS = 50 * NS_PER_MS, 300 * NS_PER_MS
_WAKE_SHARE = 4
# Of a bare wake-up: a warm-up and two stretches of 0.1 s.
_WAKE_S = 0.3
# Of a stretch in which time is taken, twice, with a warm-up; and of one for counting.
_LEAST_S, _MORE_S = 0.2, 0.2
# "Together" has no place on a logarithmic axis but one left of the others.
_TOGETHER_X = 0.4
_SUBJECTS = __package__

_COLUMNS = (
    Column('p50', 'p50', 'us', 'CPU time a job'),
    Column('p50', 'range', 'us', 'CPU time a job', spread=True),
    Column('looked', 'awake', 'us', 'CPU time a job'), common.RATIO_COLUMN,
    Column('sleeps', 'sleeps', '', 'of a job'))
_NOTES = (
    'Tasks of 200 Hz that do nothing: 100 of them, or as many as find a moment of their own in',
    'the period of 5 ms (50 at 100 us, 10 at 500 us). CPU time of the thread divided by the',
    'jobs, stretches of 0.1 s, all spacings in turns. Awake: the part of it in which the kernel',
    'looked at the clock, because the next release came sooner than an alarm pays. Of a job:',
    'times that the process slept. clock_nanosleep: bare wake-ups, so far apart.')
_MANY_COLUMNS = (
    Column('reached', 'reached', 'Hz', 'rate'),
    Column('reached', 'range', 'Hz', 'rate', spread=True),
    Column('missed', 'missed', '', 'releases'), Column('tries', 'no miss', '%', 'tries'),
    Column('job', 'job', 'us', 'CPU time'), Column('looked', 'awake', 'us', 'CPU time'),
    Column('cpu', 'process', '%', 'CPU'))
_MANY_NOTES = (
    '1000 tasks of 200 Hz that do nothing, released together, or each at a moment of its own (5',
    'us from the next). Reached: the rate, by the share of the releases that a job served. Each',
    'repeat is a try; ten tries of ten seconds: `bench spacing --seconds 10 --repeats 10`. Linux',
    'takes 5 % of the CPU from real-time processes that compute all the time. Plain loop: it',
    'calls 1000 functions when it woke up, or waits awake from one moment to the next. Targets',
    'are ratios to it. That a try misses nothing is shown, but not a target: a host that takes',
    'the CPU for 5 ms in ten seconds decides it.')


def _spacings(options: BenchOptions) -> Sequence[int]:
    return _QUICK_US if options.quick else SPACINGS_US


def _wakes(options: BenchOptions) -> Sequence[int]:
    return _QUICK_WAKES_US if options.quick else _WAKES_US


def _plan(options: BenchOptions) -> Sequence[Run]:
    spacings = _spacings(options)
    curve_s = max(options.seconds / 2, len(spacings) * _LEAST_S)
    curve = Run('curve', 'spacings', f'{_SUBJECTS}.subjects:curve', {
        'tasks': TASKS, 'rate_hz': RATE_HZ, 'warmup_ns': _WARMUP_NS,
        'spacings_ns': [us * NS_PER_US for us in spacings],
        'measure_ns': round(curve_s * NS_PER_S)},
        common.START_S + curve_s + len(spacings) * _MORE_S)
    many = Run('many', f'{MANY} tasks', f'{_SUBJECTS}.subjects:many', {
        'tasks': MANY, 'rate_hz': RATE_HZ, 'warmup_ns': _MANY_WARMUP_NS,
        'measure_ns': options.measure_ns},
        common.START_S + 2 * (_MANY_WARMUP_NS / NS_PER_S + options.seconds))
    wakes = _wakes(options)
    wake_s = max(len(wakes) * _WAKE_S, options.seconds / _WAKE_SHARE)
    return (*common.both_builds(curve, many),
            Run('plain', f'plain loop, {MANY}', f'{_SUBJECTS}.floor:many', {
                'tasks': MANY, 'rate_hz': RATE_HZ, 'measure_ns': options.measure_ns},
                common.START_S + 2 * options.seconds),
            Run('wakes', 'bare wake-ups', f'{_SUBJECTS}.subjects:wakes', {
                'spacings_ns': [us * NS_PER_US for us in wakes],
                'measure_ns': options.measure_ns // _WAKE_SHARE}, common.START_S + wake_s))


def _cost(spacing_us: int) -> common.Of:
    return common.part_of(str(spacing_us * NS_PER_US), 0.5)


def _label(spacing_us: int) -> str:
    count = tasks_at(spacing_us * NS_PER_US, TASKS, _PERIOD_NS)
    return f'{count:>3} tasks, ' + (f'{spacing_us} us apart' if spacing_us else 'together')


def _curve_rows(options: BenchOptions, outcomes: Outcomes) -> list[Row]:
    rows: list[Row] = []
    for spacing_us in _spacings(options):
        name = spacing_us * NS_PER_US
        rows += common.build_rows(outcomes, 'curve', _label(spacing_us), {
            'p50': _cost(spacing_us),
            'looked': common.figure(f'looked {name}', NS_PER_US),
            'sleeps': common.figure(f'sleeps {name}')})
    return [*rows, *(outcomes.row('wakes', {'p50': _cost(spacing_us)},
                                  f'clock_nanosleep, {spacing_us} us apart')
                     for spacing_us in _wakes(options))]


def _tries(outcomes: Outcomes, run: str, key: str) -> Metric | None:
    """Return how many of the tries missed nothing, in per cent."""
    missed = [outcome.figures[f'missed {key}'] for outcome in outcomes.measured(run)]
    return Metric((100.0 * missed.count(0) / len(missed),)) if missed else None


def _many_rows(outcomes: Outcomes) -> list[Row]:
    rows: list[Row] = []
    for key, label in _MANY:
        for build in BUILDS:
            run = common.key_of('many', build)
            row = outcomes.row(run, _many_metrics(key), f'{label}, {common.BUILD_LABELS[build]}')
            if row.metrics:
                row = common.with_metric(row, 'tries', _tries(outcomes, run, key))
            rows.append(row)
        rows.append(outcomes.row('plain', _many_metrics(key), f'{label}, plain loop'))
    return rows


def _many_metrics(key: str) -> Mapping[str, common.Of]:
    return {'reached': common.figure(f'reached_hz {key}'),
            'missed': common.figure(f'missed {key}'), 'job': common.figure(f'job_us {key}'),
            'looked': common.figure(f'looked_us {key}'),
            'cpu': common.figure(f'cpu_percent {key}')}


def _targets(outcomes: Outcomes) -> Sequence[Target]:
    ours = common.ours(outcomes, 'curve')
    targets = [
        Target('job, 100 tasks together: compiled / pure', _TOGETHER_RATIO,
               common.build_ratio(outcomes, 'curve', _cost(0)),
               why=common.disturbances(outcomes, ours)),
        Target('job, 50 us apart / a bare wake-up', _WAKE_RATIO,
               outcomes.ratio(ours, 'wakes', _cost(_SPREAD_US)),
               why=_woken(outcomes, ours) + common.disturbances(outcomes, ours))]
    many = common.ours(outcomes, 'many')
    for key, _ in _MANY:
        why = _asked_for(outcomes, many, key) + common.disturbances(outcomes, many)
        targets.append(Target(f'{MANY} tasks {key}: rate / plain loop', _RATE_RATIOS[key],
                              outcomes.ratio(many, 'plain', common.figure(f'reached_hz {key}')),
                              at_most=False, why=why))
    return targets


def _asked_for(outcomes: Outcomes, run: str, key: str) -> str:
    """Return how much of the CPU the jobs would take, if they all ran one after the other."""
    def of(outcome: RunOutcome) -> float:
        return outcome.figures[f'job_us {key}'] - outcome.figures[f'looked_us {key}']

    job = outcomes.metric(run, of)
    return '' if job is None else (
        f'a job takes {job.median:.1f} us: all of them ask for '
        f'{100 * MANY * RATE_HZ * job.median / 1e6:.0f} % of a CPU; ')


def _woken(outcomes: Outcomes, key: str) -> str:
    """Return what of a job with a moment of its own is the machine's."""
    sleeps = outcomes.metric(key, common.figure(f'sleeps {_SPREAD_US * NS_PER_US}'))
    wake = outcomes.metric('wakes', _cost(_SPREAD_US))
    return '' if sleeps is None or wake is None else (
        f'the process slept {sleeps.median:.2f} times a job, and to wake up takes '
        f'{wake.median:.1f} us without any kernel; ')


def _facts(outcomes: Outcomes) -> Mapping[str, Metric | None]:
    found: dict[str, Metric | None] = {
        facts.WAKE_CPU: outcomes.metric('wakes', _cost(_ALONE_US))}
    for build in BUILDS:
        curve = common.key_of('curve', build)
        for name, spacing_us in ((facts.TOGETHER, 0), (facts.SPREAD, _SPREAD_US),
                                 (facts.ALONE, _ALONE_US)):
            found[facts.of_build(name, build)] = outcomes.metric(curve, _cost(spacing_us))
        for name, key in ((facts.REACHED, 'together'), (facts.REACHED_SPREAD, 'spread')):
            found[facts.of_build(name, build)] = outcomes.metric(
                common.key_of('many', build), common.figure(f'reached_hz {key}'))
    return found


def _plot(outcomes: Outcomes) -> Plot:
    curves = [(common.key_of('curve', build), f'rt_robot_os, {common.BUILD_LABELS[build]}')
              for build in BUILDS] + [('wakes', 'clock_nanosleep, bare wake-ups')]
    series = []
    for key, label in curves:
        known = [(us or _TOGETHER_X, metric.median) for us in SPACINGS_US
                 if (metric := outcomes.metric(key, _cost(us))) is not None]
        if known:
            series.append(Series(label, [x for x, _ in known], [y for _, y in known], 'marks'))
    ticks = [(us or _TOGETHER_X, str(us) if us else 'together') for us in SPACINGS_US]
    return Plot('cost', 'Cost of a job by how far releases lie apart',
                'from one release to the next, us', 'CPU time a job, us', series,
                'Lower is better. Together: one wake-up of the CPU is shared by 100 tasks. Where '
                'releases follow sooner than an alarm pays, the kernel waits awake. On the right '
                'each has a wake-up of its own, and the CPU knows less and less of what it did '
                'last; a bare loop shows what the wake-up alone takes.', True,
                y_from_zero=True, x_ticks=ticks)


def _evaluate(options: BenchOptions, outcomes: Outcomes) -> CaseResult:
    return CaseResult(CASE.name, CASE.title, (
        Table('', _COLUMNS, _curve_rows(options, outcomes), _NOTES),
        Table('A thousand tasks', _MANY_COLUMNS, _many_rows(outcomes), _MANY_NOTES)),
        _targets(outcomes), (_plot(outcomes),), facts=_facts(outcomes))


CASE = Case('spacing', 'cost of a job by the spacing of releases; 1000 tasks', _plan, _evaluate,
            docs_repeats=5)

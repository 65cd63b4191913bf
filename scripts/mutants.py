#!/usr/bin/env python3
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

"""
Mutation testing: change the source at random places, one at a time, and run the tests.

    scripts/mutants.py rt_robot_os/features/alarms test/alarms --count 200 --seed 1

Mutants are drawn from a file or a folder. Each is made in a copy of the tree, where the tests that
import the mutated module run, those that import it directly first. A result is one JSON line in
``--output``; a later run with the same output skips the mutants that are in it. A mutant without
any test that imports its module is "not covered". The exit code is 1 when a mutant survived.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import asdict
from dataclasses import dataclass
import json
import os
from pathlib import Path
import random
import re
import signal
import subprocess
import sys
import tempfile
import time

from core_build import copy_tree
from core_build import ROOT

PACKAGE = 'rt_robot_os'
TIMEOUT_LEAST_S = 20.0
TIMEOUT_FACTOR = 4.0
KILLED, SURVIVED, TIMED_OUT, NOT_COVERED = 'killed', 'survived', 'timed out', 'not covered'
# pytest's exit codes: tests failed; interrupted, as by an error while they are collected.
FAILED_CODES = (1, 2)
SWAPS = {ast.Lt: '<=', ast.LtE: '<', ast.Gt: '>=', ast.GtE: '>', ast.Eq: '!=', ast.NotEq: '==',
         ast.Is: 'is not', ast.IsNot: 'is', ast.In: 'not in', ast.NotIn: 'in', ast.Add: '-',
         ast.Sub: '+', ast.Mult: '/', ast.Div: '*', ast.FloorDiv: '*', ast.Mod: '//',
         ast.LShift: '>>', ast.RShift: '<<', ast.BitAnd: '|', ast.BitOr: '&', ast.And: 'or',
         ast.Or: 'and'}
OPERATOR = re.compile(r'not\s+in|is\s+not|<=|>=|==|!=|//|<<|>>|\bis\b|\bin\b|\bor\b|\band\b'
                      r'|[<>+\-*/%&|]')
MODULE = re.compile(rf'from {PACKAGE}((?:\.\w+)*) import (\w+)|{PACKAGE}((?:\.\w+)+)')


@dataclass(frozen=True)
class Mutant:
    """A change of one file: bytes from ``start`` to ``end`` are replaced."""

    file: str
    line: int
    start: int
    end: int
    before: str
    after: str

    def __str__(self) -> str:
        return f'{self.file}:{self.line}: {self.before!r} -> {self.after!r}'


class Sites(ast.NodeVisitor):
    """Find the places of a file that can be changed; annotations and type checking are not."""

    def __init__(self, file: str, source: bytes) -> None:
        self.found: list[Mutant] = []
        self._file = file
        self._source = source
        lines = source.splitlines(keepends=True)
        self._starts = [sum(map(len, lines[:n])) for n in range(len(lines))]
        self.visit(ast.parse(source))

    def _span(self, node: ast.expr) -> tuple[int, int]:
        return (self._starts[node.lineno - 1] + node.col_offset,
                self._starts[(node.end_lineno or 1) - 1] + (node.end_col_offset or 0))

    def _add(self, line: int, start: int, end: int, after: str) -> None:
        before = self._source[start:end].decode()
        self.found.append(Mutant(self._file, line, start, end, before, after))

    def _swap(self, left: ast.expr, right: ast.expr, kind: ast.AST) -> None:
        """Replace the operator between two operands."""
        begin = self._span(left)[1]
        between = self._source[begin:self._span(right)[0]].decode()
        match = OPERATOR.search(between)
        if match and type(kind) in SWAPS:
            self._add(left.end_lineno or 1, begin + len(between[:match.start()].encode()),
                      begin + len(between[:match.end()].encode()), SWAPS[type(kind)])

    def visit_Compare(self, node: ast.Compare) -> None:
        operands = [node.left, *node.comparators]
        for left, right, kind in zip(operands, operands[1:], node.ops):
            self._swap(left, right, kind)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if not any(isinstance(each, ast.JoinedStr) or isinstance(each, ast.Constant)
                   and isinstance(each.value, str | bytes) for each in (node.left, node.right)):
            self._swap(node.left, node.right, node.op)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        for left, right in zip(node.values, node.values[1:]):
            self._swap(left, right, node.op)
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        after = {bool: lambda value: repr(not value), int: lambda value: repr(value + 1),
                 float: lambda value: repr(2.0 * value or 1.0)}.get(type(node.value))
        if after is not None:
            self._add(node.lineno, *self._span(node), after(node.value))

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Not):
            self._add(node.lineno, self._span(node)[0], self._span(node.operand)[0], '')
        self.generic_visit(node)

    def visit_If(self, node: ast.If) -> None:
        if 'TYPE_CHECKING' not in ast.unparse(node.test):
            self._add(node.lineno, *self._span(node.test), 'False')
            self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        if node.value is not None and not (
                isinstance(node.value, ast.Constant) and node.value.value is None):
            self._add(node.lineno, *self._span(node.value), 'None')
            self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            self.visit(part)

    visit_AsyncFunctionDef = visit_FunctionDef


def mutants_of(root: Path, target: Path) -> list[Mutant]:
    """Return all mutants of a file or of the files in a folder, in order."""
    paths = sorted(target.rglob('*.py')) if target.is_dir() else [target]
    return [mutant for path in paths
            for mutant in Sites(str(path.relative_to(root)), path.read_bytes()).found]


def imported(path: Path) -> set[str]:
    """Return the modules of the package that a file names, as imports or in strings."""
    found = set()
    for match in MODULE.finditer(path.read_text(encoding='utf-8')):
        found |= {f'{PACKAGE}{match[1] or match[3] or ""}',
                  f'{PACKAGE}{match[1] or ""}.{match[2]}' if match[2] else PACKAGE}
    return found


class TestChoice:
    """Choose the tests that import a module, at any distance, the nearest first."""

    __test__ = False

    def __init__(self, root: Path, tests: Sequence[Path]) -> None:
        self._root = root
        self._tests = sorted(path for each in tests for path in (
            each.rglob('test_*.py') if each.is_dir() else (each,)))
        self._graph: dict[str, set[str]] = {}
        for path in (root / PACKAGE).rglob('*.py'):
            parts = path.relative_to(root).with_suffix('').parts
            name = '.'.join(parts[:-1] if parts[-1] == '__init__' else parts)
            self._graph[name] = imported(path)

    def tests_of(self, file: str) -> list[str]:
        """Return the test files for a mutated file."""
        module = file.removesuffix('.py').removesuffix('/__init__').replace('/', '.')
        ranked = []
        for path in self._tests:
            level, seen = imported(path), set[str]()
            for distance in range(len(self._graph)):
                if module in level or not level:
                    break
                seen |= level
                level = {each for name in level for each in self._graph.get(name, ())} - seen
            if module in level:
                ranked.append((distance, str(path.relative_to(self._root))))
        return [name for _, name in sorted(ranked)]


class Runner:
    """Run tests in a copy of the tree; the time limit follows from a clean run of the same."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._limits_s: dict[tuple[str, ...], float] = {}

    def run(self, tests: Sequence[str], limit_s: float | None = None) -> int | None:
        """Run them up to the first failure; return pytest's exit code, None after the limit."""
        process = subprocess.Popen(
            [sys.executable, '-B', '-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider', *tests],
            cwd=self._folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL, start_new_session=True,
            env={**os.environ, 'RT_ROBOT_OS_COMPILE': '0', 'PYTHONPATH': str(self._folder)})
        try:
            return process.wait(limit_s)
        except subprocess.TimeoutExpired:
            return None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def limit_s(self, tests: Sequence[str]) -> float:
        """Return the time limit of tests, from a clean run that has to pass."""
        key = tuple(tests)
        if key not in self._limits_s:
            begin_s = time.monotonic()
            if self.run(tests):
                raise SystemExit(f'these tests fail without any change: {" ".join(tests)}')
            self._limits_s[key] = max(TIMEOUT_LEAST_S,
                                      TIMEOUT_FACTOR * (time.monotonic() - begin_s))
        return self._limits_s[key]

    def outcome(self, mutant: Mutant, tests: Sequence[str]) -> str:
        """Apply a mutant, run tests, and restore the file."""
        if not tests:
            return NOT_COVERED
        limit_s = self.limit_s(tests)
        path = self._folder / mutant.file
        source = path.read_bytes()
        try:
            path.write_bytes(source[:mutant.start] + mutant.after.encode() + source[mutant.end:])
            code = self.run(tests, limit_s)
        finally:
            path.write_bytes(source)
        return {None: TIMED_OUT, 0: SURVIVED}.get(code, KILLED if code in FAILED_CODES
                                                  else f'error {code} of pytest')


def read_results(path: Path) -> Iterator[tuple[Mutant, str]]:
    """Yield the results of an earlier run; a last line that is cut off is left out."""
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            values = json.loads(line)
        except ValueError:
            continue
        yield Mutant(**{key: values[key] for key in Mutant.__annotations__}), values['outcome']


def main(argv: Sequence[str] | None = None, root: Path = ROOT) -> int:
    """Draw mutants and run their tests."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('target', type=Path, help='file or folder of the package')
    parser.add_argument('tests', type=Path, nargs='+', help='files or folders of tests')
    parser.add_argument('--count', type=int, default=100, help='mutants to draw')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--output', type=Path, default=Path('mutants.jsonl'))
    options = parser.parse_args(argv)
    everything = mutants_of(root, (root / options.target).resolve())
    drawn = random.Random(options.seed).sample(everything, min(options.count, len(everything)))
    results = dict(read_results(options.output))
    with tempfile.TemporaryDirectory(prefix='rt_robot_os_mutants_') as name:
        copy_tree(Path(name), root)
        choice = TestChoice(root, [(root / each).resolve() for each in options.tests])
        runner = Runner(Path(name))
        for mutant in drawn:
            if mutant in results:
                continue
            results[mutant] = outcome = runner.outcome(mutant, choice.tests_of(mutant.file))
            with open(options.output, 'a') as file:
                file.write(json.dumps({**asdict(mutant), 'outcome': outcome}) + '\n')
            print(f'{outcome}: {mutant}', flush=True)
    outcomes = [results[mutant] for mutant in drawn]
    for outcome in sorted(set(outcomes)):
        print(f'{outcomes.count(outcome)} {outcome}')
    return int(SURVIVED in outcomes)


if __name__ == '__main__':
    for number in (signal.SIGTERM, signal.SIGINT):  # so that `finally` runs
        signal.signal(number, lambda *_: sys.exit(130))
    sys.exit(main())

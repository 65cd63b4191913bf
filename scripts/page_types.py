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
Write rt_robot_os/monitor/page/types.d.ts: what the server answers, as types of TypeScript.

They come from the models of the routes (``/api/openapi.json``). The page itself stays JavaScript:
an editor, and ``tsc`` in a test, read the types in comments of its files.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
import json
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from typing import Any
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
TARGET: Final = ROOT / 'rt_robot_os' / 'monitor' / 'page' / 'types.d.ts'
_HEAD: Final = '// Made by scripts/page_types.py from the models of the routes; a test compares.\n'
_PLAIN: Final = {'string': 'string', 'integer': 'number', 'number': 'number',
                 'boolean': 'boolean', 'null': 'null'}
_ERRORS: Final = 'ErrorAnswer'


def described() -> dict[str, Any]:
    """Return the description of the API of a server of this tree."""
    from rt_robot_os.monitor.app import create_app
    from rt_robot_os.monitor.server import make_services
    from rt_robot_os.monitor.settings import MonitorSettings
    with TemporaryDirectory() as folder:
        services = make_services(MonitorSettings(port=0, where=Path(folder)))
        try:
            found: dict[str, Any] = create_app(services).openapi()
        finally:
            services.writer.close()
            services.accounts.close()
            services.store.close()
    return found


def types_of(description: Mapping[str, Any]) -> str:
    """Write the types of a description."""
    schemas = description['components']['schemas']
    answers = {f'{method.upper()} {path}': schema
               for path, methods in sorted(description['paths'].items())
               for method, operation in sorted(methods.items())
               if (schema := _answer(operation)) is not None}
    needed = _needed(schemas, [*answers.values(), {'$ref': f'#/{_ERRORS}'}])
    parts = [_interface(name, schemas[name]) for name in sorted(needed)]
    parts.append('/** What each route answers. */\nexport interface Answers {\n' + ''.join(
        f"  '{name}': {_type(schema)};\n" for name, schema in answers.items()) + '}\n')
    return '\n'.join((_HEAD, *parts))


def _answer(operation: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return the schema of an answer that is JSON with a model."""
    for status, answer in operation['responses'].items():
        schema = answer.get('content', {}).get('application/json', {}).get('schema')
        if status.startswith('2') and schema and _type(schema) != 'unknown':
            found: Mapping[str, Any] = schema
            return found
    return None


def _needed(schemas: Mapping[str, Any], wanted: list[Any]) -> set[str]:
    names: set[str] = set()
    left: list[Any] = list(wanted)
    while left:
        each = left.pop()
        if isinstance(each, Mapping):
            name = str(each.get('$ref', '')).rpartition('/')[2]
            if name and name not in names:
                names.add(name)
                left.append(schemas[name])
            left.extend(value for key, value in each.items() if key != 'default')
        elif isinstance(each, list):
            left.extend(each)
    return names


def _interface(name: str, schema: Mapping[str, Any]) -> str:
    required = set(schema.get('required', ()))
    text = ' '.join(str(schema.get('description', '')).split())
    lines = [f'/** {text} */'] if text else []
    lines.append(f'export interface {name} {{')
    for field, each in schema.get('properties', {}).items():
        lines.append(f"  {field}{'' if field in required else '?'}: {_type(each)};")
    if schema.get('additionalProperties') is True:
        lines.append('  [more: string]: any;')
    return '\n'.join(lines) + '\n}\n'


def _type(schema: Mapping[str, Any]) -> str:
    if '$ref' in schema:
        return str(schema['$ref']).rpartition('/')[2]
    if 'anyOf' in schema:
        return ' | '.join(dict.fromkeys(_type(each) for each in schema['anyOf']))
    if 'enum' in schema or 'const' in schema:
        return ' | '.join(map(json.dumps, schema.get('enum', [schema.get('const')])))
    kind = schema.get('type')
    if kind == 'array':
        inner = _type(schema.get('items', {}))
        return f'({inner})[]' if ' ' in inner else f'{inner}[]'
    if kind == 'object':
        more = schema.get('additionalProperties')
        return f'Record<string, {_type(more) if isinstance(more, Mapping) and more else "any"}>'
    return _PLAIN.get(str(kind), 'any' if 'title' in schema or not schema else 'unknown')


def main() -> int:
    """Write the file, or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--check', action='store_true', help='compare only; 1: it is another')
    check = parser.parse_args().check
    text = types_of(described())
    if check:
        return int(not TARGET.is_file() or TARGET.read_text(encoding='utf-8') != text)
    TARGET.write_text(text, encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())

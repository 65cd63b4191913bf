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
Measure driving from afar: from the page to the motor's wire, and to standstill after failures.

It starts a core with a motor board on a pty (``drive_board.py``), a gateway, a server and a
browser, drives through the page, and prints JSON::

    ./scripts/bench measure_drive             # what needs no root
    ./scripts/bench measure_drive --network   # cut cables too, in two network namespaces (root)
    ./scripts/bench measure_drive --kinds blur,server_killed --trials 10

``latency_ms`` is from the pointer's event in the page to the order on the wire; ``standstill_ms``
from the failure to wheels that are slower than 0.01 m/s, from the fastest speed. Nothing else
should run meanwhile.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
import json
import math
import os
from pathlib import Path
import random
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

SPACES = {'page': ('rtdrvp', '10.231.7'), 'robot': ('rtdrvr', '10.231.8')}
PATIENCE_S = 30.0
SETTLE_S = 1.2
PAGE_KINDS = ('let_go', 'blur', 'hidden', 'gamepad', 'pointer_cancelled', 'page_clock_jump')
PROCESS_KINDS = ('tab_killed', 'server_stopped', 'server_killed', 'gateway_stopped',
                 'gateway_killed', 'second_operator', 'session_revoked')
NETWORK_KINDS = ('page_cable', 'page_loss', 'robot_cable', 'robot_loss')
_PACKAGES = {'core': 'core', 'server': 'monitor', 'gateway': 'gateway'}
GAMEPAD = """() => {
  const pad = {index: 0, connected: true, axes: [0, -1, 0, 0], mapping: 'standard',
    buttons: Array.from({length: 17}, () => ({pressed: false, value: 0}))};
  window.fakePad = pad;
  navigator.getGamepads = () => (window.fakePad ? [window.fakePad] : []);
}"""
WATCH = """() => {
  const stick = document.querySelector('.stick');
  stick.addEventListener('pointermove', () => { window.movedAt = performance.now(); },
    {capture: true});
}"""


def until(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """Wait until something is true, and give it."""
    end_s = time.monotonic() + patience_s
    while not (found := condition()):
        if time.monotonic() > end_s:
            raise RuntimeError(f'{what} did not happen within {patience_s:g} s')
        time.sleep(0.005)
    return found


class Bench:
    """All processes; each can be killed and started again."""

    def __init__(self, folder: Path, network: bool) -> None:
        self.folder = folder
        self.network = network
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.scheme = 'https' if network else 'http'
        self.host = f'{SPACES["page"][1]}.1' if network else '127.0.0.1'
        self.robot_host = f'{SPACES["robot"][1]}.1' if network else '127.0.0.1'
        self.port = free_port()
        self.environment = {
            **os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(folder), 'OPENBLAS_NUM_THREADS': '1',
            'ROS_HOME': str(folder / 'home'),
            'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')])}

    @property
    def url(self) -> str:
        return f'{self.scheme}://{self.host}:{self.port}'

    def start(self, name: str) -> None:
        """Start one of them, or again."""
        self.end(name)
        log = (self.folder / f'{name}.log').open('ab')
        self.processes[name] = subprocess.Popen(
            self._command(name), cwd=self.folder, env=self.environment, stdout=log, stderr=log)
        if name == 'server':
            until(self._is_served, 'the server')

    def _is_served(self) -> bool:
        with socket.socket() as found:
            return found.connect_ex((self.host, self.port)) == 0

    def _command(self, name: str) -> list[str]:
        python, folder = sys.executable, self.folder
        module = [python, '-m', f'rt_robot_os.{_PACKAGES.get(name, "")}.program']
        if name == 'board':
            return [python, '-m', 'benchmarks.commands.drive_board', str(folder / 'board'),
                    str(folder / 'board.log')]
        if name == 'core':
            return [*module, '--ros-args', '--params-file', str(folder / 'robot.yaml')]
        if name == 'server':
            tls = ['--certificate', str(folder / 'monitor' / 'server.pem'), '--key',
                   str(folder / 'monitor' / 'server.key')] if self.network else []
            host = '0.0.0.0' if self.network else '127.0.0.1'
            return [*module, '--host', host, '--port', str(self.port), '--folder',
                    str(folder / 'monitor'), *tls]
        inside = ['ip', 'netns', 'exec', SPACES['robot'][0]] if self.network else []
        return [*inside, *module, '--ros-args', '--params-file', str(folder / 'gateway.yaml')]

    def signal(self, name: str, number: int) -> None:
        self.processes[name].send_signal(number)

    def end(self, name: str) -> None:
        process = self.processes.pop(name, None)
        if process is not None and process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def close(self) -> None:
        for name in ('gateway', 'server', 'core', 'board'):
            self.end(name)


def free_port() -> int:
    with socket.socket() as found:
        found.bind(('127.0.0.1', 0))
        return int(found.getsockname()[1])


def write_settings(bench: Bench) -> None:
    """Write the parameter files, the accounts and the certificate."""
    folder = bench.folder
    (folder / 'robot.yaml').write_text(f"""
robot:
  ros__parameters:
    core: {{cpu: -1, scheduler_priority: 80}}
    devices: [base]
    base: {{type: roboclaw, port: {folder / 'board'}, command_topic: cmd_vel_mux,
           wheel_radius_m: 0.075, wheel_separation_m: 0.34, ticks_per_revolution: 4096.0,
           maximum_wheel_speed_m_s: 0.8, output_rate_hz: 50.0, rate_hz: 100.0, priority: 75,
           command_timeout_s: 0.3, standstill_s: 5.0}}
    modules: [odometry, velocity_mux]
    odometry: {{type: odometry, wheel_radius_m: 0.075, wheel_separation_m: 0.34, rate_hz: 50.0,
               priority: 58}}
    velocity_mux: {{type: velocity_mux, rate_hz: 20.0, priority: 65,
                   source_timeouts_s: [0.12, 0.5, 0.5, 0.5]}}
    topics: [cmd_vel, cmd_vel_teleop, cmd_vel_agent, cmd_vel_trajectory, estop, estop_release]
    cmd_vel: {{message: geometry_msgs/msg/Twist}}
    cmd_vel_teleop: {{message: geometry_msgs/msg/Twist}}
    cmd_vel_agent: {{message: geometry_msgs/msg/Twist}}
    cmd_vel_trajectory: {{message: geometry_msgs/msg/Twist}}
    estop: {{message: std_msgs/msg/Bool}}
    estop_release: {{message: std_msgs/msg/Bool}}
""")
    scheme = 'wss' if bench.network else 'ws'
    token = folder / 'token'
    authority = f'ca_file: {folder / "monitor" / "ca.pem"}' if bench.network else ''
    (folder / 'gateway.yaml').write_text(f"""
/**/gateway:
  ros__parameters:
    server: {scheme}://{bench.robot_host}:{bench.port}
    token_file: {token}
    people: [anna]
    {authority}
""")
    where = folder / 'monitor'
    if bench.network:
        subprocess.run([sys.executable, '-m', 'rt_robot_os.monitor.program', 'certificate', 'make',
                        '--folder', str(where), '--name', bench.host, '--name',
                        bench.robot_host], check=True, env=bench.environment,
                       stdout=subprocess.DEVNULL)
    from rt_robot_os.monitor.security.accounts import Accounts
    from rt_robot_os.monitor.security.roles import Role
    from rt_robot_os.monitor.store.store import Store
    where.mkdir(exist_ok=True)
    store = Store.open(str(where / 'monitor.db'))
    accounts = Accounts.open(store.engine, where)
    robot, secret = accounts.robots.add('robot')
    token.write_text(secret)
    token.chmod(0o600)
    for name in ('carol', 'dave'):
        accounts.users.add(name, Role.OPERATOR, ('*',), 'measurement', 'no password')
    accounts.close()
    store.close()
    bench.robot_id = robot.id  # type: ignore[attr-defined]


def new_session(bench: Bench, name: str) -> tuple[str, str]:
    """Begin a session of somebody; return its cookie and its CSRF token."""
    from rt_robot_os.monitor.security.accounts import Accounts
    from rt_robot_os.monitor.security.tokens import csrf_token
    from rt_robot_os.monitor.store.store import Store
    where = bench.folder / 'monitor'
    store = Store.open(str(where / 'monitor.db'))
    accounts = Accounts.open(store.engine, where)
    user = accounts.users.find(name)
    assert user is not None
    _, secret = accounts.sessions.begin(user.id, '127.0.0.1', 'measurement')
    accounts.close()
    store.close()
    return secret, csrf_token(secret)


class Wire:
    """What the board has noted."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def lines(self, since_ns: int) -> Iterator[tuple[str, int, list[float]]]:
        """Return what came after a time: kind, time, numbers."""
        for line in self._path.read_text().splitlines():
            words = line.split()
            if len(words) >= 2 and int(words[1]) >= since_ns:
                yield words[0], int(words[1]), [float(each) for each in words[2:]]

    def speed(self) -> float:
        """Return what is ordered now."""
        orders = [numbers for kind, _, numbers in self.lines(0) if kind == 'order']
        return sum(orders[-1]) / 2 if orders else 0.0

    def first(self, kind: str, since_ns: int) -> int | None:
        """Return when something happened first after a time."""
        return next((t_ns for each, t_ns, _ in self.lines(since_ns) if each == kind), None)

    @property
    def moves(self) -> bool:
        """Return whether the wheels turn."""
        last = [kind for kind, _, _ in self.lines(0) if kind != 'order']
        return bool(last) and last[-1] == 'moves'


class Driver:
    """Somebody at a browser who drives."""

    def __init__(self, bench: Bench, browser: Any, name: str) -> None:
        self.bench = bench
        self.name = name
        self.secret, self.csrf = new_session(bench, name)
        self.context = browser.new_context(ignore_https_errors=True,
                                           viewport={'width': 1280, 'height': 800}, locale='en')
        self.context.add_cookies([{
            'name': '__Host-session' if bench.network else 'session', 'value': self.secret,
            'url': bench.url, 'secure': bench.network}])
        self.page = self.context.new_page()

    def open_view(self) -> None:
        """Open the view of the robot."""
        robot = self.bench.robot_id  # type: ignore[attr-defined]
        self.page.goto(f'{self.bench.url}/#/drive/{robot}')
        self.page.evaluate(GAMEPAD)
        self.page.wait_for_selector('.stick')

    def take(self, over: bool = False) -> None:
        """Take the wheel."""
        if over:
            self.page.click('.seat-other .drive-seat button')
            self.page.click('dialog button[type=submit]')
        else:
            self.page.click('.seat-free .drive-seat button:not([disabled])', timeout=20_000)
            self.page.wait_for_selector('.seat-yours .drive-facts .badge:is(.tone-ok, .tone-warn)')

    def hold(self, share: float = 1.0) -> None:
        """Hold the stick, pulled forward by a share."""
        box = self.page.locator('.stick').bounding_box()
        self.x, self.y = box['x'] + box['width'] / 2, box['y'] + box['height'] / 2
        self.reach = box['width'] / 2 * 0.62
        self.page.mouse.move(self.x, self.y)
        self.page.mouse.down()
        self.pull(share)

    def pull(self, share: float) -> None:
        self.page.mouse.move(self.x, self.y - share * self.reach)

    def let_go(self) -> None:
        self.page.mouse.up()

    def press_gamepad(self) -> None:
        self.page.evaluate('() => { window.fakePad.buttons[4].pressed = true; }')

    def clock_offset_ns(self) -> float:
        """Return CLOCK_MONOTONIC minus the page's clock."""
        best: tuple[int, float] | None = None
        for _ in range(30):
            before = time.monotonic_ns()
            now = self.page.evaluate('() => performance.now()')
            after = time.monotonic_ns()
            if best is None or after - before < best[0]:
                best = after - before, (before + after) / 2 - now * 1e6
        assert best is not None
        return best[1]

    def close(self) -> None:
        self.context.close()


class Measurement:
    """All trials."""

    def __init__(self, bench: Bench, browser: Any) -> None:
        self.bench = bench
        self.browser = browser
        self.wire = Wire(bench.folder / 'board.log')

    def latency(self, trials: int) -> list[float]:
        """Return the times from the pointer's event to the wire, in ms."""
        driver = Driver(self.bench, self.browser, 'carol')
        driver.open_view()
        driver.take()
        self._full_speed(driver)
        driver.page.evaluate(WATCH)
        chance = random.Random(7)
        offset_ns = driver.clock_offset_ns()
        found = []
        for number in range(trials):
            share = 0.5 + 0.45 * (number % 2) + chance.uniform(0.0, 0.04)
            time.sleep(chance.uniform(0.1, 0.25))
            before_ns = time.monotonic_ns()
            driver.pull(share)
            t_ns = until(lambda: self.wire.first('order', before_ns), 'an order on the wire')
            sent_ns = driver.page.evaluate('() => window.movedAt') * 1e6 + offset_ns
            found.append((t_ns - sent_ns) / 1e6)
        driver.close()
        self._rested()
        return found

    def standstill(self, kind: str) -> float:
        """Return the time from a failure to standstill, in ms."""
        driver = Driver(self.bench, self.browser, 'carol')
        other = None
        if kind == 'second_operator':
            other = Driver(self.bench, self.browser, 'dave')
            other.open_view()
        driver.open_view()
        driver.take()
        if kind == 'gamepad':
            driver.page.evaluate('() => window.fakePad')
            driver.press_gamepad()
        self._full_speed(driver, kind != 'gamepad')
        if other is not None:
            other.page.click('.seat-other .drive-seat button')
        time.sleep(random.uniform(0.0, 0.08))
        fail = getattr(self, f'_{kind}', None) or (lambda each: self._network(kind))
        t0_ns = time.monotonic_ns()
        t0_ns = fail(other or driver) or t0_ns
        rest_ns: int = until(lambda: self.wire.first('rests', t0_ns), f'standstill after {kind}')
        time.sleep(0.5)
        if self.wire.moves:
            raise RuntimeError(f'{kind}: it moves again by itself')
        self._mend(kind)
        for each in (driver, other):
            if each is not None:
                each.close()
        self._rested()
        return (rest_ns - t0_ns) / 1e6

    def _full_speed(self, driver: Driver, by_stick: bool = True) -> None:
        """Drive at the highest speed until the wheels do."""
        driver.page.evaluate("""() => { const s = document.querySelector('.drive-limit input');
          s.value = 100; s.dispatchEvent(new Event('input')); }""")
        if by_stick:
            driver.hold()
        until(lambda: self.wire.speed() > 0.295, 'full speed on the wire')
        time.sleep(0.6)
        if not self.wire.speed() > 0.295:
            raise RuntimeError('it does not keep its speed')

    def _rested(self) -> None:
        until(lambda: not self.wire.moves, 'standstill')

    # ---- failures; each may return when it really happened ----------------------------------

    def _let_go(self, driver: Driver) -> None:
        driver.let_go()

    def _blur(self, driver: Driver) -> None:
        driver.page.evaluate("() => window.dispatchEvent(new Event('blur'))")

    def _hidden(self, driver: Driver) -> None:
        driver.page.evaluate("""() => {
          Object.defineProperty(document, 'hidden', {value: true, configurable: true});
          document.dispatchEvent(new Event('visibilitychange')); }""")

    def _gamepad(self, driver: Driver) -> None:
        driver.page.evaluate('() => { window.fakePad = null; }')

    def _pointer_cancelled(self, driver: Driver) -> None:
        driver.page.evaluate("""() => document.querySelector('.stick').dispatchEvent(
          new PointerEvent('pointercancel', {pointerId: 1, bubbles: true}))""")

    def _page_clock_jump(self, driver: Driver) -> int:
        """Set the page's time of day: nothing happens; then let go."""
        driver.page.evaluate("""() => { const now = Date.now; Date.now = () => now() - 3.6e6; }""")
        time.sleep(0.5)
        if not self.wire.speed() > 0.295:
            raise RuntimeError('a time of day stopped it')
        t0_ns = time.monotonic_ns()
        driver.let_go()
        return t0_ns

    def _tab_killed(self, driver: Driver) -> int:
        pid = renderer_of(self.browser, driver.page)
        t0_ns = time.monotonic_ns()
        os.kill(pid, signal.SIGKILL)
        return t0_ns

    def _server_stopped(self, driver: Driver) -> None:
        self.bench.signal('server', signal.SIGSTOP)

    def _server_killed(self, driver: Driver) -> None:
        self.bench.signal('server', signal.SIGKILL)

    def _gateway_stopped(self, driver: Driver) -> None:
        self.bench.signal('gateway', signal.SIGSTOP)

    def _gateway_killed(self, driver: Driver) -> None:
        self.bench.signal('gateway', signal.SIGKILL)

    def _second_operator(self, other: Driver) -> int:
        t0_ns = time.monotonic_ns()
        other.page.click('dialog button[type=submit]')
        return t0_ns

    def _session_revoked(self, driver: Driver) -> int:
        """End the session by the endpoint that the page has for it, from elsewhere."""
        request = self.browser.new_context(ignore_https_errors=True).request
        t0_ns = time.monotonic_ns()
        answer = request.delete(f'{self.bench.url}/api/session', headers={
            'Cookie': f'{"__Host-session" if self.bench.network else "session"}={driver.secret}',
            'X-CSRF-Token': driver.csrf, 'Origin': self.bench.url})
        if not answer.ok:
            raise RuntimeError(f'the session does not end: {answer.status} {answer.text()}')
        return t0_ns

    def _network(self, kind: str) -> int:
        where, how = kind.split('_')
        space, _ = SPACES[where]
        t0_ns = time.monotonic_ns()
        if how == 'cable':
            run('ip', 'link', 'set', f'{space}0', 'down')
        else:
            t0_ns = lose(where)
        return t0_ns

    def _mend(self, kind: str) -> None:
        """Put right what a trial broke; a process that was stopped goes on, and moves nothing."""
        name = kind.split('_')[0]
        if kind.endswith('_stopped'):
            self.bench.signal(name, signal.SIGCONT)
            time.sleep(1.0)
            if self.wire.moves:
                raise RuntimeError(f'{kind}: what waited in it moves the robot')
        elif kind in ('server_killed', 'gateway_killed'):
            self.bench.start(name)
        elif kind in NETWORK_KINDS:
            mend(name)
            time.sleep(1.0)
            if self.wire.moves:
                raise RuntimeError(f'{kind}: what waited on the way moves the robot')
        time.sleep(SETTLE_S)


def renderer_of(browser: Any, page: Any) -> int:
    """Return the process of a page: the one that has burnt the most while the page computes."""
    session = browser.new_browser_cdp_session()

    def times() -> dict[int, float]:
        found = session.send('SystemInfo.getProcessInfo')['processInfo']
        return {each['id']: each['cpuTime'] for each in found if each['type'] == 'renderer'}

    before = times()
    page.evaluate('() => { const end = performance.now() + 30; while (performance.now() < end); }')
    after = times()
    session.detach()
    return max(after, key=lambda pid: after[pid] - before.get(pid, 0.0))


# ---- namespaces -----------------------------------------------------------------------------


def run(*command: str) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def make_spaces() -> None:
    """Make a network namespace for the page and one for the gateway, each on a cable."""
    for space, net in SPACES.values():
        run('ip', 'netns', 'add', space)
        run('ip', 'link', 'add', f'{space}0', 'type', 'veth', 'peer', 'name', f'{space}1')
        run('ip', 'link', 'set', f'{space}1', 'netns', space)
        run('ip', 'addr', 'add', f'{net}.1/24', 'dev', f'{space}0')
        run('ip', 'link', 'set', f'{space}0', 'up')
        run('ip', 'netns', 'exec', space, 'ip', 'addr', 'add', f'{net}.2/24', 'dev', f'{space}1')
        run('ip', 'netns', 'exec', space, 'ip', 'link', 'set', f'{space}1', 'up')
        run('ip', 'netns', 'exec', space, 'ip', 'link', 'set', 'lo', 'up')


def lose(where: str) -> int:
    """
    Lose every packet on a cable, both ways: each goes to an address that nobody has.

    What comes from the robot is lost first; to take the other way as well is a moment's work, and
    only that ends what the robot is told.

    :return: when the second way was about to be lost.
    """
    space, net = SPACES[where]
    replace, nobody = ('ip', 'neigh', 'replace'), ('lladdr', '02:00:00:00:00:99', 'nud',
                                                   'permanent')
    here = (*replace, f'{net}.2', *nobody, 'dev', f'{space}0')
    there = ('ip', 'netns', 'exec', space, *replace, f'{net}.1', *nobody, 'dev', f'{space}1')
    up, down = (here, there) if where == 'page' else (there, here)
    run(*up)
    t0_ns = time.monotonic_ns()
    run(*down)
    return t0_ns


def mend(where: str) -> None:
    """Let a cable be whole again."""
    space, net = SPACES[where]
    run('ip', 'link', 'set', f'{space}0', 'up')
    for before, name, address in (((), f'{space}0', f'{net}.2'), (
            ('ip', 'netns', 'exec', space), f'{space}1', f'{net}.1')):
        subprocess.run([*before, 'ip', 'neigh', 'del', address, 'dev', name],
                       stderr=subprocess.DEVNULL, check=False)


def remove_spaces() -> None:
    """Remove the namespaces, with their cables."""
    for space, _ in SPACES.values():
        subprocess.run(['ip', 'link', 'del', f'{space}0'], stderr=subprocess.DEVNULL, check=False)
        subprocess.run(['ip', 'netns', 'del', space], stderr=subprocess.DEVNULL, check=False)


# ---- the whole ------------------------------------------------------------------------------


@contextmanager
def browser_of(bench: Bench) -> Iterator[Any]:
    """Run a browser, in the namespace of the page if there is one."""
    from playwright.sync_api import sync_playwright
    program = os.environ.get('RT_ROBOT_OS_BROWSER') or shutil.which('chromium') or shutil.which(
        'google-chrome')
    if program is None:
        raise RuntimeError('no chromium: set RT_ROBOT_OS_BROWSER')
    if bench.network:
        wrapper = bench.folder / 'browser'
        wrapper.write_text(f'#!/bin/sh\nexec ip netns exec {SPACES["page"][0]} {program} "$@"\n')
        wrapper.chmod(0o700)
        program = str(wrapper)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=['--no-sandbox'])
        try:
            yield browser
        finally:
            browser.close()


def summary(values: list[float]) -> dict[str, float]:
    """Return what the values come to."""
    ordered = sorted(values)
    at = max(0, math.ceil(0.95 * len(ordered)) - 1)
    return {'n': len(values), 'median': round(statistics.median(values), 1),
            'p95': round(ordered[at], 1), 'least': round(ordered[0], 1),
            'most': round(ordered[-1], 1)}


def measure(bench: Bench, kinds: list[str], trials: int, commands: int) -> dict[str, Any]:
    """Measure all."""
    write_settings(bench)
    for name in ('board', 'core', 'server', 'gateway'):
        bench.start(name)
        if name == 'board':
            until((bench.folder / 'board').exists, 'the board')
    found: dict[str, Any] = {'cpus': os.cpu_count(), 'network': bench.network,
                             'load': os.getloadavg()[0], 'standstill_ms': {}, 'problems': []}
    with browser_of(bench) as browser:
        measurement = Measurement(bench, browser)
        if commands:
            found['latency_ms'] = summary(measurement.latency(commands))
        for kind in kinds:
            values = []
            for _ in range(trials):
                try:
                    values.append(measurement.standstill(kind))
                except Exception as error:
                    found['problems'].append(f'{kind}: {type(error).__name__}: {error}'[:500])
                    measurement._mend(kind)
            if values:
                found['standstill_ms'][kind] = summary(values)
                print(kind, found['standstill_ms'][kind], file=sys.stderr, flush=True)
    found['load_after'] = os.getloadavg()[0]
    return found


def main() -> int:
    """Measure, and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--trials', type=int, default=5, help='of each kind (default: 5)')
    parser.add_argument('--commands', type=int, default=200, help='for the latency')
    parser.add_argument('--kinds', default='', help='names, with commas (default: all)')
    parser.add_argument('--network', action='store_true', help='in network namespaces (root)')
    parser.add_argument('--keep', action='store_true', help='keep the folder with the logs')
    arguments = parser.parse_args()
    kinds = [each for each in arguments.kinds.split(',') if each] or [
        *PAGE_KINDS, *PROCESS_KINDS, *(NETWORK_KINDS if arguments.network else ())]
    unknown = set(kinds) - {*PAGE_KINDS, *PROCESS_KINDS, *NETWORK_KINDS, 'none'}
    if unknown:
        parser.error(f'no such kind: {", ".join(sorted(unknown))}')
    folder = Path(tempfile.mkdtemp(prefix='drive'))
    bench = Bench(folder, arguments.network)
    try:
        if arguments.network:
            make_spaces()
        found = measure(bench, [each for each in kinds if each != 'none'], arguments.trials,
                        arguments.commands)
        print(json.dumps(found, indent=1))
    finally:
        bench.close()
        if arguments.network:
            remove_spaces()
        if arguments.keep:
            print(folder, file=sys.stderr)
        else:
            shutil.rmtree(folder, ignore_errors=True)
    return 1 if found['problems'] else 0


if __name__ == '__main__':
    sys.exit(main())

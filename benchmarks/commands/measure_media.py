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
Measure how old pictures are on the screen, and how long a voice takes from mouth to ear.

    ./scripts/bench measure_media [--seconds 10] [--rounds 5] [--only pictures|voice]

A core with a simulated camera, a gateway, a server and a Chromium, all on this machine, whose
clocks are therefore one. Pictures: from the stamp of the capture to the frame in which the browser
drew it. Voice: a chirp from a WAV as microphone, what comes out at the other end, and where one
lies in the other by cross-correlation; both ways, over WebRTC, with the playing buffers, without
the microseconds to milliseconds of real sound devices. Prints JSON.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time
from typing import Any
import wave

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'shared')]

import numpy as np  # noqa: E402

RATE_HZ = 48_000
PERIOD_S = 2.0
CHIRP_S = 0.2
YAML = """
robot:
  ros__parameters:
    core: {cpu: -2, scheduler_priority: 0, lock_memory: false}
    devices: [camera]
    camera:
      {type: camera, port: sim, width: 640, height: 480, output_rate_hz: 15.0, topic: '',
       compressed_topic: camera/image_raw/compressed, rate_hz: 100.0, priority: 20}
"""
DRAWN = """() => {
  window.ages = [];
  document.querySelector('.picture').addEventListener('picture', ({detail}) => {
    window.ages.push(performance.timeOrigin + performance.now() - detail.utc_ns / 1e6);
  });
}"""
# The browser's ear and mouth: blocks of samples with the moment at which they were there.
LISTEN = """async ([code]) => {
  const {Call} = await import('/lib/voice.js');
  const call = new Call(window.robotId);
  const sound = new AudioContext({sampleRate: 48000, latencyHint: 'interactive'});
  const url = URL.createObjectURL(new Blob([code], {type: 'text/javascript'}));
  await sound.audioWorklet.addModule(url);
  window.heard = {mine: [], theirs: []};
  const listen = (stream, name) => {
    const node = new AudioWorkletNode(sound, 'ear');
    node.port.onmessage = ({data}) => {
      window.heard[name].push([performance.timeOrigin + performance.now(),
        data.frame, data.samples]);
    };
    sound.createMediaStreamSource(stream).connect(node);
    node.connect(sound.destination);
  };
  call.isOpen = true;
  call.addEventListener('stream', () => {
    listen(call.mine, 'mine');
    listen(call.theirs, 'theirs');
  });
  window.call = call;
  await call.start();
  await new Promise((done, fail) => {
    call.addEventListener('change', () => call.state === 'connected' ? done()
      : call.state === 'ended' && fail(new Error(call.why)));
  });
}"""
EAR = """registerProcessor('ear', class extends AudioWorkletProcessor {
  constructor() { super(); this.all = []; }
  process([[samples]]) {
    if (samples) {
      this.all.push(...samples);
      if (this.all.length >= 1280) {
        this.port.postMessage({frame: currentFrame + samples.length,
          samples: this.all.map((each) => Math.round(each * 32767))});
        this.all = [];
      }
    }
    return true;
  }
});"""


def chirp() -> np.ndarray:
    """Return two seconds of silence that begin with a chirp of 0.2 s, 500 to 3500 Hz."""
    at = np.arange(int(CHIRP_S * RATE_HZ)) / RATE_HZ
    sound = np.sin(2 * np.pi * (500 * at + (3000 / CHIRP_S) * at * at / 2))
    found = np.zeros(int(PERIOD_S * RATE_HZ), np.int16)
    found[:len(at)] = (12000 * sound * np.hanning(len(at))).astype(np.int16)
    return found


def write_wave(path: Path, samples: np.ndarray) -> None:
    """Write a WAV."""
    with wave.open(str(path), 'wb') as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes(samples.tobytes())


def found_at(samples: np.ndarray, period: np.ndarray) -> list[int]:
    """Return where chirps begin, in samples: peaks of the cross-correlation, a period apart."""
    pattern = period[:int(CHIRP_S * RATE_HZ)].astype(np.float64)
    size = 1 << int(np.ceil(np.log2(len(samples) + len(pattern))))
    product = np.fft.irfft(np.fft.rfft(samples.astype(np.float64), size)
                           * np.conj(np.fft.rfft(pattern, size)), size)[:len(samples)]
    found: list[int] = []
    strength = np.abs(product)
    limit = 0.4 * strength.max(initial=0.0)
    while len(found) < 100:
        peak = int(strength.argmax())
        if not strength[peak] or strength[peak] < limit:
            break
        found.append(peak)
        strength[max(0, peak - RATE_HZ):peak + RATE_HZ] = 0.0
    return sorted(found)


def moments_ms(blocks: list[list[Any]], period: np.ndarray) -> list[float]:
    """Return the moments of chirps in what a browser heard: the end of a block has a time."""
    if not blocks:
        return []
    samples = np.concatenate([np.array(each[2], np.int16) for each in blocks])
    first = blocks[0][1] - len(blocks[0][2])
    # The least delayed message tells best how the two clocks lie.
    offset_ms = min(ms - frame * 1000 / RATE_HZ for ms, frame, _ in blocks)
    return [offset_ms + (first + at) * 1000 / RATE_HZ for at in found_at(samples, period)]


def spread(values: list[float]) -> dict[str, float]:
    """Return values in numbers."""
    array = np.array(values or [float('nan')])
    return {'n': len(values), 'p50_ms': round(float(np.percentile(array, 50)), 1),
            'p95_ms': round(float(np.percentile(array, 95)), 1),
            'max_ms': round(float(array.max()), 1)}


def delays(spoken_ms: list[float], heard_ms: list[float]) -> list[float]:
    """Return how long each chirp took: to the first that was heard behind it, within 1.5 s."""
    found = []
    for spoken in spoken_ms:
        later = [each - spoken for each in heard_ms if 0 <= each - spoken < 1500]
        if later:
            found.append(min(later))
    return found


class World:
    """A robot, a gateway, a server."""

    def __init__(self, folder: Path) -> None:
        from monitor_server import logged_in
        from monitor_server import quick_services
        self.folder = folder
        (folder / 'monitor').mkdir()
        self.services = quick_services(folder / 'monitor')
        self.cookie = logged_in(self.services)['Cookie'].partition('=')[2]
        self.period = chirp()
        write_wave(folder / 'chirp.wav', self.period)

    @contextmanager
    def run(self) -> Iterator[str]:
        """Run all of it."""
        from monitor_server import served
        (self.folder / 'robot.yaml').write_text(YAML)
        core = subprocess.Popen(
            [sys.executable, '-m', 'rt_robot_os.core.program', '--ros-args', '--params-file',
             str(self.folder / 'robot.yaml')], cwd='/', stderr=subprocess.DEVNULL,
            env={**os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(self.folder),
                 'PYTHONPATH': str(ROOT)})
        try:
            with served(self.services) as address, self.gateway(address):
                yield address
        finally:
            core.terminate()
            core.wait(20)

    @contextmanager
    def gateway(self, address: str) -> Iterator[None]:
        """Run a gateway in a process of its own."""
        from fake_robot import token_of
        token = self.folder / 'token'
        token.write_text(token_of('robot'))
        token.chmod(0o600)
        path = self.folder / 'gateway.yaml'
        path.write_text(json.dumps({'/**/gateway': {'ros__parameters': {
            'server': f'ws://{address}', 'token_file': str(token),
            'folder': str(self.folder / 'gateway'), 'people': ['anna'], 'duck_db': 0.0,
            'observations_folder': str(self.folder / 'observations'),
            'microphone': f'file:{self.folder}/chirp.wav',
            'speaker': f'file:{self.folder}/heard.wav'}}}))
        process = subprocess.Popen(
            [sys.executable, '-m', 'rt_robot_os.gateway.program', '--robot', 'robot',
             '--ros-args', '--params-file', str(path)], cwd='/', env={
                 **os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(self.folder),
                 'PYTHONPATH': str(ROOT), 'RT_ROBOT_OS_CALL_TIMES': str(self.folder / 'spoken')})
        try:
            yield
        finally:
            process.terminate()
            process.wait(20)


def measure_pictures(page: Any, seconds: float) -> dict[str, Any]:
    """Measure how old pictures are when they are drawn."""
    page.locator('.picture-live').wait_for(timeout=30_000)
    page.evaluate(DRAWN)
    page.wait_for_timeout(seconds * 1000)
    ages = page.evaluate('() => window.ages')
    return {**spread(ages), 'rate_hz': round(len(ages) / seconds, 1)}


def measure_voice(page: Any, world: World, seconds: float) -> dict[str, Any]:
    """Measure a call."""
    (world.folder / 'spoken').write_text('')
    begun_s = time.monotonic()
    page.evaluate(LISTEN, [EAR])
    set_up_ms = 1000 * (time.monotonic() - begun_s)
    page.wait_for_timeout(seconds * 1000)
    heard = page.evaluate('() => window.heard')
    page.evaluate('() => window.call.hangUp()')
    time.sleep(1.0)
    to_browser = moments_ms(heard['theirs'], world.period)
    spoken = [utc_ns / 1e6 + n * PERIOD_S * 1000
              for utc_ns, sample in map(json.loads, (
                  world.folder / 'spoken').read_text().splitlines()[:1])
              for n in range(int(seconds / PERIOD_S) + 1)]
    with wave.open(str(world.folder / 'heard.wav')) as file:
        samples = np.frombuffer(file.readframes(file.getnframes()), np.int16)
    times = [json.loads(line) for line in (
        world.folder / 'heard.wav.times').read_text().splitlines()]
    at_robot = [times[at // 480][0] / 1e6 + (at % 480) * 1000 / RATE_HZ
                for at in found_at(samples, world.period)]
    mine = moments_ms(heard['mine'], world.period)
    return {'set_up_ms': round(set_up_ms), 'to_robot': spread(delays(mine, at_robot)),
            'to_browser': spread(delays(spoken, to_browser))}


def main() -> int:
    """Measure, and print JSON."""
    parser = argparse.ArgumentParser(description='Measure pictures and voice of the monitor.')
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--rounds', type=int, default=5)
    parser.add_argument('--only', choices=('pictures', 'voice'))
    arguments = parser.parse_args()
    from playwright.sync_api import sync_playwright
    path = os.environ.get('RT_ROBOT_OS_BROWSER') or shutil.which('chromium')
    result: dict[str, Any] = {'load': os.getloadavg()[0], 'pictures': [], 'voice': []}
    with tempfile.TemporaryDirectory(prefix='rtm') as folder, sync_playwright() as playwright:
        world = World(Path(folder))
        with world.run() as address:
            browser = playwright.chromium.launch(executable_path=path, args=[
                '--no-sandbox', '--use-fake-ui-for-media-stream',
                '--use-fake-device-for-media-stream', '--autoplay-policy=no-user-gesture-required',
                f'--use-file-for-fake-audio-capture={folder}/chirp.wav'])
            context = browser.new_context(bypass_csp=True)
            context.add_cookies([{'name': 'session', 'value': world.cookie,
                                  'url': f'http://{address}'}])
            for _ in range(arguments.rounds):
                page = context.new_page()
                page.goto(f'http://{address}/#/camera')
                page.locator('.picture-live').wait_for(timeout=60_000)
                page.evaluate("() => { window.robotId = 'robot'; }")
                if arguments.only != 'voice':
                    result['pictures'].append(measure_pictures(page, arguments.seconds))
                if arguments.only != 'pictures':
                    result['voice'].append(measure_voice(page, world, arguments.seconds))
                page.close()
            browser.close()
    print(json.dumps(result, indent=2))
    return 0


if __name__ == '__main__':
    sys.exit(main())

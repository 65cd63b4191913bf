// @ts-check
/**
 * The clips of the robots: JPEGs one after another in an AVI (Motion JPEG), which browsers do not
 * play. An empty frame means that the one before it still stands.
 */

const FRAMES_MOST = 100001;
const VIDEO = '00dc';

/**
 * Find the pictures in a clip.
 * @param {ArrayBuffer} buffer the whole file
 * @returns {{width: number, height: number, rateHz: number, frames: Uint8Array[]}} frames: one for
 *   each moment, empty where the picture before still stands
 * @throws {Error} it is no such clip; the message says what is wrong
 */
export function parseAvi(buffer) {
  const file = new Reader(buffer);
  if (file.length < 12 || file.text(0) !== 'RIFF' || file.text(8) !== 'AVI ') {
    throw new Error('no AVI');
  }
  const found = {};
  for (const chunk of file.chunks(12, Math.min(file.length, 8 + file.number(4)))) {
    if (chunk.name === 'LIST') {
      found[file.text(chunk.at)] = chunk;
    } else {
      found[chunk.name] = chunk;
    }
  }
  if (!found.hdrl || !found.movi || !found.idx1) {
    throw new Error('an AVI without header, pictures or index');
  }
  return {...headerOf(file, found.hdrl), frames: framesOf(file, found.movi, found.idx1)};
}

function headerOf(file, list) {
  for (const chunk of file.chunks(list.at + 4, list.at + list.size)) {
    if (chunk.name === 'avih' && chunk.size >= 40) {
      const periodUs = file.number(chunk.at);
      return {
        rateHz: periodUs > 0 ? 1e6 / periodUs : 1,
        width: file.number(chunk.at + 32),
        height: file.number(chunk.at + 36),
      };
    }
  }
  throw new Error('an AVI without its main header');
}

function framesOf(file, movie, index) {
  const count = Math.floor(index.size / 16);
  if (count > FRAMES_MOST) {
    throw new Error(`${count} pictures are too many`);
  }
  const frames = [];
  for (let at = index.at; at < index.at + 16 * count; at += 16) {
    if (file.text(at) === VIDEO) {
      const start = movie.at + file.number(at + 8);
      const size = file.number(at + 12);
      if (start + 8 + size > movie.at + movie.size || file.text(start) !== VIDEO) {
        throw new Error(`picture ${frames.length} is not where the index says`);
      }
      frames.push(file.bytes(start + 8, size));
    }
  }
  return frames;
}

class Reader {
  constructor(buffer) {
    this.buffer = buffer;
    this.length = buffer.byteLength;
    this.view = new DataView(buffer);
  }

  number(at) {
    return this.view.getUint32(at, true);
  }

  text(at) {
    return String.fromCharCode(...new Uint8Array(this.buffer, at, 4));
  }

  bytes(at, size) {
    return new Uint8Array(this.buffer, at, size);
  }

  /** The chunks between two places; each within them. */
  chunks(from, end) {
    const found = [];
    let at = from;
    while (at + 8 <= end) {
      const size = this.number(at + 4);
      if (at + 8 + size > end) {
        throw new Error(`the AVI ends within a chunk, at ${at}`);
      }
      found.push({name: this.text(at), at: at + 8, size});
      at += 8 + size + (size % 2);
    }
    return found;
  }
}

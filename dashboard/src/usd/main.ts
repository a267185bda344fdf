// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The converter as a program of Node.js: `node - FILE`, which reads this script from its standard
// input. It reads FILE and files below its folder, and writes to standard output: a line of JSON
// {"glb": BYTES, "notes": [...]} or {"error": "..."}, then the bytes of the .glb file. If there is
// {"environment": {"image": BYTES, ...}}, those of the image come after it.

import {readFileSync, realpathSync, writeSync} from 'node:fs';

import {convert} from './convert';
import {UsdError} from './layer';

const FILE_BYTES_MAX = 2 ** 31 - 1;

function write(bytes: Uint8Array) {
  for (let at = 0; at < bytes.length;) {
    try {
      at += writeSync(1, bytes, at);
    } catch (error) {
      // A pipe that is full, where it does not block.
      if ((error as {code?: string}).code !== 'EAGAIN') throw error;
    }
  }
}

const file = realpathSync(process.argv[2] ?? '');
const cut = file.lastIndexOf('/') + 1;
const folder = file.slice(0, cut);

function read(path: string): Uint8Array|undefined {
  try {
    // Links that lead out of the folder are not followed.
    const real = realpathSync(folder + path);
    if (!real.startsWith(folder)) return undefined;
    const bytes = readFileSync(real);
    if (bytes.length > FILE_BYTES_MAX) throw new UsdError(`${path}: it is larger than 2 GiB`);
    // Not Node's own kind of array, whose slices are no copies.
    return new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  } catch (error) {
    if (error instanceof UsdError) throw error;
    return undefined;
  }
}

const line = (value: unknown) => write(new TextEncoder().encode(JSON.stringify(value) + '\n'));
try {
  const {glb, notes, environment} = convert(read, file.slice(cut));
  line({
    glb: glb.length,
    notes,
    environment: environment &&
        {
          ...environment, image: environment.image.length
        }
  });
  write(glb);
  if (environment) write(environment.image);
} catch (error) {
  const isOurs = error instanceof UsdError;
  const tooLarge = error instanceof RangeError && /length|allocation/i.test(error.message);
  line({
    error: isOurs ? error.message :
        tooLarge  ? 'it needs too much memory' :
                    `it is broken, or has something that is not known (${(error as Error).message})`
  });
}

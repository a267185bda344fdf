// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Dome lights: the image that surrounds the scene, which glTF has no place for.

import {assetText} from './assets';
import type {Assets} from './assets';
import {Asset} from './layer';
import {emission} from './lights';
import {decompose, multiply, ofQuaternion, rotationOf} from './matrix';
import type {Matrix} from './matrix';
import type {Note} from './mesh';
import {decodeImage, srgbToLinear} from './pixels';
import type {Pixels} from './pixels';
import type {StagePrim} from './stage';

// It is given beside the .glb file.
export interface Environment {
  // An equirectangular image: its center is +x, its top +y, its right +z.
  image: Uint8Array;
  ending: string;
  // Nine numbers, row by row: a direction of the image from one of the scene.
  rotation: number[];
  // Red, green and blue are multiplied by it.
  scale: number[];
}

// Pixels by sRGB's curve as Radiance's RGBE.
function radianceOf({width, height, data}: Pixels): Uint8Array {
  const head =
      new TextEncoder().encode(`#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y ${height} +X ${width}\n`);
  const result = new Uint8Array(head.length + data.length);
  result.set(head);
  for (let i = 0; i < data.length; i += 4) {
    const linear = [0, 1, 2].map(k => srgbToLinear(data[i + k]! / 255));
    const exponent = Math.ceil(Math.log2(Math.max(...linear, 1e-6) * 256 / 255));
    linear.forEach((v, k) => {
      result[head.length + i + k] = Math.round(v * 256 / 2 ** exponent);
    });
    result[head.length + i + 3] = exponent + 128;
  }
  return result;
}

// Two pixels of the value 1, as Radiance's RGBE.
const WHITE = new Uint8Array([
  ...new TextEncoder().encode('#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n'),
  128,
  128,
  128,
  129,
  128,
  128,
  128,
  129,
]);

// `world`: the dome's transform, with the turn of the up axis. Undefined, with a note: no image.
export function environmentOf(
    prim: StagePrim, world: Matrix, assets: Assets, note: Note, isZUp: boolean): Environment|
    undefined {
  const name = prim.attribute('inputs:texture:file') ? 'inputs:texture:file' : 'texture:file';
  const attribute = prim.attribute(name);
  const file = prim.value(name);
  let image: Uint8Array = WHITE;
  let ending = '.hdr';
  if (attribute && file instanceof Asset && file.path !== '') {
    const id = assets.resolve(attribute.id, file.path);
    const bytes = id && assets.bytes(id);
    if (!id || !bytes) {
      note('images of dome lights that are not there are left out', `${prim.path}: ${file.path}`);
      return undefined;
    }
    const begin = String.fromCharCode(...bytes.slice(0, 4));
    const pixels = decodeImage(bytes);
    if ((pixels && pixels.width !== 2 * pixels.height) ||
        (!pixels && begin !== 'v/1\x01' && !begin.startsWith('#?'))) {
      note('images of dome lights that cannot be read are left out', assetText(id));
      return undefined;
    }
    const format = prim.string('inputs:texture:format') ?? 'automatic';
    if (format !== 'automatic' && format !== 'latlong') {
      note('images of dome lights other than latlong are left out', prim.path);
      return undefined;
    }
    image = pixels ? radianceOf(pixels) : Uint8Array.from(bytes);
    ending = begin === 'v/1\x01' ? '.exr' : '.hdr';
  }
  const pole = prim.string('poleAxis');
  const turnsPole = prim.type === 'DomeLight_1' && (pole === 'Z' || (isZUp && pole !== 'Y'));
  const turned = turnsPole ? multiply(world, rotationOf(0, 90)) : world;
  const m = ofQuaternion(decompose(turned).rotation);
  // The inverse of a rotation is its transpose: columns are rows. The center of a dome's image is
  // its +z, and right of it is its -x.
  const row = (i: number, sign: number) => [0, 1, 2].map(k => sign * m[i * 4 + k]!);
  const rotation = [...row(2, 1), ...row(1, 1), ...row(0, -1)];
  return {image, ending, rotation, scale: emission(prim)};
}

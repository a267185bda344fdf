// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes of USD among dropped files: they become glTF before they are sent.

import type {DroppedFile} from './dropped_files';
import type {UsdReply, UsdRequest} from './usd_worker';

const USD = /\.usd[acz]?$/i;
const OTHERS = /\.(pbrt|gltf|glb|zip)$/i;
const PATIENCE_MS = 10 * 60 * 1000;

const depthOf = (name: string) => name.split('/').length;

// The USD file that is the scene; null: there is none, or the others have one. Several are an
// error, unless all but one are further down.
export function usdSceneOf(files: DroppedFile[]): string|null {
  const names = files.map(({name}) => name).filter((name) => USD.test(name));
  if (names.length === 0 || files.some(({name}) => OTHERS.test(name))) return null;
  const top = Math.min(...names.map(depthOf));
  const scenes = names.filter((name) => depthOf(name) === top);
  if (scenes.length > 1)
    throw new Error('several USD files: drop one, with those that it names in folders below it');
  return scenes[0] ?? null;
}

// The files to send, and notes on what was left out.
export async function withoutUsd(files: DroppedFile[]):
    Promise<{files: DroppedFile[]; notes: string[]}> {
  const scene = usdSceneOf(files);
  if (scene === null) return {files, notes: []};
  const reply = await ask({scene, files});
  if ('failure' in reply) throw new Error(scene + ': ' + reply.failure);
  const name = scene.replace(/.*\//, '') + '.glb';
  return {
    files: [{name, file: new File([reply.glb], name)}],
    notes: reply.notes.map((note) => scene + ': note: ' + note)
  };
}

function ask(request: UsdRequest): Promise<UsdReply> {
  const worker = new Worker(new URL('./usd_worker.ts', import.meta.url), {type: 'module'});
  return new Promise<UsdReply>((resolve) => {
           const timer =
               setTimeout(() => resolve({failure: 'converting it took too long'}), PATIENCE_MS);
           worker.onmessage = ({data}: MessageEvent<UsdReply>) => {
             clearTimeout(timer);
             resolve(data);
           };
           worker.onerror = () => resolve({failure: 'it needs too much memory, or is broken'});
           worker.postMessage(request);
         })
      .finally(() => worker.terminate());
}

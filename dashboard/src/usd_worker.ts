// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts a scene of USD to glTF, apart from the page: its files are untrusted, and may be large.

import {convert} from './usd/convert';
import {UsdError} from './usd/layer';

// The files are those of the scene's folder, with names as in it.
export interface UsdRequest {
  scene: string;
  files: {name: string; file: File}[];
}

export type UsdReply = {
  glb: ArrayBuffer; notes: string[]
}|{failure: string};

const scope = self as unknown as {
  onmessage: ((event: MessageEvent<UsdRequest>) => void)|null;
  postMessage: (reply: UsdReply, transfer?: Transferable[]) => void;
};

scope.onmessage = async ({data: {scene, files}}) => {
  try {
    const bytes = new Map<string, Uint8Array>();
    for (const {name, file} of files) bytes.set(name, new Uint8Array(await file.arrayBuffer()));
    const {glb, notes, environment} = convert((path) => bytes.get(path), scene);
    if (environment) notes.push('dome lights are left out here; sheaf submit has them');
    scope.postMessage({glb: glb.buffer as ArrayBuffer, notes}, [glb.buffer as ArrayBuffer]);
  } catch (error) {
    const {message} = error as Error;
    scope.postMessage(
        {failure: error instanceof UsdError ? message : 'it is broken (' + message + ')'});
  }
};

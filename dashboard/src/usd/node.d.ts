// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The few functions of Node.js that main.ts needs.

declare module 'node:fs' {
  export function readFileSync(path: string): Uint8Array;
  export function realpathSync(path: string): string;
  export function writeSync(descriptor: number, bytes: Uint8Array, offset: number): number;
}

declare const process: {argv: string[]};

// As the types of jpeg-js have it.
declare type Buffer = Uint8Array;

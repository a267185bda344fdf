// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A submission: the files of a scene are sent piece by piece, then the coordinator has the scene
// read and makes a job of it.

import {ApiError, BASE, OWN_PAGE, pathOf, request} from './api';
import type {DroppedFile} from './dropped_files';

// The scenes that the coordinator takes; none if it says why not.
export interface Offer {
  why_not: string;
  bytes_max: number;
  files_max: number;
  piece_bytes_max: number;
}

export interface SubmissionState {
  name: string;
  state: 'receiving'|'reading'|'choosing'|'submitted'|'refused';
  // To choose from.
  scenes: string[];
  // Lines: what is wrong with the scene, or the notes of its job.
  messages: string;
  job: string|null;
}

// Empty fields leave it to the scene.
export interface Wish {
  scene: string;
  title: string;
  samples: string;
  target_error: string;
}

// How often a piece is sent again when the coordinator is away or busy, and how long it waits.
const RETRIES_MAX = 5;
const RETRY_MS = 1000;
const POLL_MS = 400;

export const getOffer = () => request<Offer>(BASE + 'submissions');

const post = <Answer>(path: string, body: BodyInit|null, signal: AbortSignal) =>
    request<Answer>(path, {method: 'POST', headers: OWN_PAGE, body, signal});

const pause = (ms: number) => new Promise((done) => setTimeout(done, ms));

export class Submission {
  private name = '';
  private readonly stopped = new AbortController();

  constructor(private readonly offer: Offer) {}

  // Sends all files. onProgress: gets the number of bytes sent so far.
  async send(files: readonly DroppedFile[], onProgress: (bytes: number) => void) {
    const {signal} = this.stopped;
    this.name = (await post<SubmissionState>(BASE + 'submissions', null, signal)).name;
    let sent = 0;
    for (const {name, file} of files) {
      let offset = 0;
      do {
        const piece = file.slice(offset, offset + this.offer.piece_bytes_max);
        await this.sendPiece(name, offset, piece);
        offset += piece.size;
        sent += piece.size;
        onProgress(sent);
      } while (offset < file.size);
    }
  }

  // Has the scene read; returns when it was, or must be chosen.
  async read(wish: Wish): Promise<SubmissionState> {
    const {signal} = this.stopped;
    const query = new URLSearchParams(Object.entries(wish).filter(([, value]) => value !== ''));
    // "+" is a plus sign to the coordinator.
    const words = query.toString().replaceAll('+', '%20');
    let state = await post<SubmissionState>(pathOf(this.name) + ':read?' + words, null, signal);
    while (state.state === 'reading') {
      await pause(POLL_MS);
      state = await request<SubmissionState>(pathOf(this.name), {signal});
    }
    return state;
  }

  // Ends the transfers in progress and has the coordinator forget the files.
  async stop() {
    this.stopped.abort();
    if (!this.name) return;
    try {
      await post(pathOf(this.name) + ':discard', null, new AbortController().signal);
    } catch {
      // It forgets them by itself after a while.
    }
  }

  private async sendPiece(name: string, offset: number, piece: Blob) {
    const path = pathOf(this.name) + '/files?name=' + encodeURIComponent(name) +
        '&offset=' + offset;
    for (let retries = 0;; ++retries) {
      try {
        await post(path, piece, this.stopped.signal);
        return;
      } catch (failure) {
        const {aborted} = this.stopped.signal;
        if (aborted || retries >= RETRIES_MAX || !mayPass(failure)) throw failure;
        await pause(RETRY_MS);
      }
    }
  }
}

// Whether the same may succeed later: the coordinator was away, or busy.
const mayPass = (failure: unknown) => !(failure instanceof ApiError) || failure.status === 503;

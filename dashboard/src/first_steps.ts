// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// First steps in a farm without jobs: commands with the address of this coordinator, to be copied.
// A step that is done says so.

import * as api from './api';
import type {FarmAddress} from './api';
import {commandField, copyCommand} from './command_field';
import {byId, child, el, setText} from './dom';
import type {Store} from './store';

// The port that commands use without one (kCoordinatorPort of the coordinator).
const DEFAULT_PORT = 7400;
const ATTEMPT = 'asking for the address of the farm';

export class FirstStepsView {
  private readonly list = byId('first-steps-list');
  private farm: FarmAddress|null = null;
  private asked = false;

  constructor(private readonly store: Store) {
    this.list.addEventListener('click', (event) => void this.onClick(event));
    for (const topic of ['jobs', 'workers', 'connection', 'selection'] as const) {
      store.listen(topic, this.draw);
    }
  }

  private readonly draw = () => {
    const {store} = this;
    const isLoaded = store.connection === 'live' || store.connection === 'polling';
    const isEmpty = isLoaded && store.jobs.sorted.length === 0 && !store.jobMissing;
    byId('first-steps').hidden = !isEmpty;
    if (!isEmpty) return;
    if (!this.asked) void this.ask();
    const works = store.workers.sorted.some((worker) => ['idle', 'busy'].includes(worker.state));
    const step = this.list.querySelector<HTMLElement>('[data-step="worker"]');
    if (!step) return;
    step.dataset.done = works ? 'yes' : 'no';
    setText(child(step, 0), works ? WORKER_WORDS + ' Done: a worker is connected.' : WORKER_WORDS);
  };

  private async ask() {
    this.asked = true;
    try {
      this.farm = await api.getFarm();
      this.store.note(ATTEMPT, null);
      this.list.replaceChildren(...stepsOf(this.farm));
      setText(byId('first-steps-note'), noteOf(this.farm));
      this.draw();
    } catch (failure) {
      this.asked = false;
      this.store.note(ATTEMPT, failure);
    }
  }

  private async onClick(event: MouseEvent) {
    const button = (event.target as Element).closest('button');
    if (button) await copyCommand(button);
  }
}

const WORKER_WORDS = 'Start a worker, on as many machines as you like:';

// "farm.example.org" or "farm.example.org:7500".
function addressOf({grpc_port: port}: FarmAddress): string {
  const {hostname} = location;
  return port === DEFAULT_PORT ? hostname : hostname + ':' + port;
}

function makeStep(step: string, words: string, commands: readonly string[]): HTMLElement {
  return el(
      'li', {'data-step': step}, el('p', {}, words),
      ...commands.map((command) => commandField(command, words.replace(/[:.]$/, ''))));
}

function stepsOf(farm: FarmAddress): HTMLElement[] {
  const address = addressOf(farm);
  const to = ' --coordinator ' + address;
  const token = farm.tls ? ' --token token' : '';
  const tokens = farm.tls ?
      [makeStep(
          'tokens', 'On the coordinator’s machine, make a token for each worker and each user:',
          [
            'sheaf-coordinator enroll worker node1 > token',
            'sheaf-coordinator enroll user anna --role submit > user-token'
          ])] :
      [];
  const login = farm.tls ? ['sheaf login ' + address + ' --token-file user-token'] : [];
  return [
    ...tokens,
    makeStep('worker', WORKER_WORDS, ['sheaf-worker' + to + token]),
    makeStep(
        'submit', 'Submit a scene; the image appears here while it is rendered:',
        [...login, 'sheaf submit scene.pbrt' + to + ' --samples 64']),
  ];
}

function noteOf(farm: FarmAddress): string {
  if (farm.tls) return 'A token works once, within an hour.';
  const {hostname} = location;
  const isLocal = hostname === 'localhost' || hostname === '[::1]' || hostname.startsWith('127.');
  return isLocal ?
      'Workers on other machines need certificates: sheaf-coordinator init makes them.' :
      '';
}

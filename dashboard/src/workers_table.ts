// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The workers as a table of the full window, with the sums of those that are shown. Chosen ones are
// drained, and given work again.

import * as api from './api';
import type {Worker} from './api';
import {DataTable, tickColumn} from './data_table';
import type {Column} from './data_table';
import {badge, byId, child, el, setBadge, setText} from './dom';
import * as format from './format';
import type {Store} from './store';
import {cacheOf, doingOf, identityOf} from './worker_words';

// "Seen 3 s ago" changes without an event.
const AGE_MS = 1000;
const ATTEMPT = 'draining workers';

const text = (name: string, width: string, of: (worker: Worker) => string, wide = false) =>
    ({name, width, wide, text: of, key: (worker: Worker) => of(worker).toLowerCase()});

function columnsOf(store: Store): readonly Column<Worker>[] {
  return [
    tickColumn(),
    text('Identity', 'minmax(6rem, 2fr)', identityOf),
    text('Worker', 'minmax(6rem, 2fr)', (worker) => format.shortName(worker.name), true),
    text('Host', 'minmax(5rem, 2fr)', (worker) => worker.host, true),
    {
      name: 'State',
      width: '7.2rem',
      makeCell: () => el('div', {}, badge('idle')),
      draw: (cell, worker) => setBadge(child(cell, 0), worker.state),
      key: (worker) => worker.state
    },
    text('Work', 'minmax(8rem, 4fr)', (worker) => worker.reason || doingOf(store, worker), true),
    {
      name: 'Samples/s',
      width: '5.5rem',
      text: (worker) => format.count(worker.samples_per_second),
      key: (worker) => worker.samples_per_second
    },
    {
      name: 'Threads',
      width: '4.8rem',
      wide: true,
      text: (worker) => String(worker.thread_count),
      key: (worker) => worker.thread_count
    },
    {
      name: 'Results',
      width: '5rem',
      wide: true,
      text: (worker) => format.exact(worker.result_count),
      key: (worker) => worker.result_count
    },
    {
      name: 'Scenes',
      width: '8rem',
      wide: true,
      text: cacheOf,
      key: (worker) => worker.scene_memory_bytes ?? 0
    },
    text('Pool, tags', 'minmax(5rem, 1fr)', placeOf, true),
    {
      name: 'Seen',
      width: '5.5rem',
      wide: true,
      text: (worker) => format.ago(worker.last_seen_time),
      key: (worker) => worker.last_seen_time
    },
  ];
}

const placeOf = ({pool, tags}: Worker) => [pool || 'default', ...tags].join(', ');

const mayDrain = ({state, drained}: Worker) => !drained && !['lost', 'stopped'].includes(state);
const mayUndrain = ({state, drained}: Worker) => drained && !['lost', 'stopped'].includes(state);

export class WorkersTable {
  private readonly table: DataTable<Worker>;
  private readonly filter = byId<HTMLInputElement>('worker-filter');
  private readonly state = byId<HTMLSelectElement>('worker-state-filter');
  private busy = false;

  // `open` shows the frame that a worker renders.
  constructor(private readonly store: Store, open: (name: string) => void) {
    this.table = new DataTable(byId('workers-table'), {
      label: 'Workers',
      rowHeightProperty: '--table-row',
      columns: columnsOf(store),
      sortedBy: 'Identity',
      descending: false,
      onOpen: ({leases: [lease]}) => {
        if (lease && !lease.pilot) open(lease.frame_name);
      },
      onChoice: () => this.drawChoice(),
    });
    byId('worker-drain').addEventListener('click', () => void this.drain(true));
    byId('worker-undrain').addEventListener('click', () => void this.drain(false));
    this.filter.addEventListener('input', this.draw);
    this.state.addEventListener('change', this.draw);
    for (const topic of ['workers', 'view'] as const) store.listen(topic, this.draw);
    setInterval(this.draw, AGE_MS);
    this.drawChoice();
  }

  private readonly draw = () => {
    if (this.store.view !== 'workers') return;
    const all = this.store.workers.sorted;
    const words = this.filter.value.toLowerCase().split(/\s+/).filter((word) => word !== '');
    const {value: state} = this.state;
    const shown = words.length === 0 && !state ?
        all :
        all.filter((worker) => (!state || worker.state === state) && this.matches(worker, words));
    setText(byId('worker-totals'), totalsOf(shown, all.length));
    byId('workers-table').hidden = shown.length === 0;
    byId('workers-table-empty').hidden = shown.length > 0;
    setText(
        byId('workers-table-empty'),
        all.length ? 'No worker matches.' : 'No workers yet. Start one with: sheaf-worker');
    this.table.setItems(shown);
    this.drawChoice();
  };

  private matches(worker: Worker, words: readonly string[]): boolean {
    const {name, identity, host, state, pool, tags} = worker;
    const text = [
      name, identity, host, state, pool, ...tags, doingOf(this.store, worker)
    ].join(' ').toLowerCase();
    return words.every((word) => text.includes(word));
  }

  private drawChoice() {
    const chosen = this.table?.chosenItems ?? [];
    const {role} = this.store;
    const mayOperate = ['', 'operate', 'administer'].includes(role);
    const buttons: [string, string, (worker: Worker) => boolean, string][] = [
      ['worker-drain', 'Drain', mayDrain, 'They finish what they hold, and get no further work'],
      ['worker-undrain', 'Undrain', mayUndrain, 'They get work again'],
    ];
    for (const [id, word, may, meaning] of buttons) {
      const count = chosen.filter(may).length;
      const button = byId<HTMLButtonElement>(id);
      button.disabled = this.busy || count === 0 || !mayOperate;
      button.title =
          mayOperate ? meaning : 'This needs the role operate; you have the role ' + role;
      setText(button, word + (count > 0 ? ' ' + count : ''));
    }
  }

  private async drain(drain: boolean) {
    const workers = this.table.chosenItems.filter(drain ? mayDrain : mayUndrain);
    this.store.note(ATTEMPT, null);
    this.busy = true;
    this.drawChoice();
    for (const {name} of workers) {
      try {
        const [worker, changed] = await this.store.answers.to(() => api.drainWorker(name, drain));
        if (!changed.has(name)) this.store.setWorker(worker);
      } catch (failure) {
        this.store.note(ATTEMPT, failure);
        break;  // The others would be refused for the same reason.
      }
    }
    this.busy = false;
    this.store.touch('workers');
  }
}

// "500 workers: 333 busy, 167 lost · 500 threads · 609 M samples/s".
function totalsOf(workers: readonly Worker[], all: number): string {
  const counts = new Map<string, number>();
  let threads = 0, rate = 0;
  for (const {state, thread_count, samples_per_second} of workers) {
    counts.set(state, (counts.get(state) ?? 0) + 1);
    if (['lost', 'stopped'].includes(state)) continue;
    threads += thread_count;
    rate += samples_per_second;
  }
  const states = [...counts].sort().map(([state, count]) => count + ' ' + state);
  const of = workers.length === all ? format.exact(all) : workers.length + ' of ' + all;
  const counted = (text: string, count: number, word: string) =>
      text + ' ' + word + (count === 1 ? '' : 's');
  return counted(of, all, 'worker') + (states.length ? ': ' + states.join(', ') : '') + ' · ' +
      counted(format.exact(threads), threads, 'thread') + ' · ' + format.count(rate) + ' samples/s';
}

// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The jobs as a table of the full window: sorted by any column, filtered, and changed several at a
// time.

import type {Job} from './api';
import {BulkActions} from './bulk_actions';
import {DataTable, tickColumn} from './data_table';
import type {Column} from './data_table';
import {badge, byId, child, el, progressBar, setBadge, setProgress, setText} from './dom';
import * as format from './format';
import {filterJobs} from './job_filter';
import type {Store} from './store';

const numberOf = (job: Job) => Number(format.shortName(job.name));

const COLUMNS: readonly Column<Job>[] = [
  tickColumn(),
  {name: 'No.', width: '4rem', text: (job) => format.shortName(job.name), key: numberOf},
  {
    name: 'Job',
    width: 'minmax(9rem, 3fr)',
    text: (job) => job.title || job.name,
    key: (job) => (job.title || job.name).toLowerCase()
  },
  {
    name: 'Owner',
    width: 'minmax(4rem, 1fr)',
    wide: true,
    text: (job) => job.owner,
    key: (job) => job.owner
  },
  {
    name: 'Show',
    width: 'minmax(4rem, 1fr)',
    wide: true,
    text: (job) => job.show,
    key: (job) => job.show
  },
  {
    name: 'State',
    width: '6.6rem',
    makeCell: () => el('div', {}, badge('queued')),
    draw: (cell, job) => setBadge(child(cell, 0), job.state),
    key: (job) => job.state
  },
  {
    name: 'Done',
    width: '8rem',
    wide: true,
    makeCell: () => el('div', {class: 'cell-bar'}, progressBar('Progress'), el('span')),
    draw: (cell, job) => {
      const share = format.doneShare(job.progress);
      setProgress(child(cell, 0), share, job.state);
      setText(child(cell, 1), format.percent(share));
    },
    key: (job) => format.doneShare(job.progress)
  },
  {
    name: 'Error',
    width: '5rem',
    wide: true,
    text: (job) => format.typicalError(job.progress.relative_mse),
    key: (job) => job.progress.relative_mse ?? Infinity
  },
  {
    name: 'Priority',
    width: '5rem',
    wide: true,
    text: (job) => format.signed(job.priority),
    key: (job) => job.priority
  },
  {
    name: 'Remarks',
    width: 'minmax(7rem, 4fr)',
    wide: true,
    text: remarksOf,
    key: remarksOf,
  },
  {
    name: 'Submitted',
    width: '8.5rem',
    wide: true,
    text: (job) => format.shortTimeOfDay(job.create_time),
    key: (job) => job.create_time
  },
  {
    name: 'Time',
    width: '6rem',
    wide: true,
    text: (job) => format.duration(job.progress.wall_duration_seconds),
    key: (job) => job.progress.wall_duration_seconds
  },
];

// Why it waits or has failed, or the time that is left.
function remarksOf(job: Job): string {
  const left = job.progress.remaining_duration_seconds;
  const time = job.state === 'running' && left !== null ? format.duration(left) + ' left' : '';
  return job.failure || job.waiting_reason || job.warning || time;
}

export class JobsTable {
  private readonly table: DataTable<Job>;
  private readonly bulk: BulkActions;
  private readonly filter = byId<HTMLInputElement>('table-filter');
  private readonly state = byId<HTMLSelectElement>('table-state-filter');

  // `open` shows a job's image.
  constructor(private readonly store: Store, open: (name: string) => void) {
    this.table = new DataTable(byId('jobs-table'), {
      label: 'Jobs',
      rowHeightProperty: '--table-row',
      columns: COLUMNS,
      sortedBy: 'No.',
      descending: true,
      onOpen: (job) => open(job.name),
      onChoice: () => this.drawChoice(),
    });
    this.bulk = new BulkActions(store, () => this.table.chosenItems);
    byId('table-choose-none').addEventListener('click', () => this.table.chooseNone());
    this.filter.addEventListener('input', this.draw);
    this.state.addEventListener('change', this.draw);
    for (const topic of ['jobs', 'view'] as const) store.listen(topic, this.draw);
  }

  private readonly draw = () => {
    if (this.store.view !== 'jobs') return;
    const all = this.store.jobs.sorted;
    const shown = filterJobs(all, this.state.value, this.filter.value);
    setText(
        byId('table-count'),
        shown.length === all.length ? format.exact(all.length) :
                                      shown.length + ' of ' + all.length);
    byId('table-empty').hidden = shown.length > 0;
    setText(byId('table-empty'), all.length ? 'No job matches.' : 'No jobs yet.');
    byId('jobs-table').hidden = shown.length === 0;
    this.table.setItems(shown);
    this.bulk.draw();
  };

  private drawChoice() {
    const count = this.table.chosenItems.length;
    setText(
        byId('table-chosen'),
        count === 0     ? 'Choose jobs by click, Ctrl, Shift or Space' :
            count === 1 ? '1 job chosen' :
                          format.exact(count) + ' jobs chosen');
    byId<HTMLButtonElement>('table-choose-none').disabled = count === 0;
    this.bulk?.draw();
  }
}

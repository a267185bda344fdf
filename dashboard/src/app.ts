// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Starts the dashboard: the store, its views, and the address bar, whose URL names the selection so
// that a link leads back to it.

import './viewer.css';
import './style.css';
import './frames.css';
import './effects.css';
import './submit.css';
import './table.css';

import {CountersView} from './counters';
import {byId, setText} from './dom';
import {EffectsView} from './effects';
import {FailuresView} from './failures';
import {FarmViews} from './farm_views';
import {FirstStepsView} from './first_steps';
import * as format from './format';
import {FramesView} from './frames';
import {HistoryView} from './history';
import {ImageView} from './image_view';
import {JobActions} from './job_actions';
import {JobDetailsView} from './job_details';
import {JobLogView} from './job_log';
import {JobSettingsView} from './job_settings';
import {JobsView} from './jobs';
import {JobsTable} from './jobs_table';
import {startKeys} from './keys';
import {Live} from './live';
import {startSession} from './session';
import {SetAsideView} from './set_aside';
import {Store, UNREACHABLE} from './store';
import {SubmitDialog} from './submit_dialog';
import {startTabs} from './tabs';
import {startTheme} from './theme';
import {WorkersView} from './workers';
import {WorkersTable} from './workers_table';

const store = new Store();
let live: Live|null = null;
// Whether the user chose the job; until then the page follows the newest running job.
let chosen = false;

function selectJob(name: string) {
  store.selectJob(name);
  live?.showFrames();
}

const views = new FarmViews(store, () => {
  location.hash = store.frameName ?? store.jobName ?? '';
});

function readAddress() {
  if (views.readAddress()) return;
  const match = /^#(jobs\/[^/]+)(\/frames\/-?\d+)?$/.exec(decodeURI(location.hash));
  if (!match?.[1]) return;
  chosen = true;
  selectJob(match[1]);
  store.selectFrame(match[2] ? match[1] + match[2] : null);
}

function followNewest() {
  if (chosen) return;
  const jobs = store.jobs.sorted;
  const job = jobs.find((candidate) => candidate.state === 'running') ?? store.job ?? jobs[0];
  if (job && job.name !== store.jobName) selectJob(job.name);
}

function drawHead() {
  const words =
      {live: 'Live', connecting: 'Connecting', polling: 'Polling', reconnecting: 'Reconnecting'};
  byId('connection').dataset.state = store.connection;
  setText(byId('connection-text'), words[store.connection]);
  const workers = store.workers.sorted;
  const there = workers.filter((worker) => !['lost', 'stopped'].includes(worker.state));
  const busy = there.filter((worker) => worker.state === 'busy');
  const rate = busy.reduce((sum, worker) => sum + worker.samples_per_second, 0);
  const running = store.jobs.sorted.filter((job) => job.state === 'running').length;
  setText(byId('total-running'), format.exact(running));
  setText(byId('total-workers'), busy.length + ' / ' + there.length);
  setText(byId('total-rate'), format.count(rate));
  const share = store.job?.state === 'running' ?
      format.percent(format.doneShare(store.job.progress)) + ' · ' :
      '';
  document.title = share + (store.job ? store.job.title + ' · ' : '') + 'Sheaf';
}

function drawProblems() {
  const lines: string[] = [];
  for (const [attempt, why] of store.problems) lines.push(problemWords(attempt, why));
  setText(byId('problems-text'), lines.join('\n'));
  byId('problems').hidden = lines.length === 0;
}

// A coordinator that is away fails every request: the page says so once.
function problemWords(attempt: string, why: string): string {
  return attempt === UNREACHABLE ? why : 'Failed: ' + attempt + ' (' + why + ')';
}

startTheme();
startTabs(byId('farm-tabs'));
void startSession(store);
for (const topic of ['jobs', 'workers', 'connection', 'selection'] as const) {
  store.listen(topic, drawHead);
}
store.listen('problems', drawProblems);
byId('problems-dismiss').addEventListener('click', () => store.dismissProblems());
store.listen('jobs', followNewest);

// Each view is made in a task of its own, for none should take long.
async function startViews() {
  const select = (name: string) => {
    location.hash = name;
  };
  let made: JobActions|null = null;
  let image: ImageView|null = null;
  const actions = () => made ??= new JobActions(store);
  const makers = [
    () => new JobsView(store, select),
    () => new JobDetailsView(store),
    () => new EffectsView(store),
    () => new FailuresView(store, actions()),
    () => new SetAsideView(store, actions()),
    () => new FramesView(store, select, () => live?.showMoreFrames()),
    () => image = new ImageView(store),
    () => new JobSettingsView(store),
    () => new JobLogView(store),
    () => new WorkersView(store),
    () => new JobsTable(store, select),
    () => new WorkersTable(store, select),
    () => new HistoryView(store),
    () => new CountersView(store),
    () => new FirstStepsView(store),
    () => new SubmitDialog(store, select),
  ];
  for (const make of makers) {
    make();
    await new Promise((done) => setTimeout(done));
  }
  startKeys(store, views, () => image, select);
  addEventListener('hashchange', readAddress);
  readAddress();
  live = new Live(store);
  for (const topic of ['jobs', 'workers', 'frames', 'counters'] as const) store.touch(topic);
  await startChart();
}

// The chart and its library are loaded after the page, which does not wait for them.
async function startChart() {
  try {
    const {ErrorChart} = await import('./error_chart');
    new ErrorChart(store);
  } catch (failure) {
    store.note('loading the chart', failure);
  }
}
void startViews();

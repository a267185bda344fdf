// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The files that the user drops on the page or chooses, with names as in their folder.

export interface DroppedFile {
  // With "/" between its parts, as in "shot/textures/wood.png".
  name: string;
  file: File;
}

// Call within the event: the browser forgets what was dropped when it ends. Folders are walked
// through afterwards. More than countMax files are an error.
export function filesOfDrop(transfer: DataTransfer, countMax: number): Promise<DroppedFile[]> {
  const entries: FileSystemEntry[] = [];
  const alone: DroppedFile[] = [];
  for (const item of transfer.items) {
    if (item.kind !== 'file') continue;
    const entry = item.webkitGetAsEntry();
    const file = entry ? null : item.getAsFile();
    if (entry) entries.push(entry);
    if (file) alone.push(named(file));
  }
  return walk(entries, alone, countMax);
}

export const filesOfInput = (input: HTMLInputElement): DroppedFile[] =>
    [...input.files ?? []].map(named);

const named = (file: File): DroppedFile => ({name: file.webkitRelativePath || file.name, file});

async function walk(
    waiting: FileSystemEntry[], files: DroppedFile[], countMax: number): Promise<DroppedFile[]> {
  for (let entry = waiting.pop(); entry; entry = waiting.pop()) {
    if (isFolder(entry))
      waiting.push(...await entriesOf(entry));
    else if (isFile(entry))
      files.push({name: entry.fullPath.replace(/^\//, ''), file: await fileOf(entry)});
    if (files.length > countMax)
      throw new Error('more than ' + countMax + ' files were dropped; use sheaf submit');
  }
  return files;
}

const isFolder = (entry: FileSystemEntry): entry is FileSystemDirectoryEntry => entry.isDirectory;
const isFile = (entry: FileSystemEntry): entry is FileSystemFileEntry => entry.isFile;

const fileOf = (entry: FileSystemFileEntry) =>
    new Promise<File>((resolve, reject) => entry.file(resolve, reject));

// A reader gives a part of a large folder at each call, and nothing at the end.
async function entriesOf(folder: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = folder.createReader();
  const all: FileSystemEntry[] = [];
  for (;;) {
    const some = await new Promise<FileSystemEntry[]>(
        (resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return all;
    all.push(...some);
  }
}

// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Answers to requests, beside events that arrive while an answer is on its way. Such an event may
// be newer than the answer, which must not undo it; a later event brings what it misses.

export class Answers {
  // For each request on its way: the names of objects that events have changed since.
  private readonly underway = new Set<Set<string>>();

  // An event has changed the object.
  noteEvent(name: string) {
    for (const changed of this.underway) changed.add(name);
  }

  // The answer, and the names of objects that events have changed since it was asked for.
  async to<Type>(ask: () => Promise<Type>): Promise<[Type, ReadonlySet<string>]> {
    const changed = new Set<string>();
    this.underway.add(changed);
    try {
      return [await ask(), changed];
    } finally {
      this.underway.delete(changed);
    }
  }
}

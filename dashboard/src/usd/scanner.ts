// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The words, numbers and strings of the text form.

import {UsdError} from './layer';

const WORD = /[\w:.!\-]+/y;
const NUMBER = /[+-]?(?:\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?|inf|nan)/y;
const SPACE = /(?:[ \t\r\n\uFEFF]+|#[^\n]*|\/\/[^\n]*|\/\*[^]*?\*\/)+/y;

export class Scanner {
  private at = 0;

  constructor(private readonly text: string) {}

  // @throws UsdError with the line
  fail(message: string): never {
    const line = this.text.slice(0, this.at).split('\n').length;
    throw new UsdError(`line ${line}: ${message}`);
  }

  private skipSpace() {
    const c = this.text.charCodeAt(this.at);
    if (c > 32 && c !== 35 && c !== 47 && c !== 0xFEFF) return;
    SPACE.lastIndex = this.at;
    if (SPACE.test(this.text)) this.at = SPACE.lastIndex;
  }

  atEnd(): boolean {
    this.skipSpace();
    return this.at >= this.text.length;
  }

  // The next character that is not space; empty at the end.
  peek(): string {
    this.skipSpace();
    return this.text.charAt(this.at);
  }

  // The next characters.
  rest(count: number): string {
    this.skipSpace();
    return this.text.slice(this.at, this.at + count);
  }

  accept(c: string): boolean {
    if (this.peek() !== c) return false;
    this.at++;
    return true;
  }

  acceptWord(word: string): boolean {
    if (!this.text.startsWith(word, (this.skipSpace(), this.at))) return false;
    this.at += word.length;
    return true;
  }

  expect(c: string) {
    if (!this.accept(c)) {
      this.fail(
          `“${c}” expected, not ${this.atEnd() ? 'the end of the file' : `“${this.peek()}”`}`);
    }
  }

  private match(what: RegExp, name: string): string {
    this.skipSpace();
    what.lastIndex = this.at;
    const found = what.exec(this.text);
    if (!found) this.fail(`${name} expected`);
    this.at = what.lastIndex;
    return found[0];
  }

  word(): string {
    return this.match(WORD, 'a word');
  }

  atNumber(): boolean {
    return /^(?:[+\-.\d]|inf\b|nan\b)/.test(this.rest(4));
  }

  number(): number {
    const text = this.match(NUMBER, 'a number');
    if (text.endsWith('inf')) return text.startsWith('-') ? -Infinity : Infinity;
    return Number(text);
  }

  // A string in one or three quotes of either kind.
  string(): string {
    const quote = this.peek();
    if (quote !== '"' && quote !== '\'') this.fail('a string in quotes expected');
    const long = this.text.startsWith(quote.repeat(3), this.at);
    const end = long ? quote.repeat(3) : quote;
    const begin = this.at + end.length;
    let at = begin;
    while (!this.text.startsWith(end, at)) {
      if (at >= this.text.length) this.fail('a string does not end');
      at += this.text[at] === '\\' ? 2 : 1;
    }
    this.at = at + end.length;
    return this.text.slice(begin, at).replace(
        /\\(.)/g,
        (_, c: string) => c === 'n' ? '\n' :
            c === 't'               ? '\t' :
                                      c);
  }

  asset(): string {
    this.skipSpace();
    const end = this.text.startsWith('@@@', this.at) ? '@@@' : '@';
    return this.between(end, end, 'a file in @...@');
  }

  path(): string {
    return this.between('<', '>', 'a path in <...>');
  }

  private between(begin: string, end: string, name: string): string {
    this.skipSpace();
    if (!this.text.startsWith(begin, this.at)) this.fail(`${name} expected`);
    const close = this.text.indexOf(end, this.at + begin.length);
    if (close < 0) this.fail(`${name} does not end`);
    const inner = this.text.slice(this.at + begin.length, close);
    this.at = close + end.length;
    return inner;
  }
}

// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The page of `sheaf study`: one HTML that loads nothing. Script and style are put into study.html;
// the program puts the study's JSON in place of the mark that is left.

import {readFileSync} from 'node:fs';
import {defineConfig} from 'vite';
import type {Plugin} from 'vite';

// Puts a text in place of a mark. A function, as a text may hold what replace() has a meaning for.
const put = (page: string, mark: string, text: string) => page.replace(mark, () => text);

function onePage(): Plugin {
  return {
    name: 'sheaf-one-page',
    // After Vite's own plugins, which make the style sheet.
    enforce: 'post',
    generateBundle(_, bundle) {
      let page = readFileSync('study.html', 'utf8');
      for (const [name, file] of Object.entries(bundle)) {
        const [mark, text] =
            file.type === 'chunk' ? ['@script@', file.code] : ['@style@', String(file.source)];
        // An end of the element within it would end it there.
        if (/<\/(script|style)|<!--/i.test(text)) throw new Error(name + ' ends its own element');
        page = put(page, mark, text);
        delete bundle[name];
      }
      this.emitFile({type: 'asset', fileName: 'study.html', source: page});
    },
  };
}

export default defineConfig({
  plugins: [onePage()],
  build: {
    outDir: 'dist_study',
    target: 'es2022',
    modulePreload: false,
    cssCodeSplit: false,
    rollupOptions: {input: 'src/study/study.ts', output: {format: 'iife'}},
  },
});
